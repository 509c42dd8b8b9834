"""Files read back by the libraries that the rest of the world reads them with."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import OpenEXR
import OpenImageIO
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from solver.rendering.encoding import (
    EncodingError,
    LinearFormat,
    PictureFormat,
    encode_linear,
    encode_picture,
)
from solver.types import AnyArray, ByteArray, Float32Array


def smooth_picture(height: int = 48, width: int = 64) -> ByteArray:
    y, x = np.mgrid[0:height, 0:width]
    return np.stack([x * 3 % 256, y * 5 % 256, (x + y) * 2 % 256], axis=-1).astype(np.uint8)


def frame(seed: int = 0, shape: tuple[int, ...] = (31, 47, 3)) -> Float32Array:
    return np.exp(np.random.default_rng(seed).normal(0.0, 3.0, shape)).astype(np.float32)


def read_exr(data: bytes) -> dict[str, AnyArray]:
    parts = OpenEXR.File(io.BytesIO(data), separate_channels=True).channels()
    return {name: channel.pixels for name, channel in parts.items()}


@given(height=st.integers(1, 40), width=st.integers(1, 40), seed=st.integers(0, 100))
@settings(max_examples=20)
def test_png_loses_nothing(height: int, width: int, seed: int) -> None:
    pixels = np.random.default_rng(seed).integers(0, 256, (height, width, 3), dtype=np.uint8)
    read = Image.open(io.BytesIO(encode_picture(pixels, PictureFormat.PNG)))
    assert read.format == "PNG"
    np.testing.assert_array_equal(np.asarray(read), pixels)


@pytest.mark.parametrize("format", [PictureFormat.JPEG, PictureFormat.WEBP])
def test_lossy_pictures_lose_little(format: PictureFormat) -> None:
    y, x = np.mgrid[0:48, 0:64]
    pixels = np.stack([x * 3, y * 4, 255 - x - y], axis=-1).astype(np.uint8)
    read = Image.open(io.BytesIO(encode_picture(pixels, format)))
    assert read.format == format.upper()
    off = np.asarray(read.convert("RGB")).astype(float) - pixels
    assert np.sqrt(np.mean(off**2)) < 3.0


@pytest.mark.parametrize("format", PictureFormat)
def test_grey_pictures(format: PictureFormat) -> None:
    pixels = np.arange(64 * 48, dtype=np.uint16).reshape(48, 64).astype(np.uint8) // 2 + 60
    read = np.asarray(Image.open(io.BytesIO(encode_picture(pixels, format))).convert("L"))
    assert read.shape == pixels.shape
    if format is PictureFormat.PNG:
        np.testing.assert_array_equal(read, pixels)


def test_pictures_have_their_top_row_first() -> None:
    pixels = smooth_picture()
    pixels[:8] = 0
    pixels[8:] = 255
    for format in PictureFormat:
        read = np.asarray(Image.open(io.BytesIO(encode_picture(pixels, format))).convert("L"))
        assert read[2].max() < 20
        assert read[-2].min() > 235


def test_exr_loses_nothing() -> None:
    image = frame()
    image[0, 0], image[1, 1] = np.inf, np.nan
    read = read_exr(encode_linear(image, LinearFormat.EXR))
    assert set(read) == {"R", "G", "B"}
    for index, name in enumerate("RGB"):
        assert read[name].dtype == np.float32
        np.testing.assert_array_equal(read[name], image[:, :, index])


def test_exr_of_one_channel() -> None:
    image = frame(1, (20, 30))
    np.testing.assert_array_equal(read_exr(encode_linear(image, LinearFormat.EXR))["Y"], image)


@given(seed=st.integers(0, 1000))
@settings(max_examples=10)
def test_npy_is_the_array(seed: int) -> None:
    image = frame(seed)
    read = np.load(io.BytesIO(encode_linear(image, LinearFormat.NPY)), allow_pickle=False)
    assert read.dtype == np.float32
    np.testing.assert_array_equal(read, image)


def test_npy_of_a_view_is_row_major_and_ids_keep_their_type() -> None:
    ids = np.arange(-1, 29, dtype=np.int32).reshape(5, 6)[::-1]
    read = np.load(io.BytesIO(encode_linear(ids, LinearFormat.NPY)))
    assert read.dtype == np.int32
    np.testing.assert_array_equal(read, ids)
    doubles = frame().astype(np.float64)
    assert np.load(io.BytesIO(encode_linear(doubles, LinearFormat.NPY))).dtype == np.float32


@pytest.mark.parametrize("shape", [(31, 47, 3), (16, 8), (1, 1, 3), (2, 9000, 3)])
def test_hdr_keeps_a_hundredth_of_the_brightest_channel(shape: tuple[int, ...], tmp_path: Path) -> None:
    image = frame(2, shape)
    path = tmp_path / "frame.hdr"
    path.write_bytes(encode_linear(image, LinearFormat.HDR))
    read = OpenImageIO.ImageBuf(str(path)).get_pixels(OpenImageIO.FLOAT)
    assert read is not None
    expected = image if image.ndim == 3 else np.repeat(image[:, :, None], 3, axis=2)
    off = np.abs(read - expected).max(axis=-1) / expected.max(axis=-1)
    assert path.read_bytes().startswith(b"#?RADIANCE")
    assert off.max() < 0.01


@pytest.mark.parametrize("value", [np.nan, np.inf, -1.0])
def test_hdr_refuses_what_it_cannot_hold(value: float) -> None:
    image = frame()
    image[3, 4, 1] = value
    with pytest.raises(EncodingError, match="take exr or npy"):
        encode_linear(image, LinearFormat.HDR)


def test_exr_refuses_ids_that_it_cannot_hold() -> None:
    with pytest.raises(EncodingError, match="take npy"):
        encode_linear(np.array([[1 << 25]], dtype=np.int32), LinearFormat.EXR)
