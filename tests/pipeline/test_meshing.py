"""Laws of surfaces: they lie on the points and face the sensor."""

from __future__ import annotations

import numpy as np
import pytest

from lidaraccum.errors import InputError, SettingsError
from lidaraccum.pipeline.meshing import MeshSettings, reconstruct

RADIUS = 3.0


def ball(count: int = 20_000, centre: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> np.ndarray:
    directions = np.random.default_rng(0).normal(size=(count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return RADIUS * directions + centre


@pytest.mark.parametrize("side", [1.0, -1.0], ids=["outside", "inside"])
def test_the_surface_lies_on_the_ball_and_faces_the_sensor(side: float) -> None:
    centre = np.array([500_000.0, 5_400_000.0, 100.0])
    points = ball(centre=tuple(centre))
    viewpoints = centre + (points - centre) * (10.0 if side > 0 else 0.0)
    mesh = reconstruct(points, viewpoints, MeshSettings(depth=6))
    outwards = mesh.vertices - centre
    np.testing.assert_allclose(np.linalg.norm(outwards, axis=1), RADIUS, atol=0.03)
    facing = side * np.einsum("ij,ij->i", outwards, mesh.normals) > 0
    assert facing.mean() > 0.99


def test_tiles_together_cover_what_one_piece_covers() -> None:
    grid = np.stack(np.meshgrid(np.arange(0, 24, 0.1), np.arange(0, 12, 0.1)), axis=-1)
    flat = grid.reshape(-1, 2)
    points = np.column_stack([flat, 0.2 * np.sin(flat[:, 0])])
    above = points + np.array([0, 0, 10])
    whole = reconstruct(points, above, MeshSettings(depth=7))
    tiled = reconstruct(points, above, MeshSettings(depth=7, tile_m=8.0))

    def area(mesh: object) -> float:
        corners = mesh.vertices[mesh.triangles]  # type: ignore[attr-defined]
        sides = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        return float(np.linalg.norm(sides, axis=1).sum() / 2)

    assert area(tiled) == pytest.approx(area(whole), rel=0.15)
    assert np.abs(tiled.vertices[:, 2]).max() < 0.5


def test_too_few_points_are_refused() -> None:
    with pytest.raises(InputError, match="too few"):
        reconstruct(np.zeros((5, 3)), np.zeros((5, 3)))


@pytest.mark.parametrize(
    "wrong", [{"depth": 0}, {"trim_percentile": 100.0}, {"tile_m": 1.0}, {"normal_radius_m": 0.0}]
)
def test_settings_that_make_no_sense_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(SettingsError):
        MeshSettings(**wrong)  # type: ignore[arg-type]
