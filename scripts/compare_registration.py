"""Compare our odometry with small_gicp, Open3D's ICP and kiss-icp on one recording.

    python scripts/compare_registration.py DIRECTORY [--frames 0:106] [--methods ours,kiss-icp]

All methods take each frame in turn, so a busy machine slows all of them alike. kiss-icp is not a
dependency: `pip install kiss-icp` first, or leave it out of --methods.

Residual: of every sixth fixed point within 40 m of a later frame, moved by the relative pose, the
distance to the plane through the 20 nearest points of an earlier frame; points whose nearest
neighbour is over 0.5 m away do not count; the median, then the median over the pairs of frames.
Points that the labels give to an object are left out.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
import small_gicp
from numpy.typing import NDArray

from lidaraccum.data.frame import Frame
from lidaraccum.geometry import rigid
from lidaraccum.io.sequences import FileSequence, InputSettings, open_sequence
from lidaraccum.registration.odometry import register

THREADS = 2
VOXEL_M, GATE_M = 0.25, 1.5
NEIGHBOURS, NEAR_M, MAX_RANGE_M, SHARE = 20, 0.5, 40.0, 6
GAPS = (1, 9)


class Method(Protocol):
    """Something that takes frames one by one and in the end has poses and points."""

    def take(self, frame: Frame) -> None:
        """Take the next frame."""

    def finish(self) -> tuple[NDArray[np.float64], list[NDArray[np.float32]]]:
        """Poses (T, 4, 4), world_from_sensor, and the points (N, 3) they belong to."""


def usable(frame: Frame) -> NDArray[np.float64]:
    """Points (M, 3) between 2.5 and 100 m, which is what our settings use too."""
    distance = np.linalg.norm(frame.points, axis=1)
    return frame.points[(distance > 2.5) & (distance < 100.0)].astype(np.float64)


@dataclass
class Ours:
    """`register`, fed frame by frame."""

    queue: list[Frame] = field(default_factory=list)
    poses: list[rigid.Pose] = field(default_factory=list)
    points: list[NDArray[np.float32]] = field(default_factory=list)
    stream: Iterator[Any] | None = None

    def take(self, frame: Frame) -> None:
        """Take the next frame."""
        self.queue.append(frame)
        if len(self.queue) >= 5:
            self._advance()

    def _advance(self) -> None:
        if self.stream is None:
            self.stream = register(iter(self._frames()))
        registered = next(self.stream)
        self.poses.append(registered.world_from_sensor)
        self.points.append(registered.frame.points)

    def _frames(self) -> Iterator[Frame]:
        position = 0
        while position < len(self.queue):
            yield self.queue[position]
            position += 1

    def finish(self) -> tuple[NDArray[np.float64], list[NDArray[np.float32]]]:
        """Poses (T, 4, 4), world_from_sensor, and the points (N, 3) they belong to."""
        while len(self.poses) < len(self.queue):
            self._advance()
        return np.stack(self.poses), self.points


@dataclass
class Chained:
    """Frame on frame (or on a voxel map), started from constant velocity, as most scripts do."""

    poses: list[rigid.Pose] = field(default_factory=list)
    points: list[NDArray[np.float32]] = field(default_factory=list)
    step: rigid.Pose = field(default_factory=lambda: np.eye(4))
    before: Any = None

    def take(self, frame: Frame) -> None:
        """Take the next frame."""
        self.points.append(frame.points)
        current = self.prepare(frame)
        if self.before is None:
            self.poses.append(np.eye(4))
        else:
            # Through the logarithm, so that rounding cannot grow from step to step.
            self.step = rigid.exponential(rigid.logarithm(self.align(current)))
            self.poses.append(self.poses[-1] @ self.step)
        self.remember(current)

    def prepare(self, frame: Frame) -> Any:
        """What of a frame is aligned."""
        return small_gicp.preprocess_points(usable(frame), VOXEL_M, num_threads=THREADS)

    def align(self, current: Any) -> rigid.Pose:
        """The step from the frame before to this one."""
        (target, tree), (source, _) = self.before, current
        return small_gicp.align(
            target,
            source,
            tree,
            init_T_target_source=self.step,
            registration_type="GICP",
            max_correspondence_distance=GATE_M,
            num_threads=THREADS,
        ).T_target_source

    def remember(self, current: Any) -> None:
        """Keep what the next frame is aligned with."""
        self.before = current

    def finish(self) -> tuple[NDArray[np.float64], list[NDArray[np.float32]]]:
        """Poses (T, 4, 4), world_from_sensor, and the points (N, 3) they belong to."""
        return np.stack(self.poses), self.points


@dataclass
class VoxelMapped(Chained):
    """small_gicp's VGICP against its own sliding voxel map."""

    def align(self, current: Any) -> rigid.Pose:
        """The step from the frame before to this one."""
        world = small_gicp.align(
            self.before,
            current[0],
            init_T_target_source=self.poses[-1] @ self.step,
            max_correspondence_distance=GATE_M,
            num_threads=THREADS,
        ).T_target_source
        return rigid.invert(self.poses[-1]) @ world

    def remember(self, current: Any) -> None:
        """Keep what the next frame is aligned with."""
        if self.before is None:
            self.before = small_gicp.GaussianVoxelMap(1.0)
            self.before.set_lru(horizon=100, clear_cycle=10)
        self.before.insert(current[0], self.poses[-1])


@dataclass
class Open3D(Chained):
    """Open3D's legacy point-to-plane ICP with a robust kernel."""

    def prepare(self, frame: Frame) -> Any:
        """What of a frame is aligned."""
        import open3d

        cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(usable(frame)))
        cloud = cloud.voxel_down_sample(VOXEL_M)
        cloud.estimate_normals(open3d.geometry.KDTreeSearchParamKNN(NEIGHBOURS))
        return cloud

    def align(self, current: Any) -> rigid.Pose:
        """The step from the frame before to this one."""
        import open3d

        icp = open3d.pipelines.registration
        estimation = icp.TransformationEstimationPointToPlane(icp.TukeyLoss(k=0.3))
        return icp.registration_icp(
            current, self.before, GATE_M, self.step, estimation
        ).transformation


@dataclass
class Kiss:
    """kiss-icp as its pipeline runs it on frames without times: no deskew."""

    poses: list[rigid.Pose] = field(default_factory=list)
    points: list[NDArray[np.float32]] = field(default_factory=list)
    odometry: Any = None

    def take(self, frame: Frame) -> None:
        """Take the next frame."""
        if self.odometry is None:
            from kiss_icp.config import KISSConfig
            from kiss_icp.kiss_icp import KissICP

            config = KISSConfig()
            config.data.max_range, config.data.min_range = 100.0, 2.5
            config.data.deskew, config.mapping.voxel_size = False, 1.0
            config.registration.max_num_threads = THREADS
            self.odometry = KissICP(config)
        self.odometry.register_frame(frame.points.astype(np.float64), np.zeros(0))
        self.poses.append(self.odometry.last_pose.copy())
        self.points.append(frame.points)

    def finish(self) -> tuple[NDArray[np.float64], list[NDArray[np.float32]]]:
        """Poses (T, 4, 4), world_from_sensor, and the points (N, 3) they belong to."""
        return np.stack(self.poses), self.points


METHODS: dict[str, type] = {
    "ours": Ours,
    "small_gicp GICP": Chained,
    "small_gicp VGICP": VoxelMapped,
    "Open3D ICP": Open3D,
    "kiss-icp": Kiss,
}


def fixed(sequence: FileSequence, index: int) -> NDArray[np.bool_]:
    """Points (N,) of a frame that no label gives to an object."""
    try:
        return sequence.labels(index).instance == 0
    except (OSError, ValueError):
        return np.ones(len(sequence[index]), dtype=np.bool_)


def residual(
    earlier: NDArray[np.float32], later: NDArray[np.float32], earlier_from_later: rigid.Pose
) -> float:
    """Median distance of later points to the planes of earlier ones, metres."""
    distance = np.linalg.norm(later, axis=1)
    chosen = later[(distance > 2.5) & (distance < MAX_RANGE_M)][::SHARE]
    target = earlier[np.linalg.norm(earlier, axis=1) > 2.5].astype(np.float64)
    moved = rigid.transform(earlier_from_later, chosen)
    tree = small_gicp.KdTree(target, num_threads=THREADS)
    rows, squared = tree.batch_knn_search(moved, NEIGHBOURS, num_threads=THREADS)
    near = np.asarray(squared)[:, 0] < NEAR_M**2
    around = target[np.asarray(rows)[near].astype(np.int64)]
    centre = around.mean(axis=1)
    spread = np.einsum("nki,nkj->nij", around - centre[:, None], around - centre[:, None])
    normal = np.linalg.eigh(spread)[1][:, :, 0]
    return float(np.median(np.abs(np.einsum("ni,ni->n", moved[near] - centre, normal))))


def step_errors(poses: NDArray[np.float64], truth: NDArray[np.float64]) -> NDArray[np.float64]:
    """(T - 1,) metres between the found and the true step of each frame."""
    found = rigid.invert(poses[:-1]) @ poses[1:]
    true = rigid.invert(truth[:-1]) @ truth[1:]
    return np.linalg.norm((found - true)[:, :3, 3], axis=1)


def at_even_times(truth: NDArray[np.float64], stamps: NDArray[np.float64]) -> NDArray[np.float64]:
    """The true track at evenly spaced times: a scanner turns evenly, whatever rounds the stamps."""
    index = np.arange(len(stamps))
    even = np.polyval(np.polyfit(index, stamps, 1), index)
    moved = truth.copy()
    for axis in range(3):
        moved[:, axis, 3] = np.interp(even, stamps, truth[:, axis, 3])
    return moved


@dataclass(frozen=True, eq=False)
class Reference:
    """The true track, the same at even times, and the fixed points of every frame."""

    truth: NDArray[np.float64]
    even: NDArray[np.float64]
    masks: list[NDArray[np.bool_]]


def reference_of(sequence: FileSequence, stamps: list[float]) -> Reference:
    """The truth about a labelled sequence."""
    truth = np.stack([sequence.labels(i).world_from_sensor for i in range(len(sequence))])
    truth = rigid.invert(truth[0]) @ truth
    masks = [fixed(sequence, index) for index in range(len(sequence))]
    return Reference(truth, at_even_times(truth, np.array(stamps)), masks)


def residuals(
    poses: NDArray[np.float64], points: list[NDArray[np.float32]], masks: list[NDArray[np.bool_]]
) -> str:
    """Centimetres one and nine frames apart."""
    medians = []
    for gap in GAPS:
        starts = range(min(10, len(points) // 3), len(points) - gap, 8)
        values = [
            residual(
                points[i][masks[i]],
                points[i + gap][masks[i + gap]],
                rigid.invert(poses[i]) @ poses[i + gap],
            )
            for i in starts
        ]
        medians.append(f"{100 * float(np.median(values)):.2f}" if values else "-")
    return " / ".join(medians)


def row(name: str, method: Method, reference: Reference, ms: float) -> str:
    """One line of the table."""
    poses, points = method.finish()
    error = step_errors(poses, reference.truth)
    # The first and last even times lie outside the track and cannot be interpolated.
    even_error = step_errors(poses, reference.even)[1:-1]
    end = np.linalg.norm((poses[-1] - reference.truth[-1])[:3, 3])
    return (
        f"| {name} | {np.linalg.norm(poses[1][:3, 3]):.2f} "
        f"| {np.median(error):.3f} / {error.max():.3f} "
        f"| {np.median(even_error):.3f} / {even_error.max():.3f} | {end:.2f} "
        f"| {residuals(poses, points, reference.masks)} | {ms:.0f} |"
    )


HEADER = (
    "| method | first step m | step error median / max m | at even times | end m "
    "| residual 1 / 9 frames cm | ms a frame |\n|---|---|---|---|---|---|---|\n"
)


def main() -> None:
    """Run every method over the frames and write the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("directory")
    parser.add_argument("--frames", default="")
    parser.add_argument("--methods", default=",".join(METHODS))
    arguments = parser.parse_args()
    sequence = open_sequence(arguments.directory, InputSettings(frames=arguments.frames))
    methods: dict[str, Method] = {name: METHODS[name]() for name in arguments.methods.split(",")}
    seconds, stamps = dict.fromkeys(methods, 0.0), []
    for index in range(len(sequence)):
        frame = sequence[index]
        stamps.append(frame.stamp)
        for name, method in methods.items():
            start = time.perf_counter()
            method.take(frame)
            seconds[name] += time.perf_counter() - start
    reference = reference_of(sequence, stamps)
    sys.stdout.write(HEADER)
    for name, method in methods.items():
        # The frames that ours holds back at the start are a fixed number: do them on the clock.
        start = time.perf_counter()
        method.finish()
        seconds[name] += time.perf_counter() - start
        line = row(name, method, reference, 1000 * seconds[name] / len(stamps))
        sys.stdout.write(line + "\n")
    clock = float(np.median(step_errors(reference.even, reference.truth)))
    first = float(np.linalg.norm(reference.truth[1][:3, 3]))
    sys.stdout.write(f"\ntruth: first step {first:.2f} m; its stamps alone: {clock:.3f} m\n")


if __name__ == "__main__":
    main()
