"""Registered frames whose points are known for what they are: background, still, moving."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from lidaraccum.data.registered import RegisteredFrame
from lidaraccum.errors import InputError
from lidaraccum.geometry import rigid


@dataclass(frozen=True, eq=False)
class PerceivedFrame:
    """A registered frame with a class, an object and a confidence for each point.

    Attributes:
        registered: The frame and its pose.
        label: (N,) uint8: `accumulation.BACKGROUND`, `STILL` or `MOVING`.
        instance: (N,) int32, 0 for none, one id through the whole sequence.
        confidence: (N,) float32, 0..1, of the label; 0 where nobody looked.
        world_from_object: Pose (4, 4) in this frame of each instance that moves, in any
            coordinates fixed to the object; instances not named here stand still.
        poses_at_stamp: Whether these poses are those at the frame's stamp. Otherwise they belong
            to the points as they lie, which a sweep passed some time before or after it.
    """

    registered: RegisteredFrame
    label: NDArray[np.uint8]
    instance: NDArray[np.int32]
    confidence: NDArray[np.float32]
    world_from_object: Mapping[int, rigid.Pose] = field(default_factory=dict)
    poses_at_stamp: bool = False

    def __post_init__(self) -> None:
        count = len(self.registered.frame)
        for name in ("label", "instance", "confidence"):
            if getattr(self, name).shape != (count,):
                raise InputError(f"{name} must be ({count},), not {getattr(self, name).shape}")
