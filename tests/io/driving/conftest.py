"""The made-up street as each data set would have recorded it."""

from __future__ import annotations

from types import ModuleType
from typing import Any

import pytest


@pytest.fixture(scope="session", params=["nuscenes", "waymo", "argoverse2"])
def written(
    request: pytest.FixtureRequest, logs: ModuleType, tmp_path_factory: pytest.TempPathFactory
) -> Any:
    """Each data set in turn, on disk; not to be changed."""
    return logs.write(request.param, tmp_path_factory.mktemp(request.param))
