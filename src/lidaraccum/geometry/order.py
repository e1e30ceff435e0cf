"""Values by their order."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def middle(values: NDArray[Any]) -> float:
    """The median of values (N,), of an even number the upper one: the mean of the two costs most.

    Raises:
        IndexError: There is no value.
    """
    half = len(values) // 2
    return float(np.partition(values, half)[half])
