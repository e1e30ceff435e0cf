"""Adam; or Muon for the layers' matrices and Adam for the rest, behind one small interface."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import torch

ADAM_MEMORY = ("exp_avg", "exp_avg_sq")
MUON_MEMORY = "momentum_buffer"
MEMORY = (*ADAM_MEMORY, MUON_MEMORY)
"""What an optimiser remembers of a weight, by torch's names."""

NARROWEST = 16
"""Matrices with fewer rows or columns are left to Adam: there is little to orthogonalise."""


class Optimiser:
    """Changes a network's weights by their gradients.

    Muon (Jordan et al. 2024; torch's own) moves a layer's weights by its momentum made orthogonal:
    all directions that the layer knows are learned as fast. A kernel counts as the matrix of what
    each output channel takes from each input at each place. Steps are scaled to be as long as
    Adam's, so that one rate suits both.

    Args:
        network: Its weights; they must be changed in place only.
        rate: Learning rate at first.
        muon: For the layers' matrices, else Adam for all.
    """

    def __init__(self, network: torch.nn.Module, rate: float, *, muon: bool = False) -> None:
        named = dict(network.named_parameters())
        self._named = named
        self._views = {
            name: torch.nn.Parameter(_matrix(weight))
            for name, weight in named.items()
            if muon and _is_matrix(weight)
        }
        rest = [weight for name, weight in named.items() if name not in self._views]
        self._adam = torch.optim.Adam(rest, lr=rate)
        self._muon = None
        if self._views:
            self._muon = torch.optim.Muon(
                self._views.values(), lr=rate, weight_decay=0.0, adjust_lr_fn="match_rms_adamw"
            )

    def step(self, rate: float) -> None:
        """One step along the gradients that the weights carry."""
        _set_rate(self._adam, rate)
        self._adam.step()
        if self._muon is None:
            return
        for name, view in self._views.items():
            gradient = self._named[name].grad
            view.grad = None if gradient is None else _matrix(gradient)
        _set_rate(self._muon, rate)
        self._muon.step()  # type: ignore[no-untyped-call]

    def memory(self) -> dict[str, torch.Tensor]:
        """What it remembers, by ``KEY.WEIGHT``; of nothing that has not been learned yet."""
        return {
            f"{key}.{name}": state[key]
            for name, state in self._states()
            for key in MEMORY
            if key in state
        }

    def recall(self, memory: Mapping[str, torch.Tensor], step: int) -> None:
        """Go on with what another one remembered after so many steps."""
        for name, state in self._states():
            for key in MEMORY:
                told = memory.get(f"{key}.{name}")
                if told is not None:
                    weight = self._views.get(name, self._named[name])
                    state[key] = torch.empty_like(weight).detach().copy_(told)
            if ADAM_MEMORY[0] in state:
                state["step"] = torch.tensor(float(step))

    def _states(self) -> Iterator[tuple[str, dict[str, torch.Tensor]]]:
        for name, weight in self._named.items():
            if self._muon is not None and name in self._views:
                yield name, self._muon.state[self._views[name]]
            else:
                yield name, self._adam.state[weight]


def _is_matrix(weight: torch.Tensor) -> bool:
    return weight.ndim >= 2 and min(len(weight), weight[0].numel()) >= NARROWEST


def _matrix(weight: torch.Tensor) -> torch.Tensor:
    """(O, I) a row an output channel: of a kernel with channels last a view, as it lies."""
    weight = weight.detach()
    if weight.ndim == 4:
        weight = weight.permute(0, 2, 3, 1)
    return weight.flatten(1)


def _set_rate(optimiser: torch.optim.Optimizer, rate: float) -> None:
    for group in optimiser.param_groups:
        group["lr"] = rate
