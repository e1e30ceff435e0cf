"""The house keeps its walls: which room may import which, and who may open which third party."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

SOURCE = Path(__file__).parents[1] / "src" / "lidaraccum"

FLOOR_OF = {
    "errors": 0,
    "geometry": 1,
    "data": 2,
    "metrics": 2,
    "io": 3,
    "simulation": 3,
    "registration": 3,
    "model": 3,
    "pipeline": 4,
    "training": 4,
    "evaluation": 5,
    "batch": 5,
    "cli": 6,
    "__main__": 7,
}

HOMES_OF = {
    "click": {"cli"},
    "open3d": {
        "simulation/sensor",
        "simulation/raycast",
        "registration",
        "pipeline/meshing",
        "evaluation/rivals",
    },
    "embreex": {"simulation/raycast"},
    "kiss_icp": {"evaluation/rivals"},
    "laspy": {"io"},
    "matplotlib": {"training/curves"},
    "plyfile": {"io"},
    "pyarrow": {"io/driving"},
    "torch": {"model", "training", "pipeline/perception"},
    "safetensors": {"model/checkpoint"},
    "tqdm": {"cli", "batch", "training"},
    "scipy": {"geometry", "registration", "simulation", "pipeline", "metrics", "evaluation"},
}

FREE = {"numpy", "lidaraccum", "tomli"}


def modules() -> list[Path]:
    return sorted(SOURCE.rglob("*.py"))


def imports(path: Path) -> Iterator[str]:
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            yield node.module or ""


def room_of(path: Path) -> str:
    return path.relative_to(SOURCE).with_suffix("").parts[0]


def place_of(path: Path) -> str:
    return path.relative_to(SOURCE).with_suffix("").as_posix()


def is_at_home(path: Path, homes: set[str]) -> bool:
    place = place_of(path)
    return any(place == home or place.startswith(f"{home}/") for home in homes)


@pytest.mark.parametrize("path", modules(), ids=place_of)
def test_a_room_imports_only_from_lower_floors(path: Path) -> None:
    room = room_of(path)
    if room == "__init__":
        return
    for name in imports(path):
        parts = name.split(".")
        if parts[0] != "lidaraccum" or len(parts) == 1 or parts[1] == room:
            continue
        assert FLOOR_OF[parts[1]] < FLOOR_OF[room], f"{place_of(path)} imports {name}"


@pytest.mark.parametrize("path", modules(), ids=place_of)
def test_third_parties_stay_in_their_rooms(path: Path) -> None:
    import sys

    for name in imports(path):
        package = name.split(".")[0]
        if package in sys.stdlib_module_names or package in FREE:
            continue
        assert package in HOMES_OF, f"{place_of(path)} opens {package}, which has no home"
        assert is_at_home(path, HOMES_OF[package]), f"{place_of(path)} opens {package}"


def test_every_room_has_its_floor() -> None:
    rooms = {path.name for path in SOURCE.iterdir() if path.is_dir() and path.name != "__pycache__"}
    assert rooms <= set(FLOOR_OF) | {"weights"}
