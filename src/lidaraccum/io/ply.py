"""PLY in: ascii and both byte orders, float and double, every scalar property carried."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from numpy.typing import NDArray
from plyfile import PlyData, PlyElementParseError, PlyListProperty, PlyParseError

from lidaraccum.errors import InputError
from lidaraccum.io.columns import Columns, columns_of_names, native, readable
from lidaraccum.io.ply_ascii import read_ascii_vertices

SCALAR_PREFIX = "scalar_"
"""CloudCompare's mark of a scalar field; ``scalar_X`` is attribute ``X``."""


def read_ply(path: Path) -> Columns:
    """Read the vertices of a PLY file; list properties and other elements are left out.

    Raises:
        InputError: Not a PLY file, truncated, or without vertices.
    """
    vertices = read_ascii_vertices(path)
    if vertices is not None:
        return columns_of_names(path, bare_names(vertices, list(vertices.dtype.names or ())))
    with readable(path):
        try:
            data = PlyData.read(str(path))
        except PlyElementParseError as error:
            raise truncated(path, error) from error
        except (PlyParseError, UnicodeDecodeError, ValueError) as error:
            raise InputError(f"{path} is not a PLY file that can be read: {error}") from error
    vertex = next((element for element in data.elements if element.name == "vertex"), None)
    if vertex is None:
        raise InputError(f"{path} is a PLY file without vertices")
    scalars = [p.name for p in vertex.properties if not isinstance(p, PlyListProperty)]
    columns = columns_of_names(path, bare_names(vertex.data, scalars))
    return Columns(columns.xyz, columns.attributes, warnings=left_out(path, data))


def bare_names(record: NDArray[Any], names: list[str]) -> dict[str, NDArray[Any]]:
    """The named fields (N,) of a structured array, less CloudCompare's prefix."""
    by_name = {}
    for name in names:
        bare = name.removeprefix(SCALAR_PREFIX)
        by_name[bare if bare and bare not in names else name] = native(record[name])
    return by_name


def left_out(path: Path, data: PlyData) -> tuple[str, ...]:
    """What of the file has no place in a frame, in words."""
    lists = [
        prop.name
        for element in data.elements
        for prop in element.properties
        if element.name == "vertex" and isinstance(prop, PlyListProperty)
    ]
    elements = [e.name for e in data.elements if e.name != "vertex" and e.count]
    said = [f"{path.name}: list property {name} is left out" for name in lists]
    said += [f"{path.name}: element {name} is left out" for name in elements]
    return tuple(said)


def truncated(path: Path, error: PlyElementParseError) -> InputError:
    """The error for a body that ends too early, with the bytes found and expected."""
    element = error.element
    size = path.stat().st_size
    read = "" if error.row is None else f", {error.row} could be read"
    promise = f"{path} is truncated or damaged: it promises {element.count} {element.name} rows"
    if any(isinstance(prop, PlyListProperty) for prop in element.properties):
        return InputError(f"{promise}{read} ({size} bytes: {error})")
    with path.open("rb") as file:
        head = file.read(65536)
    end = head.find(b"end_header")
    start = head.find(b"\n", end) + 1
    if b"format ascii" in head[:end]:
        return InputError(f"{promise}{read} from its {size} bytes: {error.message}")
    needed = start + element.count * element.dtype().itemsize
    return InputError(f"{promise}, {needed} bytes in all, but has {size}")
