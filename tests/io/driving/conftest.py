"""The made-up street as each data set would have recorded it."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

HERE = Path(__file__).parent


@pytest.fixture(scope="session")
def logs() -> ModuleType:
    """The package ``driving_logs`` beside this file."""
    package = HERE / "driving_logs"
    spec = importlib.util.spec_from_file_location(
        package.name, package / "__init__.py", submodule_search_locations=[str(package)]
    )
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[package.name] = module
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="session", params=["nuscenes", "waymo", "argoverse2"])
def written(
    request: pytest.FixtureRequest, logs: ModuleType, tmp_path_factory: pytest.TempPathFactory
) -> Any:
    """Each data set in turn, on disk; not to be changed."""
    return logs.write(request.param, tmp_path_factory.mktemp(request.param))
