"""Laws of the maximum over groups."""

from __future__ import annotations

import torch

from lidaraccum.model.pooling import tallest


def test_it_is_the_maximum_of_each_group() -> None:
    generator = torch.Generator().manual_seed(0)
    values = torch.rand(40, 3, generator=generator)
    slot = torch.randint(0, 6, (40,), generator=generator)
    slot[slot == 4] = 5  # nobody's slot
    pooled = tallest(values, slot, 6)
    for group in (0, 1, 2, 3, 5):
        torch.testing.assert_close(pooled[group], values[slot == group].amax(dim=0))
    assert (pooled[4] == 0).all()


def test_it_holds_a_rectifier() -> None:
    values = torch.tensor([[-2.0, 3.0], [-1.0, -4.0]])
    assert tallest(values, torch.tensor([0, 0]), 1).tolist() == [[0.0, 3.0]]


def test_its_gradient_is_that_of_differences() -> None:
    generator = torch.Generator().manual_seed(1)
    values = torch.rand(12, 2, generator=generator, dtype=torch.float64, requires_grad=True)
    slot = torch.randint(0, 4, (12,), generator=generator)
    assert torch.autograd.gradcheck(lambda rows: tallest(rows, slot, 4), (values,))


def test_no_rows_are_no_trouble() -> None:
    values = torch.zeros(0, 2, requires_grad=True)
    tallest(values, torch.zeros(0, dtype=torch.int64), 3).sum().backward()
    assert values.grad is not None
