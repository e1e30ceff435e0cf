"""Laws of the four verbs, on fresh weights."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from lidaraccum.data.frame import Frame
from lidaraccum.geometry import rigid
from lidaraccum.model.batch import prepare, to_tensors
from lidaraccum.model.motion import Windows
from lidaraccum.model.network import FrameFeatures, Network, Perception, build_network


def encode(network: Network, frames: list[Frame], extent_m: float | None = None) -> FrameFeatures:
    return network.encode(to_tensors([prepare(f, network.settings, extent_m) for f in frames]))


def still(count: int) -> torch.Tensor:
    return torch.eye(4).expand(count, 4, 4)


def by_row(features: FrameFeatures, seen: Perception, frame: int) -> dict[int, list[float]]:
    """Foreground, dynamic and offset of one frame's points, by row in the frame."""
    own = seen.frame == frame
    rows = features.frames.rows[seen.point[own]].tolist()
    said = torch.column_stack([seen.foreground, seen.dynamic, seen.offset])[own]
    return dict(zip(rows, said.tolist(), strict=True))


def test_about_four_million_weights() -> None:
    count = sum(parameter.numel() for parameter in build_network().parameters())
    assert 3.5e6 < count < 4.5e6


def test_where_the_affinity_starts_changes_no_other_fresh_weight(network: Network) -> None:
    start = replace(network.settings, slack_start=-5.0, scale_start=-4.0)
    usual = build_network(network.settings, 3).state_dict()
    other = build_network(start, 3).state_dict()
    changed = [name for name, value in usual.items() if not torch.equal(value, other[name])]
    assert changed == ["matcher.offset", "matcher.scale"]
    assert set(other["matcher.offset"].tolist()) == {-5.0}
    assert set(other["matcher.scale"].tolist()) == {-4.0}


@pytest.mark.parametrize("length", range(2, 12))
def test_one_network_takes_any_number_of_frames(
    network: Network, frames: list[Frame], length: int
) -> None:
    chosen = [frames[index % len(frames)] for index in range(length)]
    window = [replace(frame, stamp=0.1 * index) for index, frame in enumerate(chosen)]
    features = encode(network, window, 16.0)
    windows = Windows.single(length, target=length // 2)
    match = network.match_windows(features, windows)
    seen = network.perceive(features, still(length), windows)
    assert match.target_from_source.shape == (length - 1, 4, 4)
    assert set(seen.frame.tolist()) == set(range(length))
    assert torch.isfinite(seen.offset).all()


def test_a_frame_alone_has_nothing_to_match(network: Network, frames: list[Frame]) -> None:
    match = network.match_windows(encode(network, frames[:1], 16.0), Windows.single(1))
    assert match.target_from_source.shape == (0, 4, 4)


def test_the_order_of_points_does_not_matter(network: Network, frames: list[Frame]) -> None:
    rng = np.random.default_rng(0)
    orders = [rng.permutation(len(frame)) for frame in frames[:3]]
    shuffled = [
        frame.with_points(frame.points[order])
        for frame, order in zip(frames[:3], orders, strict=True)
    ]
    first, second = encode(network, frames[:3]), encode(network, shuffled)
    windows = Windows.single(3)
    one, two = (network.match_windows(f, windows).target_from_source for f in (first, second))
    torch.testing.assert_close(one, two, atol=1e-3, rtol=0)
    seen = [network.perceive(features, still(3), windows) for features in (first, second)]
    for index, order in enumerate(orders):
        before = by_row(first, seen[0], index)
        after = {int(order[row]): said for row, said in by_row(second, seen[1], index).items()}
        assert before.keys() == after.keys()
        for row, said in before.items():
            assert after[row] == pytest.approx(said, abs=2e-3)


def test_kept_features_are_fresh_features(network: Network, frames: list[Frame]) -> None:
    """A stream encodes each frame once, alone; a window encodes all together."""
    kept = FrameFeatures.stack([encode(network, [frame]) for frame in frames[:3]])
    fresh = encode(network, frames[:3])
    torch.testing.assert_close(kept.base, fresh.base, atol=1e-4, rtol=1e-4)
    torch.testing.assert_close(kept.foreground, fresh.foreground, atol=1e-4, rtol=1e-4)
    assert torch.equal(kept.ego.position, fresh.ego.position)
    torch.testing.assert_close(kept.ego.feature, fresh.ego.feature, atol=1e-3, rtol=1e-3)
    again = FrameFeatures.stack([fresh.select(index) for index in range(3)])
    assert torch.equal(again.base, fresh.base)
    assert torch.equal(again.ego.valid, fresh.ego.valid)


def test_who_is_not_matched_is_seen_the_same(network: Network, frames: list[Frame]) -> None:
    tensors = to_tensors([prepare(frame, network.settings) for frame in frames[:2]])
    whole, bare = network.encode(tensors), network.encode(tensors, matchable=False)
    assert torch.equal(whole.base, bare.base)
    assert torch.equal(whole.foreground, bare.foreground)
    assert bare.ego.feature.shape == (2, 0, network.settings.ego_channels)
    apart = FrameFeatures.stack([bare.select(1), bare.select(0)])
    assert torch.equal(apart.base, whole.base.flip(0))


def test_windows_in_company_are_windows_alone(network: Network, frames: list[Frame]) -> None:
    features = encode(network, frames[:5], 16.0)
    together = network.perceive(features, still(5), Windows((2, 3), (0, 4)))
    alone = network.perceive(
        FrameFeatures.stack([features.select(index) for index in (2, 3, 4)]),
        still(3),
        Windows.single(3, 2),
    )
    ours = together.frame >= 2
    torch.testing.assert_close(together.dynamic[ours], alone.dynamic, atol=1e-3, rtol=1e-3)
    torch.testing.assert_close(together.offset[ours], alone.offset, atol=1e-3, rtol=1e-3)


def test_a_larger_grid_says_the_same_in_the_middle(network: Network, frames: list[Frame]) -> None:
    small, large = encode(network, frames[:1], 32.0), encode(network, frames[:1], 48.0)
    margin = (192 - 128) // 2
    middle = large.base[:, :, margin:-margin, margin:-margin]
    inner = slice(48, -48)  # further from the edge than the network sees
    torch.testing.assert_close(
        middle[:, :, inner, inner], small.base[:, :, inner, inner], atol=1e-4, rtol=1e-3
    )


def test_moving_the_whole_window_moves_the_answer(network: Network, frames: list[Frame]) -> None:
    """By whole coarse cells along the ground, and in height: another mount, the same street."""
    shift = np.array([4.0, -8.0, 0.6])
    settings = network.settings
    cropped = []
    for frame in frames[:3]:
        # Only points that are well inside the grid before and after.
        near = np.abs(frame.points[:, :2] + shift[:2] / 2).max(axis=1) < 6.0
        cropped.append(frame.with_points(frame.points[near]))
    moved = [frame.with_points(frame.points + shift) for frame in cropped]
    first, second = encode(network, cropped), encode(network, moved)
    cells = np.round(shift[:2] / settings.pillar_m).astype(int)
    rolled = torch.roll(first.base, tuple(cells.tolist()), dims=(2, 3))
    inner = slice(40, -40)
    off = (second.base - rolled)[:, :, inner, inner].abs()
    filled = network.pillars(second.frames)[:, :, inner, inner].abs().sum(dim=1) > 0
    # A point within rounding of a pillar's edge may change pillars; features are of size 1.
    assert float(off.mean(dim=1)[filled].mean()) < 0.05
    places = []
    for features in (first, second):
        seen = network.perceive(features, still(3), Windows.single(3))
        rows = features.frames.rows[seen.point].tolist()
        keys = zip(seen.frame.tolist(), rows, strict=True)
        places.append(dict(zip(keys, seen.position[:, :2].tolist(), strict=True)))
    common = list(places[0].keys() & places[1].keys())
    assert len(common) > 0.9 * len(places[0]) > 100
    went = np.array([places[1][key] for key in common]) - [places[0][key] for key in common]
    np.testing.assert_allclose(went, np.tile(shift[:2], (len(common), 1)), atol=5e-3)


def test_the_same_frame_twice_has_not_moved(network: Network, frames: list[Frame]) -> None:
    features = encode(network, [frames[0], replace(frames[0], stamp=0.1)])
    pose = network.match_windows(features, Windows.single(2)).target_from_source[0]
    torch.testing.assert_close(pose, torch.eye(4), atol=0.25, rtol=0)


def test_poses_are_in_sensor_coordinates(network: Network, frames: list[Frame]) -> None:
    """A tilted mount tilts the answer: the match is the same between the levelled frames."""
    tilt = rigid.exponential(np.deg2rad([4.0, -3.0, 0, 0, 0, 0]))
    tilted = [frame.with_points(rigid.transform(tilt, frame.points)) for frame in frames[:2]]
    level = [
        network.match_windows(encode(network, pair), Windows.single(2))
        for pair in (frames[:2], tilted)
    ]
    mount = torch.from_numpy(tilt).float()
    back = torch.linalg.inv(mount) @ level[1].target_from_source[0] @ mount
    torch.testing.assert_close(back, level[0].target_from_source[0], atol=0.25, rtol=0)


def test_points_that_are_not_read_are_answered_by_their_pillars(
    network: Network, frames: list[Frame]
) -> None:
    features = encode(network, frames[:3], 16.0)
    whole = network.perceive(features, still(3), Windows.single(3))
    count = len(whole.point)
    some = network.perceive(features, still(3), Windows.single(3), most=count // 3 + 1)
    assert torch.equal(some.point, whole.point)
    read = torch.unique(some.speaker, return_inverse=True)[1]
    assert len(some.base) == int(read.max()) + 1 < 0.8 * count
    spoken = torch.searchsorted(some.speaker, torch.arange(len(some.base)))
    pillar = features.frames.pillar[some.point]
    assert torch.equal(pillar[spoken][some.speaker], pillar)
    for name in ("foreground", "dynamic", "offset"):
        mine, told = getattr(some, name), getattr(whole, name)
        torch.testing.assert_close(mine[spoken], told[spoken], atol=1e-5, rtol=1e-4)
    assert torch.equal(some.dynamic, some.dynamic[spoken][some.speaker])
    centre = some.position[:, :2] + some.offset
    torch.testing.assert_close(centre, centre[spoken][some.speaker], atol=1e-5, rtol=1e-4)
    chosen = torch.arange(count) % 5 == 0
    told = whole.features_of(torch.isin(torch.arange(count), spoken))
    torch.testing.assert_close(
        some.features_of(chosen), told[some.speaker[chosen]], atol=1e-5, rtol=1e-4
    )
    ids = torch.where(some.position[:, 0] > 0, 7, 0)
    assert network.track(some, ids).ids.tolist() == [7]


def test_what_is_seen_alike_three_times_stands_still(network: Network, frames: list[Frame]) -> None:
    same = [replace(frames[0], stamp=0.1 * time) for time in range(3)]
    features = encode(network, same, 16.0)
    seen = network.perceive(features, still(3), Windows.single(3))
    ids = torch.where(seen.position[:, 0] > 0, 7, 0)
    objects = network.track(seen, ids)
    assert objects.ids.tolist() == [7]
    torch.testing.assert_close(
        objects.target_from_aligned, still(3)[None].contiguous(), atol=0.05, rtol=0
    )


def test_an_object_unseen_in_the_target_is_anchored_to_the_nearest_frame(
    network: Network, frames: list[Frame]
) -> None:
    features = encode(network, frames[:4], 16.0)
    seen = network.perceive(features, still(4), Windows.single(4))
    objects = network.track(seen, torch.where(seen.frame >= 2, 3, 0))
    assert objects.tubes.anchor_time.tolist() == [2]
    assert torch.equal(objects.target_from_aligned[0, 2], torch.eye(4))


def test_what_stands_is_matched_the_rather_the_higher_its_odds(
    network: Network, frames: list[Frame]
) -> None:
    shares = []
    for odds in (0.05, 1.0, 16.0):
        chosen = build_network(replace(network.settings, standing_odds=odds, ego_pillars=64), 3)
        ego = encode(chosen, frames[:2]).ego
        assert ego.valid.all()
        shares.append(float((ego.position[..., 2] > 0.3).float().mean()))
    assert shares[0] < shares[1] < shares[2]


def test_where_nobody_is_named_there_are_no_objects(network: Network, frames: list[Frame]) -> None:
    features = encode(network, frames[:3], 16.0)
    with torch.no_grad():
        seen = network.perceive(features, still(3), Windows.single(3))
        objects = network.track(seen, torch.zeros_like(seen.point))
    assert len(objects.ids) == len(objects.target_from_aligned) == 0
