"""Adam; or Muon for the layers' matrices and Adam for the rest, behind one small interface."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import torch

from lidaraccum.model.precision import has_bfloat16

ADAM_MEMORY = ("exp_avg", "exp_avg_sq")
MUON_MEMORY = "momentum_buffer"
MEMORY = (*ADAM_MEMORY, MUON_MEMORY)
"""What an optimiser remembers of a weight, by torch's names."""

NARROWEST = 16
"""Matrices with fewer rows or columns are left to Adam: there is little to orthogonalise."""

MOMENTUM = 0.95
QUINTIC = (3.4445, -4.7750, 2.0315)
ROUNDS = 5
LIKE_ADAM = 0.2
"""Root mean square of what Adam adds to a weight, in rates."""


class Optimiser:
    """Changes a network's weights by their gradients.

    Muon (Jordan et al. 2024) moves a layer's weights by its momentum made orthogonal: all
    directions that the layer knows are learned as fast. A kernel counts as the matrix of what each
    output channel takes from each input at each place. Steps are scaled to be as long as Adam's, so
    that one rate suits both (Liu et al. 2025). Torch's own is not used: it multiplies in bfloat16
    everywhere, which takes a processor without units for it fifty times as long.

    Args:
        network: Its weights; they must be changed in place only.
        rate: Learning rate at first.
        muon: For the layers' matrices, else Adam for all.
    """

    def __init__(self, network: torch.nn.Module, rate: float, *, muon: bool = False) -> None:
        named = dict(network.named_parameters())
        self._named = named
        self._muon = {
            name: dict[str, torch.Tensor]()
            for name, weight in named.items()
            if muon and _is_matrix(weight)
        }
        rest = [weight for name, weight in named.items() if name not in self._muon]
        self._adam = torch.optim.Adam(rest, lr=rate)

    def step(self, rate: float) -> None:
        """One step along the gradients that the weights carry."""
        for group in self._adam.param_groups:
            group["lr"] = rate
        self._adam.step()
        for name, state in self._muon.items():
            _muon_step(self._named[name], state, rate)

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
                    state[key] = told.to(self._named[name]).detach().clone()
            if ADAM_MEMORY[0] in state:
                state["step"] = torch.tensor(float(step))

    def _states(self) -> Iterator[tuple[str, dict[str, torch.Tensor]]]:
        for name, weight in self._named.items():
            yield name, self._muon[name] if name in self._muon else self._adam.state[weight]


def _is_matrix(weight: torch.Tensor) -> bool:
    return weight.ndim >= 2 and min(len(weight), weight[0].numel()) >= NARROWEST


@torch.no_grad()
def _muon_step(weight: torch.Tensor, state: dict[str, torch.Tensor], rate: float) -> None:
    """One step of a layer's weights, of which a row of the matrix is an output channel's."""
    if weight.grad is None:
        return
    gradient = weight.grad.flatten(1)
    if MUON_MEMORY not in state:
        state[MUON_MEMORY] = torch.zeros_like(gradient)
    momentum = state[MUON_MEMORY]
    momentum.lerp_(gradient, 1.0 - MOMENTUM)
    way = orthogonal(gradient.lerp(momentum, MOMENTUM)).view(weight.shape)
    weight.add_(way, alpha=-rate * LIKE_ADAM * max(gradient.shape) ** 0.5)


def orthogonal(matrix: torch.Tensor) -> torch.Tensor:
    """A matrix (R, C) with its singular values brought near one, by Newton-Schulz iteration.

    Jordan et al.'s quintic: after five rounds they lie between 0.7 and 1.2; learning does not need
    them any nearer.
    """
    exact = torch.bfloat16 if has_bfloat16(matrix.device) else torch.float32
    wide = matrix.T if matrix.shape[0] > matrix.shape[1] else matrix
    wide = wide.to(exact) / wide.norm().clamp_min(1e-7)
    first, third, fifth = QUINTIC
    for _ in range(ROUNDS):
        gram = wide @ wide.T
        change = torch.addmm(gram, gram, gram, beta=third, alpha=fifth)
        wide = torch.addmm(wide, change, wide, beta=first)
    return (wide.T if matrix.shape[0] > matrix.shape[1] else wide).to(matrix.dtype)
