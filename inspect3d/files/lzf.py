"""LZF, the compression of PCD files."""

from __future__ import annotations


def lzf_unpacked(packed: bytes, size: int) -> bytes | None:
    """Return the `size` bytes that LZF packed; None where the data are damaged.

    Notes
    -----
    The format of M. A. Lehmann's liblzf: a control byte below 32 announces that many bytes and one to copy; else its
    upper three bits are a length, 7 going on in the next byte, and the lower five with the next byte a distance back.
    """
    out = bytearray()
    read = 0
    try:
        while read < len(packed) and len(out) <= size:
            control = packed[read]
            read += 1
            if control < 32:
                out += packed[read : read + control + 1]
                read += control + 1
                continue
            length = (control >> 5) + 2
            if length == 9:
                length += packed[read]
                read += 1
            distance = ((control & 31) << 8) + packed[read] + 1
            read += 1
            if distance > len(out):
                return None
            start = len(out) - distance
            piece = out[start : start + length]
            out += (piece * (length // distance + 1))[:length] if distance < length else piece
    except IndexError:
        return None
    return bytes(out) if len(out) == size else None
