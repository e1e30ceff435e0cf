"""People who walk with swinging legs and arms, children, prams, wheelchairs and dogs."""

from __future__ import annotations

import numpy as np

from lidaraccum.simulation.mesh import Finish, Mesh, blob, box, disc_wheel, lathe, merge, rod
from lidaraccum.simulation.models import Model, model, of_parts
from lidaraccum.simulation.surfaces import Surface

GAIT_PHASES = 6
SKIN = Finish(Surface.SKIN, 0.45)


def cloth(rng: np.random.Generator) -> Finish:
    """Some garment."""
    return Finish(Surface.CLOTH, float(rng.uniform(0.05, 0.8)))


def draw_pedestrian(rng: np.random.Generator, height: float | None = None) -> Model:
    """A walking grown-up, or a child, with what people carry."""
    height = height or float(rng.normal(1.72, 0.09))
    stride = 0.8 * height * rng.uniform(0.85, 1.1)
    swing = 0.45 * rng.uniform(0.7, 1.1)
    torso, load = _torso(height, rng), _carried(height, rng)
    legs, arms = cloth(rng), cloth(rng)
    phases = []
    for phase in 2 * np.pi * np.arange(GAIT_PHASES) / GAIT_PHASES:
        angle = swing * float(np.sin(phase))
        limbs = [_leg(height, side, side * angle, legs) for side in (-1, 1)]
        limbs += [_arm(height, side, -side * angle * 0.8, arms) for side in (-1, 1)]
        phases.append(merge([torso, load, *limbs]))
    return model("Pedestrian", tuple(phases), 2 * stride)


def draw_child(rng: np.random.Generator) -> Model:
    """A child from 0.9 to 1.4 m."""
    return draw_pedestrian(rng, float(rng.uniform(0.9, 1.4)))


def _torso(height: float, rng: np.random.Generator) -> Mesh:
    stout = rng.uniform(0.85, 1.35)
    hip, neck = 0.48 * height, 0.84 * height
    finish = cloth(rng)
    profile = [(0.0, hip - 0.04), (0.16, hip), (0.145, 0.62 * height), (0.19, 0.78 * height),
               (0.06, neck), (0.06, neck + 0.03)]  # fmt: skip
    if rng.random() < 0.25:
        hem = rng.uniform(0.2, 0.42) * height
        profile[0:2] = [(0.26, hem), (0.17, hip)]
    scale = height / 1.75
    trunk = lathe([(radius * scale * stout, z) for radius, z in profile], finish, 8)
    trunk = trunk.moved((0, 0, 0), 0.0, (0.68, 1.15, 1.0))
    head = blob(
        (0.1 * scale, 0.08 * scale, 0.125 * scale), (0.02, 0, 0.925 * height), SKIN, rng, 0.04
    )
    return merge([trunk, head])


def _leg(height: float, side: int, angle: float, finish: Finish) -> Mesh:
    hip = np.array([0.0, side * 0.05 * height, 0.5 * height])
    bend = max(0.0, -angle) * 1.2
    knee = hip + 0.25 * height * np.array([np.sin(angle), 0.0, -np.cos(angle)])
    foot = knee + 0.25 * height * np.array([np.sin(angle - bend), 0.0, -np.cos(angle - bend)])
    foot[2] = max(float(foot[2]), 0.03)
    shoe = box((0.15 * height, 0.05 * height, 0.05), (foot[0] + 0.04, foot[1], 0.0), finish)
    radius = 0.042 * height
    return merge(
        [rod(hip, knee, radius * 1.15, finish), rod(knee, foot, radius * 0.8, finish), shoe]
    )


def _arm(height: float, side: int, angle: float, finish: Finish) -> Mesh:
    shoulder = np.array([0.0, side * 0.125 * height, 0.8 * height])
    elbow = shoulder + 0.17 * height * np.array([np.sin(angle), 0.0, -np.cos(angle)])
    fore = angle + 0.25
    hand = elbow + 0.2 * height * np.array([np.sin(fore), 0.0, -np.cos(fore)])
    return merge(
        [rod(shoulder, elbow, 0.03 * height, finish), rod(elbow, hand, 0.022 * height, SKIN)]
    )


def _carried(height: float, rng: np.random.Generator) -> Mesh:
    """A rucksack, a bag, an umbrella, or nothing (an empty-handed crumb under the hip)."""
    finish, choice = cloth(rng), rng.random()
    if choice < 0.25:
        return blob((0.13, 0.15, 0.24), (-0.2, 0, 0.68 * height), finish, rng, 0.08)
    if choice < 0.4:
        return box((0.3, 0.12, 0.3), (0.05, 0.17 * height, 0.22 * height), finish)
    if choice < 0.46:
        shade = lathe([(0.55, 1.12 * height), (0.3, 1.22 * height), (0.0, 1.28 * height)], finish)
        return merge([shade, rod((0.1, 0, 0.7 * height), (0, 0, 1.27 * height), 0.012, finish)])
    return box((0.1, 0.1, 0.05), (0, 0, 0.5 * height), finish)


def sitting(rng: np.random.Generator, seat: float, lean: float, reach: float) -> Mesh:
    """A rider: hips at ``seat`` metres, trunk leaning forward by ``lean`` radians, hands at x."""
    finish = cloth(rng)
    trunk = lathe([(0.0, -0.05), (0.17, 0.0), (0.19, 0.4), (0.06, 0.56), (0.05, 0.6)], finish, 8)
    trunk = trunk.moved((0, 0, seat), 0.0, (0.8, 1.05, 1.0)).pitched(lean, (0, 0, seat))
    top = np.array([np.sin(lean), 0, np.cos(lean)])
    head = blob((0.12, 0.09, 0.13), tuple(seat * np.eye(3)[2] + 0.74 * top), SKIN, rng, 0.04)
    shoulder = seat * np.eye(3)[2] + 0.45 * top
    parts = [trunk, head]
    for side in (-1, 1):
        hand = np.array([reach, side * 0.25, seat + 0.1])
        parts.append(rod(shoulder + np.array([0, side * 0.2, 0]), hand, 0.045, finish))
        knee = np.array([0.38, side * 0.12, seat - 0.12 + 0.06 * side])
        foot = np.array([0.22, side * 0.11, max(seat - 0.62 + 0.1 * side, 0.12)])
        parts += [rod((0, side * 0.1, seat), knee, 0.075, finish), rod(knee, foot, 0.055, finish)]
    return merge(parts)


def draw_dog(rng: np.random.Generator) -> Model:
    """A dog on four legs."""
    scale, finish = rng.uniform(0.5, 1.1), Finish(Surface.SKIN, float(rng.uniform(0.1, 0.6)))
    phases = []
    for phase in 2 * np.pi * np.arange(4) / 4:
        step = 0.1 * float(np.sin(phase))
        trunk = blob((0.38, 0.13, 0.15), (0, 0, 0.5), finish, np.random.default_rng(3), 0.06)
        head = blob((0.15, 0.08, 0.09), (0.5, 0, 0.66), finish, np.random.default_rng(4), 0.05)
        legs = [
            rod((x, y, 0.45), (x + (step if x * y > 0 else -step), y, 0.0), 0.04, finish)
            for x in (-0.28, 0.28)
            for y in (-0.08, 0.08)
        ]
        tail = rod((-0.36, 0, 0.55), (-0.6, 0, 0.75), 0.025, finish)
        phases.append(merge([trunk, head, tail, *legs]).moved((0, 0, 0), 0.0, scale))
    return model("Animal", tuple(phases), 0.6)


def draw_pram(rng: np.random.Generator) -> Model:
    """A pram, a shopping trolley, a wheelchair with its user, or a suitcase on wheels."""
    finish, frame = cloth(rng), Finish(Surface.CYCLE, 0.4)
    choice = int(rng.integers(4))
    if choice == 0:
        basin = blob((0.4, 0.22, 0.22), (0, 0, 0.75), finish, rng, 0.08)
        handle = rod((-0.3, 0, 0.8), (-0.65, 0, 1.05), 0.03, frame)
        tyres = [
            disc_wheel((x, y, 0.14), 0.14, 0.04, frame) for x in (-0.3, 0.3) for y in (-0.22, 0.22)
        ]
        return of_parts("Pram", basin, handle, *tyres)
    if choice == 1:
        basket = box((0.75, 0.5, 0.45), (0, 0, 0.5), Finish(Surface.MESH_FENCE, 0.5), (1.1, 1.1))
        handle = rod((-0.5, -0.25, 1.02), (-0.5, 0.25, 1.02), 0.02, frame)
        return of_parts("Trolley", basket, handle, box((0.7, 0.4, 0.05), (0, 0, 0.12), frame))
    if choice == 2:
        tyres = [disc_wheel((-0.1, y, 0.3), 0.3, 0.04, frame) for y in (-0.3, 0.3)]
        return of_parts("Wheelchair", sitting(rng, 0.55, 0.05, 0.25), *tyres,
                        box((0.45, 0.45, 0.06), (0, 0, 0.48), finish))  # fmt: skip
    return of_parts("Trolley", box((0.3, 0.45, 0.65), (0, 0, 0.08), finish),
                    rod((-0.15, 0, 0.7), (-0.35, 0, 1.0), 0.015, frame))  # fmt: skip
