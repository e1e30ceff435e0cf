"""LZF decompression, for PCD's ``binary_compressed``.

Source: the format as the LibLZF documentation describes it. Pure Python: float planes hardly
compress, so that nearly all of a file is literal runs of 32 bytes.
"""

from __future__ import annotations

LITERAL_LIMIT = 32
LONG_MATCH = 7


def decompress(packed: bytes, size: int) -> bytes:
    """Unpack to ``size`` bytes.

    Raises:
        ValueError: The bytes are no LZF stream of that size.
    """
    out = bytearray()
    place, end = 0, len(packed)
    try:
        while place < end:
            control = packed[place]
            place += 1
            if control < LITERAL_LIMIT:
                out += packed[place : place + control + 1]
                place += control + 1
                continue
            length = control >> 5
            if length == LONG_MATCH:
                length += packed[place]
                place += 1
            start = len(out) - ((control & 31) << 8) - packed[place] - 1
            place += 1
            copy_back(out, start, length + 2)
    except IndexError as error:
        raise ValueError("its compressed points end too early") from error
    if len(out) != size:
        raise ValueError(f"its compressed points unpack to {len(out)} bytes, not {size}")
    return bytes(out)


def copy_back(out: bytearray, start: int, length: int) -> None:
    """Append ``length`` bytes from ``start`` on, which may overlap with what is appended."""
    if start < 0:
        raise ValueError("its compressed points refer to before their beginning")
    have = len(out) - start
    if have >= length:
        out += out[start : start + length]
        return
    pattern = bytes(out[start:])
    out += (pattern * (length // have + 1))[:length]
