"""What an oracle in the network's place scores, and what known mistakes cost."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest
import torch

from lidaraccum.model.answers import FrameFeatures, ObjectMotions, Perception
from lidaraccum.model.batch import FrameTensors, to_arrays
from lidaraccum.model.kabsch import chain, invert, move
from lidaraccum.model.looking import close_pillars, points_of
from lidaraccum.model.motion import Windows
from lidaraccum.model.tubes import gather_tubes
from lidaraccum.training.alone import cluster_by_offsets
from lidaraccum.training.end_to_end import goal_of
from lidaraccum.training.objective import object_poses, offset_truth, source_index, true_motion
from lidaraccum.training.scores import Scores, score_network
from lidaraccum.training.window import Batch, make_batch

SHARES = (
    "foreground_iou", "foreground_precision", "foreground_recall", "motion_iou",
    "motion_precision", "motion_recall", "alone_motion_iou", "alone_motion_precision",
    "alone_motion_recall",    "static_acc_strict", "dynamic_acc_strict", "dynamic_acc_relaxed",
)  # fmt: skip
ERRORS = (
    "ego_epe_m", "ego_epe_median_m", "offset_m", "object_epe_m", "static_epe_m", "still_epe_m",
    "dynamic_epe_m", "dynamic_robust_outlier",
)  # fmt: skip


@dataclass
class Oracle:
    """Answers the four verbs from the truth of one window, with mistakes made on purpose.

    Attributes:
        batch: The window.
        shift_m: The poses are off by so much along x.
        sees_motion: Whether anything is said to move.
        tracks: Whether objects are said to go anywhere.
    """

    batch: Batch
    shift_m: float = 0.0
    sees_motion: bool = True
    tracks: bool = True
    training: bool = False

    def eval(self) -> None:
        pass

    def train(self, mode: bool) -> None:
        assert mode == self.training

    def encode(self, frames: FrameTensors) -> FrameFeatures:
        held = torch.zeros(sum(frames.pillar_counts))
        held = held.scatter_reduce(0, frames.pillar, self.batch.truth.foreground.float(), "amax")
        base = torch.zeros(len(frames), 1, 4, 4)
        return FrameFeatures(frames, base, 10.0 * (2.0 * held - 1.0), SimpleNamespace())

    def match_windows(self, features: FrameFeatures, windows: Windows) -> SimpleNamespace:
        poses = self.batch.truth.target_from_frame[source_index(self.batch)].clone()
        poses[:, 0, 3] += self.shift_m
        return SimpleNamespace(target_from_source=poses)

    def perceive(
        self, features: FrameFeatures, poses: torch.Tensor, windows: Windows, *, most: int = 0
    ) -> Perception:
        view = self.view(features, poses, windows)
        return self.look(view, self.choose(view, features))

    def view(
        self, features: FrameFeatures, poses: torch.Tensor, windows: Windows
    ) -> SimpleNamespace:
        return SimpleNamespace(frames=features.frames, poses=poses, windows=windows)

    def choose(self, view: SimpleNamespace, features: FrameFeatures) -> torch.Tensor:
        return points_of(features.frames, close_pillars(features.foreground))

    def look(self, view: SimpleNamespace, points: torch.Tensor) -> Perception:
        frames, poses, windows, truth = view.frames, view.poses, view.windows, self.batch.truth
        frame = frames.point_frame[points]
        target = windows.target[0]
        level = chain(frames.level_from_sensor[target], poses, invert(frames.level_from_sensor))
        position = move(level[frame], frames.points[points][:, None])[:, 0]
        sign = 10.0 * (2.0 * torch.stack([truth.foreground, truth.dynamic]).float() - 1.0)
        nothing = torch.zeros(len(points), 1)
        seen = Perception(
            windows, points, frame, position, sign[0][points],
            sign[1][points] if self.sees_motion else torch.full((len(points),), -10.0),
            torch.zeros(len(points), 2), torch.tensor(windows.gaps(frames.stamps)).float()[frame],
            torch.arange(len(points)), nothing, nothing,
        )  # fmt: skip
        aligned = object_poses(self.batch, poses)
        offset, _ = offset_truth(seen, truth, aligned)
        object.__setattr__(seen, "offset", offset)
        return seen

    def track(self, seen: Perception, instance: torch.Tensor) -> ObjectMotions:
        chosen = torch.nonzero(instance > 0)[:, 0]
        ids, row = torch.unique(instance[chosen], return_inverse=True)
        window = torch.zeros_like(ids)
        target = torch.full_like(ids, seen.windows.target[0])
        frame = seen.frame[chosen]
        tubes = gather_tubes(
            seen.position[chosen], row, frame, seen.seconds[chosen], target, len(ids)
        )
        true_row = self.batch.truth.object_row[seen.point[chosen]]
        owner = torch.stack([true_row[row == k].mode().values for k in range(len(ids))])
        aligned = object_poses(self.batch, self.batch.truth.target_from_frame)[owner]
        motion = true_motion(aligned, tubes.anchor_time)[:, : tubes.counts.shape[1]]
        if not self.tracks:
            motion = torch.eye(4).expand_as(motion)
        return ObjectMotions(ids, window, row, frame, tubes, None, motion)


@pytest.fixture(scope="module")
def batches(toy: ModuleType) -> list[Batch]:
    # In the fourth drive's first window a car drives where the sensor is.
    windows = toy.CarParks().windows(0) + toy.CarParks().windows(3)[1:]
    return [make_batch([window]) for window in windows]


def scored(batches: list[Batch], **mistakes: float) -> list[Scores]:
    return [score_network(Oracle(batch, **mistakes), [batch]) for batch in batches]


def test_an_oracle_makes_no_mistake(batches: list[Batch]) -> None:
    for scores in scored(batches):
        values = asdict(scores)
        assert [name for name in SHARES if values[name] != pytest.approx(1.0)] == []
        assert [name for name in ERRORS if values[name] > 1e-4] == []
        assert scores.object_still_m > 0.05
        assert scores.coverage > 0.98
        assert scores.moving_coverage > 0.98


def test_a_wrong_pose_costs_static_points_its_length(batches: list[Batch]) -> None:
    for scores in scored(batches, shift_m=0.12):
        assert scores.ego_epe_m == pytest.approx(0.12, abs=1e-4)
        assert scores.static_epe_m == pytest.approx(0.12, abs=1e-4)
        assert scores.motion_iou == 1.0
        assert scores.alone_motion_recall == 1.0


@pytest.mark.parametrize("mistake", ["sees_motion", "tracks"])
def test_who_lets_movers_stand_is_off_by_their_way(batches: list[Batch], mistake: str) -> None:
    for batch, scores in zip(batches, scored(batches, **{mistake: False}), strict=True):
        goal, truth = goal_of(batch), batch.truth
        owner = batch.frames.point_frame
        stood = [
            move(
                truth.target_from_frame[frame], torch.from_numpy(goal.start).float()[owner == frame]
            )
            for frame in range(len(batch.frames))
        ]
        way = np.linalg.norm(to_arrays(torch.cat(stood)) - goal.placed, axis=1)
        inside = (np.abs(goal.placed[:, :2]) < batch.frames.half_extent_m).all(axis=1)
        rows = goal.known & inside & truth.dynamic.numpy()
        rows &= owner.numpy() != batch.windows.target[0]
        assert scores.dynamic_epe_m == pytest.approx(way[rows].mean(), abs=1e-3)
        assert scores.dynamic_epe_m > 0.05
        assert scores.static_epe_m < 1e-4


def test_what_is_told_to_go_nowhere_does_not_move_whatever_else_is_said(
    batches: list[Batch],
) -> None:
    for scores in scored(batches, tracks=False):
        assert scores.motion_recall == pytest.approx(1.0)
        assert scores.alone_motion_recall == 0.0


def test_movers_belong_into_their_boxes_of_the_target_frame(batches: list[Batch]) -> None:
    for batch in batches:
        goal, frames = goal_of(batch), batch.frames
        target = batch.windows.target[0]
        rows = torch.from_numpy(goal.known) & batch.truth.dynamic
        level = move(frames.level_from_sensor[target], torch.from_numpy(goal.placed).float()[rows])
        boxes = batch.truth.level_from_object[batch.truth.object_row[rows], target]
        inside = move(invert(boxes), level[:, None])[:, 0]
        assert float(inside[:, 0].abs().max()) < 2.15
        assert float(inside[:, 1].abs().max()) < 0.95


def test_nothing_to_score_is_nan_not_perfect(toy: ModuleType) -> None:
    scores = score_network(Oracle(make_batch(toy.CarParks().windows(0)[:1])), [])
    assert scores.windows == 0
    values = asdict(scores)
    assert all(np.isnan(values[name]) for name in (*SHARES, *ERRORS, "coverage"))


def test_offsets_gather_what_they_point_to_and_order_does_not_matter() -> None:
    rng = np.random.default_rng(2)
    lattice = np.stack(np.meshgrid(*[np.arange(10)] * 3), axis=-1).reshape(-1, 3)[:900]
    positions = 0.3 * lattice + 0.1  # three interleaved objects, no two points in one voxel
    centres = np.array([[-6.0, 0], [0, 5], [6, 1]])[np.arange(900) % 3]
    found = cluster_by_offsets(positions, centres - positions[:, :2])
    assert [len(set(found[number::3].tolist())) for number in range(3)] == [1, 1, 1]
    assert set(found.tolist()) == {1, 2, 3}
    order = rng.permutation(900)
    again = cluster_by_offsets(positions[order], (centres - positions[:, :2])[order])
    same = found[order][:, None] == found[order][None, :50]
    assert ((again[:, None] == again[None, :50]) == same).all()
    assert cluster_by_offsets(np.zeros((0, 3)), np.zeros((0, 2))).shape == (0,)
