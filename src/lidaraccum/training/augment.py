"""Other drives out of one: turned, mirrored, run backwards, thinned; the truth goes along."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lidaraccum.data.frame import Frame, Labels
from lidaraccum.errors import SettingsError
from lidaraccum.geometry import rigid


@dataclass(frozen=True)
class AugmentSettings:
    """How far windows are changed; all 0 leaves them as they are.

    Attributes:
        yaw_deg: Turned about z by up to this, either way.
        quarter_turns: Chance of one, two or three quarter turns more: walls stay along the grid, as
            they mostly lie when a sensor looks ahead, aside or back.
        flip: Chance of a mirror image.
        reverse: Chance of running backwards.
        height_m: Shifted in z by up to this, either way.
        tilt_deg: Tilted about x and y by up to this, either way.
        jitter_m: One sigma of noise on every coordinate.
        rings: Chance that every other ring is missing.
        rays: Up to this share of the points is missing.
        ground_m: One sigma of the error of the ground that points' heights are told above; see
            `ground_error`.
        most_points: Frames with more are thinned to as many; 0 leaves them. Not an augmentation
            so much as a bound on what dense sensors cost.
    """

    yaw_deg: float = 180.0
    quarter_turns: float = 0.0
    flip: float = 0.5
    reverse: float = 0.3
    height_m: float = 0.75
    tilt_deg: float = 1.5
    jitter_m: float = 0.005
    rings: float = 0.15
    rays: float = 0.3
    ground_m: float = 0.1
    most_points: int = 80_000

    def __post_init__(self) -> None:
        for name in ("quarter_turns", "flip", "reverse", "rings", "rays"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise SettingsError(f"{name} is a share of 0 to 1, not {getattr(self, name)}")


NO_AUGMENTATION = AugmentSettings(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0)
"""Windows as they are: for validation."""

LabelledFrame = tuple[Frame, Labels]


def augment(
    window: Sequence[LabelledFrame], settings: AugmentSettings, rng: np.random.Generator
) -> list[LabelledFrame]:
    """Change all frames of a window alike, labels, poses and boxes included.

    Args:
        window: Frames in order of time with their labels.
        settings: How far.
        rng: Decides; the same generator state gives the same window.
    """
    changed_from_sensor = _draw_motion(settings, rng)
    mirror = np.diag([1.0, -1.0 if rng.random() < settings.flip else 1.0, 1.0, 1.0])
    backwards = rng.random() < settings.reverse
    every_other = rng.random() < settings.rings
    phase = int(rng.integers(2))
    lost = rng.uniform(0.0, settings.rays)
    changed = []
    for frame, labels in window:
        share = max(lost, 1.0 - settings.most_points / len(frame)) if settings.most_points else lost
        keep = frame.returned & (rng.random(len(frame)) >= share)
        if every_other and frame.ring is not None:
            keep &= frame.ring % 2 == phase
        thin_frame, thin_labels = _thin(frame, labels, keep)
        noise = rng.normal(0.0, 1.0, (len(thin_frame), 3)) * settings.jitter_m
        changed.append(_move(thin_frame, thin_labels, changed_from_sensor, mirror, noise))
    return _backwards(changed) if backwards else changed


def turned(frame: Frame, labels: Labels, yaw_deg: float) -> LabelledFrame:
    """The frame as a sensor sees it that is mounted turned the other way, its labels with it."""
    return _move(frame, labels, _about_z(np.deg2rad(yaw_deg)), np.eye(4), np.zeros(1))


def _draw_motion(settings: AugmentSettings, rng: np.random.Generator) -> rigid.Pose:
    yaw = np.deg2rad(rng.uniform(-1, 1) * settings.yaw_deg)
    if settings.quarter_turns and rng.random() < settings.quarter_turns:
        yaw += 0.5 * np.pi * rng.integers(1, 4)
    tilt = np.deg2rad(rng.uniform(-1, 1, 2) * settings.tilt_deg)
    lift = rng.uniform(-1, 1) * settings.height_m
    tilted = rigid.exponential(np.array([tilt[0], tilt[1], 0.0, 0.0, 0.0, 0.0]))
    return rigid.translation((0.0, 0.0, lift)) @ tilted @ _about_z(yaw)


def _about_z(yaw: float) -> rigid.Pose:
    return rigid.exponential(np.array([0.0, 0.0, yaw, 0.0, 0.0, 0.0]))


def _thin(frame: Frame, labels: Labels, keep: NDArray[np.bool_]) -> LabelledFrame:
    if not keep.any():
        return frame, labels
    thin_frame = Frame(points=frame.points[keep], stamp=frame.stamp, name=frame.name)
    annotated = labels.annotated
    thin_labels = replace(
        labels,
        foreground=labels.foreground[keep],
        dynamic=labels.dynamic[keep],
        instance=labels.instance[keep],
        annotated=None if annotated is None else annotated[keep],
        semantic=None,
        points_at_stamp=None,
    )
    return thin_frame, thin_labels


def _move(
    frame: Frame,
    labels: Labels,
    changed_from_sensor: rigid.Pose,
    mirror: rigid.Pose,
    noise: NDArray[np.float64],
) -> LabelledFrame:
    """The frame seen by a sensor mounted otherwise; poses and boxes follow."""
    to_changed = changed_from_sensor @ mirror
    points = rigid.transform(to_changed, frame.points) + noise
    sensor_from_changed = mirror @ rigid.invert(changed_from_sensor)
    boxes = tuple(
        # Mirrored on both sides, a pose stays a rotation.
        replace(box, sensor_from_object=to_changed @ box.sensor_from_object @ mirror)
        for box in labels.boxes
    )
    world = mirror @ labels.world_from_sensor @ sensor_from_changed
    return frame.with_points(points), replace(labels, world_from_sensor=world, boxes=boxes)


def _backwards(window: list[LabelledFrame]) -> list[LabelledFrame]:
    """The last frame first, at times that still go up."""
    last = window[-1][0].stamp
    return [(replace(frame, stamp=last - frame.stamp), labels) for frame, labels in window[::-1]]
