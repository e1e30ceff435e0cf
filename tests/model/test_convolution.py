"""Gradients by products of matrices are those that torch works out."""

from __future__ import annotations

import pytest
import torch
from torch import nn

from lidaraccum.model import convolution
from lidaraccum.model.convolution import CELLS, Convolution


@pytest.fixture(params=["wide", "narrow"])
def processor(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.setattr(convolution, "has_wide_units", lambda: request.param == "wide")
    return str(request.param)


CASES = {
    "as large": (3, (2, 13, 17), 1, 1),
    "halved": (3, (2, 16, 12), 2, 1),
    "halved, odd": (3, (3, 15, 11), 2, 1),
    "patches": (3, (2 * CELLS, 5, 5), 1, 0),
    "one cell each": (3, (70, 3, 3), 1, 0),
    "a row is more than is laid out at a time": (3, (1, 3, CELLS + 5), 1, 1),
    "five by five": (5, (2, 9, 9), 2, 2),
}


@pytest.mark.parametrize("case", CASES.values(), ids=CASES.keys())
@pytest.mark.parametrize("bias", [True, False])
def test_what_is_learned_is_what_torch_learns(
    processor: str, case: tuple[int, tuple[int, int, int], int, int], bias: bool
) -> None:
    side, (count, height, width), stride, padding = case
    generator = torch.Generator().manual_seed(7)
    mine = Convolution(6, 10, side, stride=stride, padding=padding, bias=bias)
    its = nn.Conv2d(6, 10, side, stride=stride, padding=padding, bias=bias).double()
    its.load_state_dict(mine.state_dict())
    maps = torch.randn(count, 6, height, width, generator=generator)
    maps = maps.contiguous(memory_format=torch.channels_last)
    answers, learned = [], []
    for layer, given in ((mine, maps.clone()), (its, maps.double())):
        given.requires_grad_()
        answer = layer(given)
        weighed = torch.linspace(-1, 2, answer.numel(), dtype=answer.dtype).view_as(answer)
        (answer * weighed).sum().backward()
        answers.append(answer.float())
        learned.append([one.grad.float() for one in (given, *layer.parameters())])
    torch.testing.assert_close(*answers, rtol=1e-4, atol=1e-4)
    for one, other in zip(*learned, strict=True):
        torch.testing.assert_close(one, other, rtol=1e-3, atol=1e-3 * float(other.abs().max()))


def test_only_what_is_asked_for_is_worked_out(processor: str) -> None:
    layer = Convolution(4, 4, 3, padding=1)
    layer(torch.randn(1, 4, 8, 8)).sum().backward()
    kernel = layer.weight.grad
    assert kernel is not None
    layer.weight.grad = None
    layer.weight.requires_grad_(False)
    maps = torch.randn(1, 4, 8, 8, requires_grad=True)
    layer(maps).sum().backward()
    assert layer.weight.grad is None
    assert maps.grad is not None


def test_in_bfloat16_it_is_torchs(processor: str) -> None:
    layer = Convolution(4, 4, 3, padding=1)
    with torch.autocast("cpu", dtype=torch.bfloat16):
        answer = layer(torch.randn(1, 4, 8, 8))
    assert answer.dtype == torch.bfloat16
    answer.float().sum().backward()
    assert layer.weight.grad is not None
