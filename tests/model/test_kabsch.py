"""Laws of the weighted Kabsch fit and of motions as tensors."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from lidaraccum.geometry import rigid
from lidaraccum.model.kabsch import about, chain, fit_rigid, invert, move, nearest_rotation


def random_motions(count: int, seed: int = 0) -> torch.Tensor:
    rng = np.random.default_rng(seed)
    return torch.from_numpy(
        np.stack([rigid.exponential(rng.normal(0, 1, 6)) for _ in range(count)])
    )


def cloud(seed: int, flat: bool = False) -> torch.Tensor:
    points = torch.randn(3, 20, 3, generator=torch.Generator().manual_seed(seed)).double()
    if flat:
        points[..., 2] = 0.0
    return points * 10


@pytest.mark.parametrize("flat", [False, True])
def test_a_known_motion_is_found(flat: bool) -> None:
    motion, source = random_motions(3), cloud(1, flat)
    weight = torch.rand(3, 20, generator=torch.Generator().manual_seed(2)).double()
    torch.testing.assert_close(
        fit_rigid(source, move(motion, source), weight), motion, atol=1e-4, rtol=0
    )


def test_points_without_weight_have_no_say() -> None:
    motion, source = random_motions(3), cloud(1)
    target = move(motion, source)
    weight = torch.ones(3, 20).double()
    target[:, :5] += 100.0
    weight[:, :5] = 0.0
    torch.testing.assert_close(fit_rigid(source, target, weight), motion, atol=1e-4, rtol=0)


def test_without_any_weight_it_stands_still() -> None:
    still = fit_rigid(cloud(1), cloud(2), torch.zeros(3, 20).double())
    torch.testing.assert_close(still, torch.eye(4).double().expand(3, 4, 4))


def test_a_mirror_image_is_answered_by_a_rotation() -> None:
    source = cloud(1)
    target = source * torch.tensor([1.0, 1.0, -1.0])
    rotation = fit_rigid(source, target, torch.ones(3, 20).double())[:, :3, :3]
    torch.testing.assert_close(torch.linalg.det(rotation), torch.ones(3).double())


def test_the_gradient_is_that_of_differences() -> None:
    source = cloud(3)[:2, :6].clone().requires_grad_()
    target = cloud(4)[:2, :6].clone().requires_grad_()
    weight = torch.rand(2, 6).double().requires_grad_()
    assert torch.autograd.gradcheck(fit_rigid, (source, target, weight), atol=1e-5)


def test_the_gradient_survives_a_symmetric_cloud() -> None:
    moment = (2.0 * torch.eye(3).double())[None].requires_grad_()
    assert torch.autograd.gradcheck(nearest_rotation, (moment,), atol=1e-6)


def test_invert_and_chain_and_about_agree_with_matrices() -> None:
    motion = random_motions(4)
    torch.testing.assert_close(chain(motion, invert(motion)), torch.eye(4).double().expand(4, 4, 4))
    centre = torch.tensor([[3.0, -2.0, 1.0]]).double()
    points = cloud(5)[:1].expand(4, -1, -1)
    there = move(about(motion, centre), points - centre) + centre
    torch.testing.assert_close(there, move(motion, points))
    torch.testing.assert_close(about(about(motion, centre), -centre), motion)


def test_motions_keep_their_precision_under_autocast() -> None:
    motion, points = random_motions(1).float(), cloud(1)[:1].float()
    with torch.autocast("cpu", torch.bfloat16):
        moved = move(motion, points)
    torch.testing.assert_close(moved, move(motion.double(), points.double()).float())
