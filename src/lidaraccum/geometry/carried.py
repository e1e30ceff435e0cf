"""What goes along with the sensor: parts of what carries it, which the truth says nothing of."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation

REACH_M = 2.5
"""Of what carries the sensor no more is looked for than this near to it; `pipeline` cuts it out."""
ASIDE_M = 1.2
"""What lies farther from the sensor's way than half a lorry is beside it: it may keep pace."""
CELL_M = 0.2
TRAVELLED_M = 1.0
"""Of a sensor that travelled less, what stands beside it stays as near as what carries it."""
MOST = 0.8
"""Of the frames, in which something is there; one of five may have lost it."""
_ABOUT = np.ones((3, 3, 3), dtype=np.bool_)


def carried(
    places: NDArray[np.float64],
    frame: NDArray[np.int64],
    frames: int,
    travelled: NDArray[np.float64],
) -> NDArray[np.bool_]:
    """Which of points (N,) stay where they are about the sensor, on its way, in most frames.

    Args:
        places: (N, 3) metres about the sensor, in its own frame's coordinates.
        frame: (N,) of which frame, 0..frames-1.
        frames: How many.
        travelled: (3,) metres, how far the sensor went among them, and which way.
    """
    stays = np.zeros(len(places), dtype=np.bool_)
    length = float(np.linalg.norm(travelled[:2]))
    if length < TRAVELLED_M:
        return stays
    left = np.array([-travelled[1], travelled[0]]) / length
    near = np.linalg.norm(places, axis=1) < REACH_M
    near &= np.abs(places[:, :2] @ left) < ASIDE_M
    side = 2 * int(np.ceil(REACH_M / CELL_M)) + 2
    cells = tuple(np.floor(places[near] / CELL_M).astype(np.int64).T + side // 2)
    seen = np.zeros((side, side, side), dtype=np.int64)
    for one in range(frames):
        taken = np.zeros(seen.shape, dtype=np.bool_)
        mine = frame[near] == one
        taken[tuple(axis[mine] for axis in cells)] = True
        seen += binary_dilation(taken, _ABOUT)
    stays[near] = seen[cells] >= MOST * frames
    return stays
