"""The network as the pipeline sees it: frames and arrays in, arrays out, torch behind the door."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from lidaraccum.data.frame import Frame
from lidaraccum.errors import InputError
from lidaraccum.geometry import rigid
from lidaraccum.model.answers import FrameFeatures, Perception
from lidaraccum.model.batch import prepare, to_arrays, to_indices, to_tensors
from lidaraccum.model.bytes import in_bytes
from lidaraccum.model.checkpoint import load_network
from lidaraccum.model.motion import Windows
from lidaraccum.model.network import MOST_POINTS, Network
from lidaraccum.model.precision import inference
from lidaraccum.model.reading import FrameReading, ObjectReading, WindowReading
from lidaraccum.model.weights import weights_hash

FEWEST_POINTS = 50
"""A frame with fewer points on the grid has nothing to say."""


@dataclass(frozen=True, eq=False)
class EncodedFrame:
    """A frame as the network keeps it, encoded once.

    Attributes:
        row_count: N, points of the frame.
        features: What it says of the frame by itself; None where there are too few points.
    """

    row_count: int
    features: FrameFeatures | None


@dataclass(frozen=True, eq=False)
class _Kept:
    """What following objects through a window takes."""

    perception: Perception
    features: FrameFeatures
    places: tuple[int, ...]


class NetworkReader:
    """A network that reads frames one by one and windows of them together.

    It works in one thread: where cores are busy, and a machine that has many drives to do keeps
    them so, two threads wait for each other and take three to eight times as long as one.

    Args:
        network: Whose answers; it is put into evaluation mode.
        weights: SHA-256 of its weights' file, for reports.
    """

    def __init__(self, network: Network, weights: str = "") -> None:
        self._network = network.eval().requires_grad_(False)
        self._weights = weights

    @classmethod
    def open(cls, path: Path) -> NetworkReader:
        """Load a checkpoint.

        Raises:
            MissingInputError: There is no such file.
            InputError: It holds no weights of this network.
        """
        return cls(in_bytes(load_network(path)), weights_hash(path))

    @property
    def weights(self) -> str:
        """SHA-256 of the weights' file."""
        return self._weights

    def read(self, frame: Frame) -> EncodedFrame:
        """Encode a frame (points in sensor coordinates, motion within the sweep undone), once."""
        try:
            prepared = prepare(frame, self._network.settings)
        except InputError:  # no point that returned, or none near enough
            return EncodedFrame(len(frame), None)
        if len(prepared.points) < FEWEST_POINTS:
            return EncodedFrame(len(frame), None)
        with _answering():
            features = self._network.encode(to_tensors([prepared]), matchable=False)
            return EncodedFrame(len(frame), features)

    def look(
        self,
        encoded: Sequence[EncodedFrame],
        world_from_sensor: NDArray[np.float64],
        target: int,
    ) -> WindowReading:
        """What the T frames of a window say together.

        Args:
            encoded: From `read`, in order of time.
            world_from_sensor: (T, 4, 4) their poses.
            target: Place of the frame that offsets point into; where it has nothing to say, the
                frame nearest to it that has.
        """
        readings = [FrameReading.background(one.row_count) for one in encoded]
        places = [place for place, one in enumerate(encoded) if one.features is not None]
        if len(places) < 2:
            return WindowReading(tuple(readings), target)
        target = min(places, key=lambda place: abs(place - target))
        features = FrameFeatures.stack([one.features for one in encoded if one.features])
        poses = rigid.invert(world_from_sensor[target]) @ world_from_sensor[places]
        with _answering():
            seen = self._network.perceive(
                features,
                torch.from_numpy(poses.astype(np.float32)),
                Windows.single(len(places), places.index(target)),
                most=MOST_POINTS,
            )
        sensor_from_level = _sensor_from_level(features, places.index(target))
        offset = to_arrays(seen.offset)
        level = np.column_stack([offset, np.zeros(len(offset))])
        turn = world_from_sensor[target, :3, :3] @ sensor_from_level[:3, :3]
        said = np.column_stack(
            [
                to_arrays(torch.sigmoid(seen.foreground)),
                to_arrays(torch.sigmoid(seen.dynamic)),
                np.einsum("ij,nj->ni", turn, level)[:, :2],
            ]
        ).astype(np.float32)
        frame, rows = to_indices(seen.frame), to_indices(features.frames.rows[seen.point])
        for order, place in enumerate(places):
            readings[place] = _reading(encoded[place].row_count, frame == order, rows, said)
        return WindowReading(tuple(readings), target, _Kept(seen, features, tuple(places)))

    def track(
        self, reading: WindowReading, instances: Sequence[NDArray[np.int64]]
    ) -> ObjectReading:
        """Motions of objects whose points the caller names.

        Args:
            reading: From `look`.
            instances: For each of the T frames the object (N_t,) of each point, 0 for none. Only
                points that the network looked at speak for their object.
        """
        kept: _Kept | None = reading.kept
        none = np.zeros(0, dtype=np.int64)
        span = len(reading.frames)
        if kept is None:
            return ObjectReading(none, none, np.zeros((0, span), bool), np.zeros((0, span, 4, 4)))
        seen, places = kept.perception, list(kept.places)
        frame, rows = to_indices(seen.frame), to_indices(kept.features.frames.rows[seen.point])
        ids = np.zeros(len(rows), dtype=np.int64)
        for order, place in enumerate(places):
            own = frame == order
            ids[own] = instances[place][rows[own]]
        if not ids.any():
            return self.track(replace(reading, kept=None), instances)
        with _answering():
            objects = self._network.track(seen, torch.from_numpy(ids))
        sensor_from_level = _sensor_from_level(kept.features, places.index(reading.target))
        motions = sensor_from_level @ to_arrays(objects.target_from_aligned)
        motions = motions @ rigid.invert(sensor_from_level)
        counts = to_indices(objects.tubes.counts)
        shown = places[: counts.shape[1]]
        target_from_aligned = np.tile(np.eye(4), (len(counts), span, 1, 1))
        target_from_aligned[:, shown] = motions
        visible = np.zeros((len(counts), span), dtype=np.bool_)
        visible[:, shown] = counts > 0
        anchor = np.array(places)[to_indices(objects.tubes.anchor_time)]
        return ObjectReading(to_indices(objects.ids), anchor, visible, target_from_aligned)


@contextmanager
def _answering() -> Iterator[None]:
    """No gradients, the fastest arithmetic, one thread; the caller's threads are given back."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        with torch.inference_mode(), inference():
            yield
    finally:
        torch.set_num_threads(threads)


def _sensor_from_level(features: FrameFeatures, order: int) -> rigid.Pose:
    return rigid.invert(to_arrays(features.frames.level_from_sensor[order]))


def _reading(
    count: int,
    own: NDArray[np.bool_],
    rows: NDArray[np.int64],
    said: NDArray[np.float32],
) -> FrameReading:
    whole = np.zeros((count, 4), dtype=np.float32)
    whole[rows[own]] = said[own]
    return FrameReading(whole[:, 0].copy(), whole[:, 1].copy(), whole[:, 2:].copy())
