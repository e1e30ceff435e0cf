"""From parsed options to the settings that the library's own functions take."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from lidaraccum.errors import SettingsError

if TYPE_CHECKING:
    from lidaraccum.io.sequences import FileSequence
    from lidaraccum.pipeline.accumulator import AccumulateSettings

# Options that decide neither what is read nor what comes out.
TALK = {
    "config", "as_json", "no_progress", "quiet", "verbose", "traceback", "dry_run", "overwrite",
    "processes",
}  # fmt: skip


def open_source(params: Mapping[str, Any]) -> FileSequence:
    """The sequence that the SEQ arguments and the input options name."""
    from lidaraccum.cli.options import chosen_source
    from lidaraccum.io.sequences import open_sequence
    from lidaraccum.io.settings import InputSettings

    settings = InputSettings(
        rate_hz=params["rate"],
        bin_fields=tuple(
            name.strip() for name in (params["bin_fields"] or "").split(",") if name.strip()
        ),
        split_by=params["split_by"],
        poses=params["poses"] or "",
        frames=params["frames"] or "",
        format=params["format_"],
    )
    return open_sequence(chosen_source(params["sequence"]), settings)


def with_method(params: Mapping[str, Any]) -> dict[str, Any]:
    """The options with the method that they come to.

    Raises:
        SettingsError: They ask for the network and for none.
    """
    from lidaraccum.pipeline.accumulator import default_method

    method = params["method"]
    if params["no_network"]:
        if params["weights"] or method == "network":
            raise SettingsError("--no-network takes no weights and no method network")
        method = method or "label-free"
    return {**params, "method": method or default_method(params["weights"])}


def accumulate_settings(params: Mapping[str, Any]) -> AccumulateSettings:
    """What decides how the cloud looks."""
    from lidaraccum.pipeline.accumulator import AccumulateSettings
    from lidaraccum.pipeline.selection import SelectionSettings
    from lidaraccum.registration.settings import RegistrationSettings

    if params["poses_mode"] == "refine" and not params["poses"]:
        raise SettingsError("--poses-mode refine needs --poses", hint="auto for those found")
    return AccumulateSettings(
        method=params["method"],
        weights=params["weights"],
        preset=params["preset"],
        reference=params["reference"],
        registration=RegistrationSettings(deskew=params["deskew"], poses_mode=params["poses_mode"]),
        selection=SelectionSettings(
            voxel_m=params["voxel"],
            crop_m=params["crop"] or (),
            min_range_m=params["min_range"],
            max_range_m=params["max_range"],
            drop_dynamic=params["drop_dynamic"],
        ),
    )


def chosen_processes(params: Mapping[str, Any], frames: int) -> int:
    """As many processes as asked for, or as pay for so many frames.

    Finding movers keeps one core busy, with the network nearly two.
    """
    from lidaraccum.registration.apart import is_worthwhile

    asked: int | None = params["processes"]
    busy = 2 if params["method"] == "network" else 1
    return asked or (2 if is_worthwhile(frames, busy) else 1)


def reported(params: Mapping[str, Any]) -> dict[str, Any]:
    """The settings for a report: plain values by option name, without those of mere talk."""
    return {
        name.rstrip("_").replace("_", "-"): _plain(value)
        for name, value in params.items()
        if name not in TALK
    }


def _plain(value: Any) -> Any:
    if isinstance(value, tuple):
        return [_plain(part) for part in value]
    return value if isinstance(value, (bool, int, float, str, type(None))) else str(value)
