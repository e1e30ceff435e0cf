"""Weights in one file that rebuilds its network by itself: safetensors, nothing is unpickled."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import asdict, fields
from pathlib import Path

import safetensors
import torch
from safetensors.torch import save

from lidaraccum.errors import InputError, MissingInputError, SettingsError
from lidaraccum.model.network import Network
from lidaraccum.model.settings import NetworkSettings
from lidaraccum.model.unet import channels_last

FORMAT = "lidaraccum-network-1"
_SETTINGS = "settings"
_METADATA = "lidaraccum"
_UNSAID = {"beside_odds": 1.0}
"""How a network was made whose file does not say so: it is older than the setting."""


def save_network(network: Network, path: Path, notes: Mapping[str, str] | None = None) -> None:
    """Write weights and settings; whole or not at all.

    Args:
        network: Whose parameters to keep.
        path: A ``.safetensors`` file; replaced when it exists.
        notes: Words to keep beside (steps trained, say); keys must not be ``format``, ``settings``.
    """
    metadata = {
        **(notes or {}),
        "format": FORMAT,
        _SETTINGS: json.dumps(asdict(network.settings)),
    }
    write_tensors(dict(network.state_dict()), metadata, path)


def load_network(path: Path, effort: NetworkSettings | None = None) -> Network:
    """The network a file holds, on the CPU, ready to answer.

    Args:
        path: The file.
        effort: Whose `model.settings.EFFORT` to take instead of the file's own.

    Raises:
        MissingInputError: There is no such file.
        InputError: The file is not one of ours, or its tensors do not fit its settings.
    """
    tensors, metadata = read_tensors(path)
    if metadata.get("format") != FORMAT:
        raise InputError(f"{path} holds no weights of this network")
    settings = _settings(metadata[_SETTINGS], path)
    network = Network(settings if effort is None else settings.with_effort(effort))
    try:
        network.load_state_dict(tensors)
    except RuntimeError as error:
        raise InputError(f"the weights in {path} do not fit their settings") from error
    channels_last(network)
    return network.eval()


def _settings(text: str, path: Path) -> NetworkSettings:
    values = json.loads(text)
    known = {field.name for field in fields(NetworkSettings)}
    if set(values) - known:
        unknown = ", ".join(sorted(set(values) - known))
        raise InputError(f"{path} was written by a newer version: {unknown} are unknown here")
    try:
        return NetworkSettings(**(_UNSAID | values))
    except SettingsError as error:
        raise InputError(f"{path} holds a network of another version: {error}") from error


def write_tensors(
    tensors: Mapping[str, torch.Tensor], metadata: Mapping[str, str], path: Path
) -> None:
    """Write named tensors beside the final name, flush to the disk, then rename."""
    dense = {name: tensor.detach().cpu().contiguous() for name, tensor in tensors.items()}
    beside = path.with_name(f".{path.name}.part")
    with beside.open("wb") as file:
        # One entry: safetensors writes several in no fixed order, and the hash would not hold.
        file.write(save(dense, {_METADATA: json.dumps(metadata, sort_keys=True)}))
        file.flush()
        os.fsync(file.fileno())
    beside.replace(path)


def read_tensors(path: Path) -> tuple[dict[str, torch.Tensor], dict[str, str]]:
    """Named tensors and metadata of a safetensors file.

    Raises:
        MissingInputError: There is no such file.
        InputError: It is not a safetensors file, or is cut short.
    """
    if not path.is_file():
        raise MissingInputError(f"there is no file {path}")
    try:
        with safetensors.safe_open(str(path), framework="pt") as file:
            metadata = json.loads((file.metadata() or {}).get(_METADATA, "{}"))
            return {name: file.get_tensor(name) for name in file.keys()}, metadata  # noqa: SIM118
    except safetensors.SafetensorError as error:
        raise InputError(f"{path} is no whole safetensors file") from error
