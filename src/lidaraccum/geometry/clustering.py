"""Groups of points that hang together, seen from above."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

_EIGHT = np.ones((3, 3), dtype=np.int8)


def connected_cells(positions: NDArray[Any], cell_m: float) -> NDArray[np.int64]:
    """Cluster (N,), from 0, of points (N, 2) or (N, 3) by connected square cells seen from above.

    Cells that share an edge or a corner belong together, so gaps up to ``cell_m`` never part two
    points and gaps over twice that always do. Every point has a cluster; linear time.
    """
    if len(positions) == 0:
        return np.zeros(0, dtype=np.int64)
    cells = np.floor(positions[:, :2] * (1.0 / cell_m)).astype(np.int64)
    cells -= cells.min(axis=0)
    taken = np.zeros(cells.max(axis=0) + 1, dtype=np.int8)
    taken[cells[:, 0], cells[:, 1]] = 1
    named, _ = ndimage.label(taken, structure=_EIGHT)
    return named[cells[:, 0], cells[:, 1]].astype(np.int64) - 1
