"""PCD files in every encoding, and the compression they use."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from inspect3d.files.cloud import read_cloud
from inspect3d.files.lzf import lzf_unpacked

POINTS = np.random.default_rng(7).normal(0, 10, size=(40, 3)).astype(np.float32).astype(np.float64)
NORMALS = POINTS / np.linalg.norm(POINTS, axis=1, keepdims=True)


@pytest.mark.parametrize("encoding", ["ascii", "binary", "binary_compressed"])
def test_a_pcd_comes_back(tmp_path: Path, encoding: str) -> None:
    header = "# .PCD v.7\nVERSION .7\nFIELDS X Y Z _ normal_x normal_y normal_z\nSIZE 4 4 4 1 8 8 8\n"
    header += "TYPE F F F U F F F\nCOUNT 1 1 1 4 1 1 1\n"
    header += f"WIDTH {len(POINTS)}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {len(POINTS)}\nDATA {encoding}\n"
    points = POINTS.astype("<f4")
    table = np.zeros(len(POINTS), [("p", "<f4", 3), ("pad", "u1", 4), ("n", "<f8", 3)])
    table["p"], table["n"] = points, NORMALS
    if encoding == "ascii":
        lines = np.hstack([POINTS, np.zeros((len(POINTS), 4)), NORMALS]).tolist()
        body = "".join(" ".join(map(repr, line)) + "\n" for line in lines).encode()
    elif encoding == "binary":
        body = table.tobytes()
    else:
        data = points.T.tobytes() + table["pad"].tobytes() + NORMALS.T.astype("<f8").tobytes()
        body = struct.pack("<II", len(packed(data)), len(data)) + packed(data)
    (tmp_path / "a.pcd").write_bytes(header.encode() + body)
    found = read_cloud(tmp_path / "a.pcd")
    np.testing.assert_array_equal(found.points, POINTS)
    np.testing.assert_allclose(found.normals, NORMALS, atol=1e-12)


def packed(data: bytes) -> bytes:
    """Return data in LZF: a run of one byte as a copy from one byte back, everything else as it is."""
    out, i = bytearray(), 0
    while i < len(data):
        run = 1
        while i + run < len(data) and data[i + run] == data[i] and run < 260:
            run += 1
        out += bytes([0, data[i]])
        if run > 3:
            length = run - 1 - 2
            out += bytes([length << 5, 0]) if length < 7 else bytes([7 << 5, length - 7, 0])
            i += run
        else:
            i += 1
    return bytes(out)


@given(st.lists(st.tuples(st.integers(0, 255), st.integers(1, 600)), max_size=8))
def test_lzf_unpacks_what_was_packed(runs: list[tuple[int, int]]) -> None:
    data = b"".join(bytes([value]) * count for value, count in runs)
    assert lzf_unpacked(packed(data), len(data)) == data


@given(st.binary(max_size=60), st.integers(0, 300))
def test_lzf_refuses_what_is_damaged(data: bytes, size: int) -> None:
    unpacked = lzf_unpacked(data, size)
    assert unpacked is None or len(unpacked) == size
