"""Warping and reading of maps."""

from __future__ import annotations

import torch

from lidaraccum.model.kabsch import invert
from lidaraccum.model.motion import MotionMap, Windows, read, warp
from lidaraccum.model.network import Network
from lidaraccum.model.settings import NetworkSettings
from lidaraccum.model.temporal import DecayedDifferences, moments


def ramp(size: int = 32) -> torch.Tensor:
    """(1, 2, S, S): each cell holds its own centre's x and y; 0.25 m cells."""
    centres = (torch.arange(size) + 0.5) * 0.25 - size * 0.125
    x, y = torch.meshgrid(centres, centres, indexing="ij")
    return torch.stack([x, y])[None]


def test_a_reading_is_where_it_was_asked_for() -> None:
    xy = torch.tensor([[0.3, -1.7], [2.01, 3.0], [-3.6, 0.0]])
    torch.testing.assert_close(read(ramp(), xy, 4.0), xy)


def test_warped_features_lie_where_the_pose_puts_them() -> None:
    pose = torch.eye(4)
    angle = torch.tensor(0.2)
    pose[:2, :2] = torch.stack([torch.stack([angle.cos(), -angle.sin()]),
                                torch.stack([angle.sin(), angle.cos()])])  # fmt: skip
    pose[:2, 3] = torch.tensor([0.5, -0.3])
    warped, single = warp([ramp(), ramp()[:, :1]], pose, 4.0)
    torch.testing.assert_close(single, warped[:, :1])
    xy = torch.tensor([[0.4, 0.2], [-1.0, 1.5]])
    there = read(warped, xy, 4.0)
    back = invert(pose)
    torch.testing.assert_close(there, xy @ back[:2, :2].T + back[:2, 3], atol=1e-5, rtol=1e-5)


def test_what_lies_beyond_the_grid_is_nothing() -> None:
    pose = torch.eye(4)
    pose[0, 3] = 2.0  # two metres ahead: a quarter of the grid
    (moved,) = warp([torch.ones(1, 3, 8, 8)], pose, 4.0)
    assert (moved[:, :, :2] == 0).all()
    torch.testing.assert_close(moved[:, :, 2:], torch.ones(1, 3, 6, 8))


def test_maps_read_and_warped_have_gradients() -> None:
    one = torch.rand(1, 3, 8, 8, requires_grad=True)
    pose = torch.eye(4)
    pose[:2, 3] = torch.tensor([0.3, -0.6])
    (moved,) = warp([one], pose, 4.0)
    moved[0, :, 4, 4].sum().backward()
    assert one.grad is not None
    torch.testing.assert_close(one.grad.sum(), torch.tensor(3.0))


def test_the_time_a_place_was_taken_rises_along_the_way() -> None:
    """By one frame's time over one frame's way; where something stands it is the same all over."""
    taken = torch.zeros(5, 32, 32)
    for frame in range(5):
        taken[frame, 4 + 3 * frame : 16 + 3 * frame, 5:9] = 1.0  # goes three cells a frame
        taken[frame, 8:20, 20:24] = 1.0
    seconds = 0.1 * torch.arange(5)
    times = torch.stack([seconds, seconds, (seconds == 0).float()], dim=1)
    often, mean, spread, at_target = moments(taken, times)
    slope = torch.diff(mean[4:28, 6])
    assert float(slope.min()) > -1e-6
    middle = torch.diff(mean[4:28:3, 6]) / (0.1 / 0.4)
    assert float(middle.median()) > 0.4
    assert float(mean[8:20, 21].std()) == 0.0
    assert float(spread[10, 21]) > float(spread[5, 6])
    assert torch.equal(at_target, taken[0])
    torch.testing.assert_close(often[8:20, 20:24], torch.ones(12, 4))


def test_time_is_mixed_as_one_convolution_would(network: Network) -> None:
    block = network.motion_map.blocks[0]
    stack = torch.rand(3, block.time.out_channels, 8, 8)
    own = torch.relu(block.space(stack))
    nothing = torch.zeros_like(own[:1])
    three = torch.cat([torch.cat([nothing, own[:-1]]), own, torch.cat([own[1:], nothing])], dim=1)
    expected = stack + torch.relu(block.time(three))
    torch.testing.assert_close(torch.cat(block(stack.split(1))), expected, atol=1e-5, rtol=1e-5)


def at(*seconds: float) -> torch.Tensor:
    """Times of frames, the first the target."""
    gaps = torch.tensor(seconds)
    return torch.stack([gaps, gaps.abs(), (gaps == 0).float()], dim=1)


def test_differences_from_the_target_fade_with_time() -> None:
    """Seen through a mixing that hands the differences on."""
    merge = DecayedDifferences(2)
    with torch.no_grad():
        merge.mix.bias.zero_()
        merge.mix.weight.zero_()
        merge.mix.weight[:, 2:, 0, 0] = torch.eye(2)
    still = torch.rand(1, 2, 4, 4)
    near, far = still + 1.0, still + 3.0
    torch.testing.assert_close(merge([still] * 3, at(0, 0.1, 0.2)), torch.zeros(1, 2, 4, 4))
    torch.testing.assert_close(merge([still], at(0)), torch.zeros(1, 2, 4, 4))
    close = merge([still, near, far], at(0, 0.1, 0.4)).mean()
    wide = merge([still, near, far], at(0, 0.1, 0.2)).mean()
    assert 1.0 < close.item() < wide.item() < 2.0
    close.backward()
    assert merge.log_decay.grad.item() != 0.0


def test_time_put_together_either_way_answers_and_learns() -> None:
    settings = NetworkSettings(
        extent_m=16.0, base_widths=(8, 12), motion_widths=(16, 24), temporal="decay"
    )
    motion_map = MotionMap(settings)
    base = [torch.rand(1, 8, 64, 64) for _ in range(3)]
    poses = torch.eye(4).repeat(3, 1, 1)
    presence, stamps = torch.rand(3, 1, 64, 64), (0.0, 0.1, 0.2)
    said = motion_map(base, presence, poses, Windows.single(3), stamps, 8.0)
    assert said.shape == (1, 16, 32, 32)
    said.sum().backward()
    assert all(one.grad is not None for one in motion_map.merge.parameters())
