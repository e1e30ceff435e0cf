"""Turns a raw LiDAR drive into one clean, dense, labelled point cloud.

The names below are handed on lazily, so that importing the package (and ``lidaraccum --help``)
loads neither torch nor open3d.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

__version__ = "0.1.0"

_HOME_OF = {
    "Accumulation": "lidaraccum.data.accumulation",
    "Box": "lidaraccum.data.frame",
    "Frame": "lidaraccum.data.frame",
    "LabelledSequence": "lidaraccum.data.sequence",
    "Labels": "lidaraccum.data.frame",
    "LidarAccumError": "lidaraccum.errors",
    "Sequence": "lidaraccum.data.sequence",
    "accumulate": "lidaraccum.pipeline.accumulator",
    "open_sequence": "lidaraccum.io.sequences",
}

__all__ = [
    "__version__",
    *_HOME_OF,
]


def __getattr__(name: str) -> Any:
    if name not in _HOME_OF:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_HOME_OF[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)
