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


def sorted_rows(numbers: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Rows (N,) in the order of their whole numbers, equal ones as they come, and these in order.

    Number and row are sorted as one: that takes half the time of sorting rows by their numbers.

    Args:
        numbers: (N,) not negative; so small that number times row is below 2**62.
    """
    bits = len(numbers).bit_length()
    packed = numbers << bits
    packed |= np.arange(len(numbers))
    packed.sort()
    return packed & ((1 << bits) - 1), packed >> bits
