"""Files are there whole or not at all."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from lidaraccum.errors import MissingInputError, OutputError, OutputExistsError
from lidaraccum.io.atomic import atomic, write_json


def test_a_file_gets_its_name_when_it_is_whole(tmp_path: Path) -> None:
    path = tmp_path / "deep" / "a.txt"
    with atomic(path) as temporary:
        temporary.write_text("half")
        assert not path.exists()
        assert temporary.parent == path.parent
    assert [p.name for p in path.parent.iterdir()] == ["a.txt"]


def test_an_exception_leaves_what_was_there(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_text("old")

    def interrupted() -> None:
        with atomic(path, overwrite=True) as temporary:
            temporary.write_text("new")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert path.read_text() == "old"
    assert len(list(tmp_path.iterdir())) == 1


def test_what_went_wrong_with_an_input_keeps_its_own_words(tmp_path: Path) -> None:
    def unreadable() -> None:
        with atomic(tmp_path / "a.txt"):
            raise MissingInputError("sweep 7 does not exist")

    with pytest.raises(MissingInputError, match=r"^sweep 7 does not exist$"):
        unreadable()
    assert not list(tmp_path.iterdir())


def test_json_is_refused_or_replaced(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    write_json(path, {"points": 3})
    with pytest.raises(OutputExistsError, match="--overwrite"):
        write_json(path, {})
    write_json(path, {"points": 4}, overwrite=True)
    assert json.loads(path.read_text()) == {"points": 4}


def test_a_place_that_cannot_be_is_said(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="cannot be made"):
        write_json(tmp_path / "file" / "a.json", {})
