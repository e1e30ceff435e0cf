"""One gradient from several processes, each with a share of the batch.

Much of a step is one thread's work (gathering, sorting, thousands of small operations): on two
cores, two processes with one thread each learn nearly twice as fast as one with two.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection

import torch

from lidaraccum.model.network import Network
from lidaraccum.model.precision import inference
from lidaraccum.training.objective import ObjectiveSettings, objective
from lidaraccum.training.window import TrainingWindow, make_batch
from lidaraccum.training.workers import begin

_STRIDE = 1 << 40
"""Between the seeds of two shares; those of steps lie closer."""


@dataclass(frozen=True, eq=False)
class _Mate:
    """Another process: where to talk to it, and where it leaves its gradient (P,), shared."""

    pipe: Connection
    gradient: torch.Tensor


class Crew:
    """Processes that share one network's weights.

    Args:
        network: Its weights are moved to shared memory where there is more than one process, and
            must be changed in place only.
        settings: What the loss is made of.
        size: Processes, this one included.
    """

    def __init__(self, network: Network, settings: ObjectiveSettings, size: int) -> None:
        self._network = network
        self._settings = settings
        self._mates: list[_Mate] = []
        if size > 1:
            network.share_memory()
        for _ in range(size - 1):
            self._mates.append(self._hire())

    def learn(self, windows: Sequence[TrainingWindow], seed: int) -> list[float]:
        """Put the mean gradient of a batch into the network; its losses, in `LOSS_NAMES`' order.

        The answer depends on how the batch is shared out, so on the number of processes, as little
        as a mean over shares differs from one over the batch.
        """
        count = 1 + len(self._mates)
        shares = [list(windows[place::count]) for place in range(count)]
        busy = [(mate, share) for mate, share in zip(self._mates, shares[1:], strict=True) if share]
        for place, (mate, share) in enumerate(busy, start=1):
            mate.pipe.send((share, seed + place * _STRIDE))
        numbers = _learn(self._network, shares[0], self._settings, seed)
        weight = len(shares[0]) / len(windows)
        numbers = [weight * number for number in numbers]
        gradients = [p.grad for p in self._network.parameters() if p.grad is not None]
        torch._foreach_mul_(gradients, weight)
        for mate, share in busy:
            weight = len(share) / len(windows)
            theirs: list[float] = mate.pipe.recv()
            numbers = [mine + weight * its for mine, its in zip(numbers, theirs, strict=True)]
            self._add(mate.gradient, weight)
        return numbers

    def _hire(self) -> _Mate:
        context = torch.multiprocessing.get_context("spawn")
        here, there = context.Pipe()
        size = sum(parameter.numel() for parameter in self._network.parameters())
        gradient = torch.zeros(size).share_memory_()  # type: ignore[no-untyped-call]
        work = (there, self._network, gradient, self._settings)
        context.Process(target=_work, args=work, daemon=True).start()
        there.close()
        return _Mate(here, gradient)

    def _add(self, gradient: torch.Tensor, weight: float) -> None:
        for parameter, part in _parts(self._network, gradient):
            if parameter.grad is None:
                parameter.grad = weight * part
            else:
                parameter.grad.add_(part, alpha=weight)


def _work(
    pipe: Connection, network: Network, gradient: torch.Tensor, settings: ObjectiveSettings
) -> None:
    begin()
    while True:
        try:
            windows, seed = pipe.recv()
        except EOFError:
            return
        numbers = _learn(network, windows, settings, seed)
        for parameter, part in _parts(network, gradient):
            if parameter.grad is None:
                part.zero_()
            else:
                part.copy_(parameter.grad)
        pipe.send(numbers)


def _parts(
    network: Network, gradient: torch.Tensor
) -> Iterator[tuple[torch.nn.Parameter, torch.Tensor]]:
    """The network's parameters, each with its part of a flat gradient (P,), a view."""
    parameters = list(network.parameters())
    parts = torch.split(gradient, [parameter.numel() for parameter in parameters])
    for parameter, part in zip(parameters, parts, strict=True):
        yield parameter, part.view(parameter.shape)


def _learn(
    network: Network, windows: Sequence[TrainingWindow], settings: ObjectiveSettings, seed: int
) -> list[float]:
    """Put the gradient of some windows into the network; their losses."""
    network.zero_grad(set_to_none=True)
    device = next(network.parameters()).device
    generator = torch.Generator().manual_seed(seed)
    with inference(device):
        losses = objective(network, make_batch(windows, device), settings, generator)
    losses.total.backward()  # type: ignore[no-untyped-call]
    return losses.numbers()
