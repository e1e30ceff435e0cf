"""The seam between what sees movers and what puts points together."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from typing import Protocol

import numpy as np

from lidaraccum.data.accumulation import BACKGROUND, MOVING, STILL
from lidaraccum.data.perceived import PerceivedFrame
from lidaraccum.data.registered import RegisteredFrame
from lidaraccum.data.sequence import LabelledSequence
from lidaraccum.errors import InputError


class Perceiver(Protocol):
    """Says of each point what it is on and of each mover where it is."""

    def perceive(self, frames: Iterable[RegisteredFrame]) -> Iterator[PerceivedFrame]:
        """Each frame once, in order; may look ahead a bounded number of frames."""


class AllStatic:
    """Takes every point for background: ego-motion alone, the ghosts stay."""

    def perceive(self, frames: Iterable[RegisteredFrame]) -> Iterator[PerceivedFrame]:
        """Each frame with label background and confidence 0: nobody looked."""
        for registered in frames:
            count = len(registered.frame)
            yield PerceivedFrame(
                registered=registered,
                label=np.full(count, BACKGROUND, dtype=np.uint8),
                instance=np.zeros(count, dtype=np.int32),
                confidence=np.zeros(count, dtype=np.float32),
            )


class GivenLabels:
    """Believes the labels and boxes that came with the sequence; poses stay the pipeline's own.

    Args:
        sequence: Whose labels.
        movers: Instances that follow their boxes in every frame; any other follows its box in the
            frames whose labels call it dynamic.
    """

    def __init__(self, sequence: LabelledSequence, movers: Collection[int] = ()) -> None:
        self._sequence = sequence
        self._movers = frozenset(movers)

    def perceive(self, frames: Iterable[RegisteredFrame]) -> Iterator[PerceivedFrame]:
        """Each frame with its given labels, confidence 1 where it is annotated.

        Raises:
            InputError: Labels and points of a frame differ in number.
        """
        for registered in frames:
            yield self._label(registered)

    def _label(self, registered: RegisteredFrame) -> PerceivedFrame:
        labels = self._sequence.labels(registered.index)
        count = len(registered.frame)
        if len(labels.foreground) != count:
            raise InputError(
                f"frame {registered.frame.name} has {count} points but "
                f"{len(labels.foreground)} labels"
            )
        boxed = {box.id for box in labels.boxes}
        # A mover without a box has no motion to undo: it stays where the sensor saw it.
        moving = (set(np.unique(labels.instance[labels.dynamic]).tolist()) | self._movers) & boxed
        annotated = np.ones(count, bool) if labels.annotated is None else labels.annotated
        return PerceivedFrame(
            registered=registered,
            label=np.select(
                [labels.dynamic, labels.foreground], [MOVING, STILL], BACKGROUND
            ).astype(np.uint8),
            instance=labels.instance.astype(np.int32),
            confidence=annotated.astype(np.float32),
            world_from_object={
                box.id: registered.world_from_sensor @ box.sensor_from_object
                for box in labels.boxes
                if box.id in moving
            },
            # Boxes beside points as recorded were drawn around them.
            poses_at_stamp=labels.points_at_stamp is not None,
        )
