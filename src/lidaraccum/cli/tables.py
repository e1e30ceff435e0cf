"""Settings dataclasses to TOML tables and back: one key a field, one table a nested dataclass."""

from __future__ import annotations

import difflib
import json
import types
import typing
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any, Literal, TypeVar, Union

from lidaraccum.errors import SettingsError

Settings = TypeVar("Settings")

_SINGULAR = {bool: "true or false", int: "a whole number", float: "a number", str: "a text"}


def settings_from(kind: type[Settings], table: Mapping[str, Any], name: str) -> Settings:
    """A settings dataclass from a table; what the table leaves out keeps its default.

    Args:
        kind: The dataclass; its fields may be dataclasses in turn.
        table: What the TOML file says.
        name: What the table is called, for messages.

    Raises:
        SettingsError: A key is unknown, a value of the wrong kind or refused by the dataclass.
    """
    hints = typing.get_type_hints(kind)
    known = [one.name for one in fields(kind)]  # type: ignore[arg-type]
    values = {}
    for key, value in table.items():
        if key not in known:
            near = difflib.get_close_matches(key, known, n=1)
            hint = f"did you mean {near[0]!r}?" if near else f"known: {', '.join(known)}"
            raise SettingsError(f"[{name}] sets {key!r}, which is no setting", hint=hint)
        values[key] = _value(hints[key], value, f"{name}.{key}")
    return kind(**values)


def _value(hint: Any, value: Any, name: str) -> Any:
    """The value as a field of that type takes it."""
    origin, parts = typing.get_origin(hint), typing.get_args(hint)
    if is_dataclass(hint):
        if not isinstance(value, Mapping):
            raise SettingsError(f"{name} is a table, not {value!r}")
        return settings_from(typing.cast("type[Any]", hint), value, name)
    if origin in (Union, types.UnionType):
        return _value(next(part for part in parts if part is not type(None)), value, name)
    if origin is Literal:
        if value not in parts:
            raise SettingsError(f"{name} is one of {', '.join(parts)}, not {value!r}")
        return value
    if origin is tuple:
        if not isinstance(value, (list, tuple)):
            raise SettingsError(f"{name} is a list, not {value!r}")
        return tuple(_value(parts[0], one, name) for one in value)
    return _single(hint, value, name)


def _single(hint: Any, value: Any, name: str) -> Any:
    if hint is Path:
        return Path(_single(str, value, name))
    if hint is float and type(value) is int:
        return float(value)
    if type(value) is not hint:
        raise SettingsError(f"{name} is {_SINGULAR.get(hint, hint)}, not {value!r}")
    return value


def merged(below: Mapping[str, Any], above: Mapping[str, Any]) -> dict[str, Any]:
    """Both tables, the upper one's values where both have one, table by table."""
    both = dict(below)
    for name, value in above.items():
        under = both.get(name)
        if isinstance(value, Mapping) and isinstance(under, Mapping):
            both[name] = merged(under, value)
        else:
            both[name] = value
    return both


def toml_of(settings: Any, name: str) -> str:
    """A settings dataclass as TOML tables, the outermost called ``name``.

    TOML has no null: what is not set is shown but commented out.
    """
    plain, nested = [], []
    for one in fields(settings):
        value = getattr(settings, one.name)
        if is_dataclass(value):
            nested.append(toml_of(value, f"{name}.{one.name}"))
        elif value is None:
            plain.append(f"# {one.name} =")
        else:
            plain.append(f"{one.name} = {_written(value)}")
    return "\n\n".join(["\n".join([f"[{name}]", *plain]), *nested])


def _written(value: Any) -> str:
    if isinstance(value, tuple):
        return f"[{', '.join(_written(one) for one in value)}]"
    return json.dumps(str(value) if isinstance(value, Path) else value)
