"""Photographs are read as they are stored, or refused with a sentence."""

from __future__ import annotations

import struct
import zlib

import cv2
import numpy as np
import pytest
from PIL import Image

from inspect3d.files.photograph import read_mask, read_photograph
from inspect3d.outcome import InputError


def scene(kind=np.uint8, channels=()):
    """Return a random picture of a type."""
    return np.random.default_rng(0).integers(0, np.iinfo(kind).max, (48, 64, *channels), dtype=kind)


@pytest.mark.parametrize("suffix", ["png", "tif"])
@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_grey_levels_come_back_unchanged(tmp_path, suffix, kind):
    path, grey = tmp_path / f"a.{suffix}", scene(kind)
    cv2.imwrite(str(path), grey)
    photograph = read_photograph(path)
    np.testing.assert_array_equal(photograph.grey, grey)
    assert photograph.white == np.iinfo(kind).max
    assert photograph.size == (64, 48)


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_colours_become_luminance_and_alpha_counts_for_nothing(tmp_path, kind):
    blue, green, red, alpha = np.moveaxis(scene(kind, (4,)), 2, 0)
    cv2.imwrite(str(tmp_path / "a.png"), np.stack([blue, green, red, alpha], axis=2))
    cv2.imwrite(str(tmp_path / "b.png"), np.stack([blue, green, red], axis=2))
    with_alpha, without = (read_photograph(tmp_path / name).grey for name in ("a.png", "b.png"))
    np.testing.assert_array_equal(with_alpha, without)
    np.testing.assert_allclose(without, 0.114 * blue + 0.587 * green + 0.299 * red)


def test_a_grey_picture_saved_as_colours_is_the_same(tmp_path):
    grey = scene()
    cv2.imwrite(str(tmp_path / "a.png"), np.repeat(grey[:, :, None], 3, axis=2))
    np.testing.assert_allclose(read_photograph(tmp_path / "a.png").grey, grey, atol=1e-9)


@pytest.mark.parametrize(
    ("tags", "focal"),
    [
        ({0x920A: 50.0, 0xA20E: 2000.0, 0xA210: 3}, 50 * 200.0),
        ({0x920A: 50.0, 0xA20E: 5080.0, 0xA210: 2}, 50 * 200.0),
        ({0xA405: 72}, 2 * 64),
        ({0x920A: 50.0}, None),
        ({}, None),
    ],
)
def test_the_focal_length_is_that_of_the_exif_data(tmp_path, tags, focal):
    exif = Image.Exif()
    exif.get_ifd(0x8769).update(tags)
    Image.fromarray(scene()).save(tmp_path / "a.jpg", exif=exif, quality=95)
    found = read_photograph(tmp_path / "a.jpg").focal
    assert found == (pytest.approx(focal) if focal else None)


@pytest.mark.parametrize("tags", [{0x920A: (50, 1), 0xA405: 0}, {0x920A: (50, 0), 0xA20E: (1, 0)}, {0xA405: b"long"}])
def test_exif_data_that_are_no_numbers_tell_no_focal_length(tmp_path, tags):
    exif = Image.Exif()
    exif.get_ifd(0x8769).update(tags)
    Image.fromarray(scene()).save(tmp_path / "a.jpg", exif=exif, quality=95)
    assert read_photograph(tmp_path / "a.jpg").focal is None


def test_a_picture_whose_header_names_more_pixels_than_any_camera_has_is_refused(tmp_path):
    head = struct.pack(">IIBBBBB", 60_000, 60_000, 8, 0, 0, 0, 0)
    content = b"\x89PNG\r\n\x1a\n"
    for kind, data in ((b"IHDR", head), (b"IDAT", zlib.compress(b"\0" * 1000)), (b"IEND", b"")):
        content += struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    (tmp_path / "a.png").write_bytes(content)
    with pytest.raises(InputError, match=r"a\.png cannot be read as a picture"):
        read_photograph(tmp_path / "a.png")


def test_a_turn_in_the_exif_data_is_told_and_not_made(tmp_path):
    exif = Image.Exif()
    exif[0x0112] = 6
    Image.fromarray(scene()).save(tmp_path / "a.jpg", exif=exif, quality=95)
    photograph = read_photograph(tmp_path / "a.jpg")
    assert photograph.turned
    assert photograph.size == (64, 48)


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (np.full((48, 64), 7, np.uint8), "is blank: all its pixels have the grey level 7"),
        (np.where(np.arange(48 * 64).reshape(48, 64) % 3 == 0, 3, 255).astype(np.uint8), "is overexposed: 67 %"),
        (scene()[:8, :8], "that is no photograph of a part"),
    ],
)
def test_pictures_that_show_nothing_are_refused(tmp_path, content, says):
    cv2.imwrite(str(tmp_path / "a.png"), content)
    with pytest.raises(InputError, match=says):
        read_photograph(tmp_path / "a.png")


@pytest.mark.parametrize("content", [b"", b"no picture", b"\x89PNG\r\n\x1a\n"])
def test_what_is_no_picture_is_refused(tmp_path, content):
    (tmp_path / "a.png").write_bytes(content)
    with pytest.raises(InputError, match="cannot be read as a picture: it must be PNG, TIFF or JPEG, and whole"):
        read_photograph(tmp_path / "a.png")


def test_floating_point_pixels_are_refused(tmp_path):
    cv2.imwrite(str(tmp_path / "a.tif"), scene().astype(np.float32))
    with pytest.raises(InputError, match="8 or 16 bits"):
        read_photograph(tmp_path / "a.tif")


def test_a_mask_is_true_where_it_is_not_black(tmp_path):
    mask = np.zeros((48, 64), np.uint8)
    mask[10:20, 5:9] = 1
    cv2.imwrite(str(tmp_path / "m.png"), mask)
    np.testing.assert_array_equal(read_mask(tmp_path / "m.png", (64, 48)), mask > 0)
    with pytest.raises(InputError, match="has 64 x 48 pixels, its picture 60 x 48"):
        read_mask(tmp_path / "m.png", (60, 48))
    cv2.imwrite(str(tmp_path / "m.png"), 0 * mask)
    with pytest.raises(InputError, match="black all over"):
        read_mask(tmp_path / "m.png", (64, 48))
