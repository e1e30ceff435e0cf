"""Square tables of values at the centres of level cells about the sensor."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def centres(*, reach_m: float, cell_m: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Where the cells of a table have their centres, metres: x and y (G, G)."""
    along = (np.arange(int(2 * reach_m / cell_m)) + 0.5) * cell_m - reach_m
    x, y = np.meshgrid(along, along, indexing="ij")
    return x, y


def interpolated(
    table: NDArray[Any], x: NDArray[Any], y: NDArray[Any], *, reach_m: float, cell_m: float
) -> NDArray[Any]:
    """Values (N,) between the centres of a table's cells (G, G), in x and y's own precision.

    Args:
        table: Rows along x, columns along y, of the square from -reach to reach.
        x: (N,) metres.
        y: (N,) metres; outside the outermost centres the nearest value holds.
        reach_m: Half the table's side.
        cell_m: Side of a cell.
    """
    row, down = _cell_and_rest(x, len(table), reach_m, cell_m)
    column, across = _cell_and_rest(y, len(table), reach_m, cell_m)
    corner = row * len(table) + column
    values = table.astype(x.dtype, copy=False).ravel()
    near = values[corner] * (1 - across) + values[corner + 1] * across
    corner += len(table)
    far = values[corner] * (1 - across) + values[corner + 1] * across
    return np.asarray(near * (1 - down) + far * down)


def _cell_and_rest(
    along: NDArray[Any], cells: int, reach_m: float, cell_m: float
) -> tuple[NDArray[np.int64], NDArray[Any]]:
    """The cell (N,) whose centre comes before each place, and how far on that is, 0..1."""
    place = np.clip((along + reach_m) / cell_m - 0.5, 0.0, cells - 1.0)
    cell = np.minimum(place.astype(np.int64), cells - 2)
    return cell, place - cell.astype(place.dtype)
