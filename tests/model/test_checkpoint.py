"""A checkpoint rebuilds its network by itself, and refuses what is none."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest
import torch

from lidaraccum.data.frame import Frame
from lidaraccum.errors import InputError, MissingInputError
from lidaraccum.model.batch import prepare, to_tensors
from lidaraccum.model.checkpoint import (
    load_network,
    read_tensors,
    save_network,
    write_tensors,
)
from lidaraccum.model.network import Network
from lidaraccum.model.weights import weights_hash


def test_the_network_comes_back_with_its_settings_and_answers(
    network: Network, frames: list[Frame], tmp_path: Path
) -> None:
    path = tmp_path / "weights.safetensors"
    save_network(network, path, {"steps": "7"})
    again = load_network(path)
    assert again.settings == network.settings
    tensors = to_tensors([prepare(frames[0], network.settings)])
    with torch.no_grad():
        one, two = network.encode(tensors), again.encode(tensors)
    assert torch.equal(one.foreground, two.foreground)
    assert read_tensors(path)[1]["steps"] == "7"
    assert [file.name for file in tmp_path.iterdir()] == [path.name]


def test_a_file_from_before_a_setting_is_read_as_it_was_made(
    network: Network, tmp_path: Path
) -> None:
    """Older networks looked no further beside what moves."""
    path = tmp_path / "weights.safetensors"
    save_network(network, path)
    tensors, metadata = read_tensors(path)
    settings = json.loads(metadata["settings"])
    del settings["beside_odds"]
    write_tensors(tensors, metadata | {"settings": json.dumps(settings)}, path)
    assert load_network(path).settings.beside_odds == 1.0


def test_a_network_of_another_kind_is_told_by_its_file(network: Network, tmp_path: Path) -> None:
    path = tmp_path / "weights.safetensors"
    save_network(network, path)
    tensors, metadata = read_tensors(path)
    settings = json.loads(metadata["settings"]) | {"tube": "corners"}
    write_tensors(tensors, metadata | {"settings": json.dumps(settings)}, path)
    with pytest.raises(InputError, match=r"weights.safetensors holds .* another version.*corners"):
        load_network(path)


def test_how_much_is_looked_at_may_be_another_s(network: Network, tmp_path: Path) -> None:
    path = tmp_path / "weights.safetensors"
    save_network(network, path)
    asked = replace(network.settings, pillar_points=5, ego_pillars=9, point_hidden=99)
    again = load_network(path, effort=asked).settings
    assert (again.pillar_points, again.ego_pillars) == (5, 9)
    assert again.point_hidden == network.settings.point_hidden


def test_the_same_weights_have_the_same_hash(network: Network, tmp_path: Path) -> None:
    one, two = tmp_path / "one.safetensors", tmp_path / "two.safetensors"
    save_network(network, one)
    save_network(network, two)
    assert weights_hash(one) == weights_hash(two)
    assert len(weights_hash(one)) == 64


def test_a_file_cut_short_is_refused(network: Network, tmp_path: Path) -> None:
    path = tmp_path / "weights.safetensors"
    save_network(network, path)
    path.write_bytes(path.read_bytes()[:-1000])
    with pytest.raises(InputError):
        load_network(path)


def test_what_is_no_network_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "other.safetensors"
    write_tensors({"a": torch.zeros(3)}, {}, path)
    with pytest.raises(InputError):
        load_network(path)
    with pytest.raises(MissingInputError):
        load_network(tmp_path / "none.safetensors")
