"""Which weights are used, and how they are told apart."""

from __future__ import annotations

import hashlib
from pathlib import Path

import pytest

from lidaraccum.errors import MissingInputError
from lidaraccum.model import weights
from lidaraccum.model.weights import chosen_weights, weights_hash


def test_named_weights_come_before_shipped_ones(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    named, shipped = tmp_path / "named.safetensors", tmp_path / "shipped.safetensors"
    named.write_bytes(b"a")
    shipped.write_bytes(b"b")
    monkeypatch.setattr(weights, "shipped_weights", lambda: shipped)
    assert chosen_weights(named) == named
    assert chosen_weights(None) == shipped


def test_no_weights_at_all_are_said_to_be_missing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(weights, "shipped_weights", lambda: None)
    with pytest.raises(MissingInputError, match="--weights"):
        chosen_weights(None)
    with pytest.raises(MissingInputError, match=r"gone\.safetensors"):
        chosen_weights(tmp_path / "gone.safetensors")


@pytest.mark.shipped
def test_what_is_shipped_is_there() -> None:
    path = weights.shipped_weights()
    assert path is None or (path.is_file() and path.suffix == ".safetensors")


def test_the_hash_is_the_file_s(tmp_path: Path) -> None:
    (tmp_path / "one").write_bytes(b"some weights")
    assert weights_hash(tmp_path / "one") == hashlib.sha256(b"some weights").hexdigest()
