"""Windows are matched outward from their target, each frame from where steady motion puts it."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from lidaraccum.geometry import rigid
from lidaraccum.model.ego_motion import EgoPillars, Matcher
from lidaraccum.model.kabsch import invert, move
from lidaraccum.model.motion import Windows
from lidaraccum.model.settings import NetworkSettings
from lidaraccum.model.steady import outward, part_of, steady


def drive(stamps: list[float], twist: list[float]) -> torch.Tensor:
    """(T, 4, 4) world_from_sensor at these times of one steady twist, metres and radians a s."""
    poses = [rigid.exponential(stamp * np.array(twist)) for stamp in stamps]
    return torch.from_numpy(np.stack(poses)).float()


def test_frames_are_taken_from_their_target_outward() -> None:
    windows = Windows(lengths=(5, 3), target=(1, 7))
    assert outward(windows) == [[0, 2, 6], [3, 5], [4]]
    assert outward(Windows.single(1)) == []


@pytest.mark.parametrize("target", [0, 2, 4])
@pytest.mark.parametrize("yaw_rate", [0.0, 0.5])
def test_steady_driving_is_foreseen(target: int, yaw_rate: float) -> None:
    """Whatever the times between the frames, and whichever the target."""
    stamps = [0.0, 0.1, 0.3, 0.4, 0.6]
    world = drive(stamps, [0, 0, yaw_rate, 12.0, 0, 0])
    windows = Windows.single(5, target)
    true = invert(world[target]) @ world
    for frames in outward(windows)[1:]:
        foreseen = steady(true, stamps, frames, windows)
        off = torch.linalg.vector_norm((foreseen - true[frames])[:, :3, 3], dim=1)
        assert float(off.max()) < 0.15  # a bend's chord is not its arc


def test_half_a_motion_twice_is_the_motion() -> None:
    motion = drive([1.0], [0.0, 0.02, 0.3, 4.0, 0.0, 0.0])
    half = part_of(motion, torch.tensor([0.5]))
    torch.testing.assert_close((half @ half)[:, :3, :3], motion[:, :3, :3], atol=1e-5, rtol=0)
    torch.testing.assert_close(part_of(motion, torch.ones(1)), motion, atol=1e-5, rtol=0)
    torch.testing.assert_close(part_of(motion, torch.zeros(1))[0], torch.eye(4), atol=1e-6, rtol=0)


def test_where_all_looks_alike_a_good_start_decides() -> None:
    """Poles 4 m apart with one and the same feature; the sensor went past three of them."""
    settings = NetworkSettings(ego_pillars=64, ego_channels=4)
    line = torch.arange(-10, 10).float() * 4.0
    poles = torch.cat([torch.stack([line, y + 0 * line, 0 * line], 1) for y in (-5.0, 6.0)])
    true = drive([1.0], [0.0, 0.0, 0.0, 12.0, 0.1, 0.0])
    seen = move(invert(true), poles[None])
    alike = torch.ones(1, len(poles), 4) / 2.0
    valid, level = torch.ones(1, len(poles), dtype=torch.bool), torch.eye(4)[None]
    source, target = (
        EgoPillars(p, alike, valid, p[:, :0], valid[:, :0], level) for p in (seen, poles[None])
    )
    matcher = Matcher(settings)
    start = true.clone()
    start[:, 0, 3] += 0.6
    with torch.no_grad():
        blind = matcher(source, target, torch.ones(1)).target_from_source
        led = matcher(source, target, torch.ones(1), start).target_from_source
    assert float((led - true)[0, :3, 3].norm()) < 0.1
    assert float((blind - true)[0, :3, 3].norm()) > 1.0
