"""Every movable shape stands on the ground, fits its box and is more than a box."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from lidaraccum.simulation.cars import CAR_TYPES, draw_car
from lidaraccum.simulation.catalogue import MAKERS, Catalogue
from lidaraccum.simulation.models import Model
from lidaraccum.simulation.people import GAIT_PHASES
from lidaraccum.simulation.surfaces import Surface

LENGTHS_M = {
    "car": (2.2, 6.2), "van": (4.2, 7.2), "truck": (5.5, 18.5), "bus": (8.0, 18.5),
    "tram": (17.5, 30.5), "trailer": (2.4, 7.5), "cyclist": (1.4, 2.6), "pedestrian": (0.2, 1.6),
}  # fmt: skip


def check(shape: Model) -> None:
    for mesh in shape.phases:
        low, high = mesh.bounds
        assert np.isfinite(mesh.vertices).all()
        assert low[2] > -0.12
        assert (np.abs(mesh.vertices[:, :2]) <= 0.5 * np.array(shape.size_lwh[:2]) + 1e-4).all()
        assert high[2] <= shape.size_lwh[2] + 1e-4
        assert mesh.triangles.max() < len(mesh.vertices)
        assert len(mesh) >= 12


@pytest.mark.parametrize("name", MAKERS)
def test_shapes_stand_in_their_boxes(name: str) -> None:
    for seed in range(6):
        shape = MAKERS[name](np.random.default_rng(seed))
        check(shape)
        shortest, longest = LENGTHS_M.get(name, (0.2, 6.0))
        assert shortest < shape.size_lwh[0] < longest


@pytest.mark.parametrize("kind", CAR_TYPES)
def test_cars_have_wheels_windows_and_insides(kind: str) -> None:
    shape = draw_car(np.random.default_rng(1), kind)
    check(shape)
    there = set(np.unique(shape.mesh.surface))
    assert {Surface.CAR_PAINT, Surface.CAR_GLASS, Surface.TYRE, Surface.INTERIOR} <= there


def test_legs_swing() -> None:
    walker = MAKERS["pedestrian"](np.random.default_rng(2))
    assert len(walker.phases) == GAIT_PHASES
    lengths = [np.ptp(mesh.vertices[mesh.vertices[:, 2] < 0.3, 0]) for mesh in walker.phases]
    assert max(lengths) > min(lengths) + 0.2


def test_repainting_changes_paint_alone() -> None:
    car = Catalogue(np.random.default_rng(3)).draw("car")
    other = car.repainted(0.9)
    paint = car.mesh.surface == Surface.CAR_PAINT
    assert (other.mesh.reflectivity[paint] == np.float32(0.9)).all()
    assert np.array_equal(other.mesh.reflectivity[~paint], car.mesh.reflectivity[~paint])


def test_rare_kinds_are_as_much_likelier_as_asked_and_usual_draws_stay() -> None:
    chances = {"car": 20.0, "pedestrian": 4.0, "truck": 2.0, "bus": 1.0}

    def kinds(**how: float) -> Counter[str]:
        catalogue = Catalogue(np.random.default_rng(5), **how)
        return Counter(catalogue.draw_any(chances).category for _ in range(2000))

    usual, often = kinds(), kinds(rare=4.0)
    assert usual == kinds(rare=1.0)
    assert usual["Truck"] / usual["Car"] == pytest.approx(0.1, rel=0.25)
    assert often["Truck"] / often["Car"] == pytest.approx(0.4, rel=0.25)
    assert often["Bus"] / often["Truck"] == pytest.approx(0.5, rel=0.25)
    assert often["Pedestrian"] / often["Car"] == pytest.approx(0.2, rel=0.25)
