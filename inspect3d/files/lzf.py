"""LZF, the compression of PCD files."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def lzf_unpacked(packed: bytes, size: int) -> bytes | None:
    """Return the `size` bytes that LZF packed; None where the data are damaged.

    Notes
    -----
    The format of M. A. Lehmann's liblzf: a control byte below 32 announces that many bytes and one to copy; else its
    upper three bits are a length, 7 going on in the next byte, and the lower five with the next byte a distance back.
    """
    from numba import njit

    out = np.zeros(size, dtype=np.uint8)
    filled = njit(cache=True)(unpack)(np.frombuffer(packed, dtype=np.uint8), out)
    return out.tobytes() if filled == size else None


def unpack(packed: NDArray[np.uint8], out: NDArray[np.uint8]) -> int:
    """Fill `out` and return the bytes filled; -1 where the data are damaged."""
    read, filled = 0, 0
    while read < len(packed):
        control = int(packed[read])
        read += 1
        if control < 32:
            length = control + 1
            if read + length > len(packed) or filled + length > len(out):
                return -1
            out[filled : filled + length] = packed[read : read + length]
            read += length
            filled += length
            continue
        length = control >> 5
        if length == 7:
            if read >= len(packed):
                return -1
            length += int(packed[read])
            read += 1
        if read >= len(packed):
            return -1
        start = filled - ((control & 31) << 8) - int(packed[read]) - 1
        read += 1
        length += 2
        if start < 0 or filled + length > len(out):
            return -1
        for i in range(length):
            out[filled + i] = out[start + i]
        filled += length
    return filled
