"""Tables are read as they are, or refused in one sentence."""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from pyarrow import feather

from lidaraccum.errors import InputError, MissingDependencyError, MissingInputError
from lidaraccum.io.driving.tables import ParquetRows, read_feather, read_parquet, read_records


@dataclass(frozen=True)
class Row:
    token: str
    size: list[float]


def test_records_hold_their_keys_and_pass_over_others(tmp_path: Path) -> None:
    path = tmp_path / "table.json"
    rows = [{"token": str(n), "size": [n, 2.0], "more": {}} for n in range(4)]
    path.write_text(json.dumps([{k: v for k, v in row.items() if k != "more"} for row in rows]))
    assert read_records(path, Row) == [Row(str(n), [n, 2.0]) for n in range(4)]
    assert read_records(path, Row, lambda row: row.token in "13") == [
        Row("1", [1, 2.0]),
        Row("3", [3, 2.0]),
    ]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('[{"token": "a"}]', "no size"),
        ('{"token": "a", "size": []}', "not a list"),
        ("[1, 2", "not JSON"),
        ("\xff", "not JSON"),
        ("[1, 2]", "not a list of records"),
    ],
)
def test_a_broken_table_is_named(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "table.json"
    path.write_bytes(text.encode("latin-1"))
    with pytest.raises(InputError, match=said) as caught:
        read_records(path, Row)
    assert str(path) in str(caught.value)


def test_a_missing_table_is_named(tmp_path: Path) -> None:
    for read in (
        lambda path: read_records(path, Row),
        lambda path: read_feather(path, ["x"]),
        lambda path: read_parquet(path, ["x"]),
        lambda path: ParquetRows(path, ["x"]),
    ):
        with pytest.raises(MissingInputError, match="absent"):
            read(tmp_path / "absent")


@pytest.mark.parametrize("compression", ["uncompressed", "lz4", "zstd"])
def test_feather_columns_keep_their_types(tmp_path: Path, compression: str) -> None:
    path = tmp_path / "table.feather"
    words = pa.array(["a", "b", "a"]).dictionary_encode()
    columns = {"x": np.arange(3, dtype=np.float16), "n": np.arange(3, dtype=np.uint8)}
    table = pa.table({**{k: pa.array(v) for k, v in columns.items()}, "word": words})
    feather.write_feather(table, str(path), compression=compression)
    read = read_feather(path, ["word", "n", "x"])
    assert read["word"].tolist() == ["a", "b", "a"]
    for name, values in columns.items():
        assert read[name].dtype == values.dtype
        np.testing.assert_array_equal(read[name], values)


@pytest.mark.parametrize("read", [read_feather, read_parquet, ParquetRows])
def test_a_file_of_something_else_is_refused(tmp_path: Path, read: object) -> None:
    path = tmp_path / "table"
    path.write_bytes(b"this is neither")
    with pytest.raises(InputError, match="cannot be read") as caught:
        read(path, ["x"])  # type: ignore[operator]
    assert str(path) in str(caught.value)


@pytest.fixture
def large(tmp_path: Path) -> Path:
    """Ten rows of lists in groups of four; row 6 has none."""
    path = tmp_path / "large.parquet"
    lists = [None if row == 6 else np.full(row + 1, row, dtype="f4") for row in range(10)]
    table = pa.table({"key.row": list(range(10)), "[Part].values": pa.array(lists)})
    pq.write_table(table, path, row_group_size=4)
    return path


@pytest.mark.parametrize("order", [range(10), range(9, -1, -1), (3, 3, 8, 0, 9, 6, 1)])
def test_large_rows_are_found_in_any_order(large: Path, order: list[int]) -> None:
    rows = ParquetRows(large, ["[Part].values"])
    for row in order:
        values = rows.row(row)["[Part].values"]
        if row == 6:
            assert values is None
        else:
            np.testing.assert_array_equal(values, np.full(row + 1, row))


def test_a_missing_column_is_named_beside_those_there_are(large: Path) -> None:
    for read in (read_parquet, ParquetRows):
        with pytest.raises(InputError, match=r"no column key\.stamp") as caught:
            read(large, ["key.row", "key.stamp"])
        assert "[Part].values" in str(caught.value)


def test_without_pyarrow_the_way_to_it_is_said(
    large: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(MissingDependencyError, match="pip install"):
        read_parquet(large, ["key.row"])
