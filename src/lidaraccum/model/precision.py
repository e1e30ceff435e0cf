"""Which arithmetic a device does fast: bfloat16 where it has units for it, else float32."""

from __future__ import annotations

from contextlib import AbstractContextManager
from functools import cache
from pathlib import Path

import torch

_BFLOAT16_FLAGS = ("avx512_bf16", "amx_bf16")
_BYTE_FLAGS = ("avx512_vnni", "avx_vnni")
_WIDE_FLAG = "avx512f"


def inference(device: torch.device | str = "cpu") -> AbstractContextManager[object]:
    """A context for the network's verbs on a device: bfloat16 where that is fast.

    Motions, matches and losses stay in float32 inside it.
    """
    device = torch.device(device)
    return torch.autocast(device.type, dtype=torch.bfloat16, enabled=has_bfloat16(device))


def has_bfloat16(device: torch.device | str) -> bool:
    """Whether the device multiplies bfloat16 faster than float32."""
    device = torch.device(device)
    if device.type == "cuda":
        return torch.cuda.get_device_capability(device)[0] >= 8
    return device.type == "cpu" and not _cpu_flags().isdisjoint(_BFLOAT16_FLAGS)


def has_byte_units() -> bool:
    """Whether the processor multiplies bytes faster than float32."""
    return not _cpu_flags().isdisjoint(_BYTE_FLAGS)


def has_wide_units() -> bool:
    """Whether the processor works on sixteen floats at once."""
    return _WIDE_FLAG in _cpu_flags()


@cache
def _cpu_flags() -> frozenset[str]:
    """What the processor says that it can do."""
    try:
        described = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace")
    except OSError:  # not Linux: nothing says so
        return frozenset()
    flags = next((line for line in described.splitlines() if line.startswith("flags")), "")
    return frozenset(flags.split())
