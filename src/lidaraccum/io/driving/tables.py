"""Tables as the data sets keep them: JSON lists of records, feather and parquet files."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import fields
from pathlib import Path
from typing import Any, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from lidaraccum.errors import InputError, MissingDependencyError
from lidaraccum.io.columns import readable

INSTALL = "pip install 'pyarrow>=14', or this package with its extra 'convert'"
BUFFER_BYTES = 1 << 22

Record = TypeVar("Record")
Table = Mapping[str, NDArray[Any]]


def read_records(
    path: Path, kind: type[Record], wanted: Callable[[Record], bool] | None = None
) -> list[Record]:
    """Read a JSON list of objects as records of one kind.

    Records that are not wanted are dropped while parsing: the tables of a whole data set hold
    millions.

    Args:
        path: The file.
        kind: A dataclass; its fields are the keys to be read, other keys are passed over.
        wanted: Which records to keep; None keeps all.

    Raises:
        MissingInputError: The file does not exist.
        InputError: It is no such list, or a record lacks a key.
    """
    names = [field.name for field in fields(cast(Any, kind))]

    def record_of(entry: dict[str, Any]) -> Record | None:
        missing = [name for name in names if name not in entry]
        if missing:
            raise InputError(f"{path}: a record has no {', '.join(missing)}")
        record = kind(**{name: entry[name] for name in names})
        return record if wanted is None or wanted(record) else None

    with readable(path), path.open("rb") as file:
        try:
            records = json.load(file, object_hook=record_of)
        except InputError:
            raise
        except ValueError as error:
            raise InputError(f"{path} is not JSON: {error}") from error
    kept = [one for one in records if one is not None] if isinstance(records, list) else None
    if kept is None or not all(isinstance(record, kind) for record in kept):
        raise InputError(f"{path} is not a list of records")
    return kept


def read_feather(path: Path, columns: Sequence[str]) -> Table:
    """Columns (N,) of a feather file.

    Raises:
        MissingDependencyError: pyarrow is not installed.
        InputError: The file cannot be read or lacks a column.
    """
    with _arrow_file(path):
        import pyarrow as pa

        with pa.OSFile(str(path)) as file, pa.ipc.open_file(file) as reader:
            _check_columns(path, reader.schema.names, columns)
            table = reader.read_all()
            return {name: table.column(name).to_numpy() for name in columns}


def read_parquet(path: Path, columns: Sequence[str]) -> Table:
    """Columns (N,) of a parquet file; a column of lists as an array of arrays.

    Raises:
        MissingDependencyError: pyarrow is not installed.
        InputError: The file cannot be read or lacks a column.
    """
    with _arrow_file(path):
        import pyarrow.parquet as pq

        with pq.ParquetFile(path) as file:
            _check_columns(path, file.schema_arrow.names, columns)
            table = file.read(columns=list(columns), use_threads=False)
            return {name: table.column(name).to_numpy() for name in columns}


class ParquetRows:
    """Rows of a parquet file whose rows are large, one at a time and best in order.

    Getting a row costs decoding what lies between it and the last one got; going back costs
    decoding its row group from the start.

    Args:
        path: The file.
        columns: What to read of each row, lists of numbers.

    Raises:
        MissingDependencyError: pyarrow is not installed.
        InputError: The file cannot be read or lacks a column.
    """

    def __init__(self, path: Path, columns: Sequence[str]) -> None:
        self._path, self._columns = path, list(columns)
        with _arrow_file(path):
            import pyarrow.parquet as pq

            # Read piece by piece: a column of one row group may hold a whole segment.
            self._file = pq.ParquetFile(path, buffer_size=BUFFER_BYTES, pre_buffer=False)
            _check_columns(path, self._file.schema_arrow.names, columns)
        groups = self._file.metadata
        counts = [groups.row_group(group).num_rows for group in range(groups.num_row_groups)]
        self._starts = np.cumsum([0, *counts])[:-1]
        self._rows: Iterator[Any] = iter(())
        self._next = -1

    def row(self, number: int) -> dict[str, NDArray[Any] | None]:
        """The lists of one row by column; None where there is none."""
        group = int(np.searchsorted(self._starts, number, side="right")) - 1
        start = int(self._starts[group])
        with _arrow_file(self._path):
            if not start <= self._next <= number:
                self._rows = self._file.iter_batches(
                    batch_size=1,
                    row_groups=list(range(group, len(self._starts))),
                    columns=self._columns,
                    use_threads=False,
                )
                self._next = start
            while True:
                batch = next(self._rows)
                self._next += 1
                if self._next > number:
                    break
        return {name: _list_of(batch.column(name)[0]) for name in self._columns}


def _list_of(value: Any) -> NDArray[Any] | None:
    return value.values.to_numpy(zero_copy_only=False) if value.is_valid else None


def _check_columns(path: Path, present: Sequence[str], columns: Sequence[str]) -> None:
    missing = [name for name in columns if name not in present]
    if missing:
        raise InputError(
            f"{path} has no column {', '.join(missing)}", hint=f"it has {', '.join(present)}"
        )


@contextmanager
def _arrow_file(path: Path) -> Iterator[None]:
    """Turns what pyarrow says about a file, or its absence, into our errors."""
    try:
        import pyarrow as pa
    except ImportError as error:
        raise MissingDependencyError("pyarrow is not installed", hint=INSTALL) from error
    with readable(path):
        try:
            yield
        except pa.ArrowException as error:
            if isinstance(error, OSError):
                raise
            said = " ".join(str(error).split())
            raise InputError(f"{path} cannot be read: {said:.120}") from error
