"""Pictures and linear frames as the bytes of image files, by the formats' own libraries."""

from __future__ import annotations

import io
import tempfile
from enum import StrEnum
from pathlib import Path
from typing import Final

import numpy as np
import OpenEXR
import OpenImageIO
from PIL import Image

from solver.errors import SolverError
from solver.types import AnyArray, ByteArray, Float32Array

_QUALITY: Final = 92
"""Of lossy pictures, out of 100"""

_EXACT: Final = 1 << 24
"""Integers up to this are exact in float32."""


class PictureFormat(StrEnum):
    """Files of sRGB pictures."""

    PNG = "png"
    JPEG = "jpeg"
    WEBP = "webp"


class LinearFormat(StrEnum):
    """Files of linear frames."""

    EXR = "exr"
    """OpenEXR, float32, without loss"""
    HDR = "hdr"
    """Radiance RGBE: 1 % a channel, finite and not negative"""
    NPY = "npy"
    """numpy, as it is"""


class EncodingError(SolverError):
    """A format cannot hold an image."""

    def __init__(self, format: LinearFormat, reason: str) -> None:
        self.format = format
        self.reason = reason
        super().__init__(f"{format}: {reason}")


def encode_picture(pixels: ByteArray, format: PictureFormat) -> bytes:
    """The file of an sRGB picture, uint8 (h, w, 3), or grey (h, w)."""
    picture = Image.fromarray(np.ascontiguousarray(pixels))
    file = io.BytesIO()
    match format:
        case PictureFormat.PNG:
            # The lowest level takes a third of the default's time and a tenth more bytes.
            picture.save(file, "PNG", compress_level=1)
        case PictureFormat.JPEG:
            picture.save(file, "JPEG", quality=_QUALITY, subsampling=0)
        case PictureFormat.WEBP:
            picture.save(file, "WEBP", quality=_QUALITY, method=0)
    return file.getvalue()


def encode_linear(image: AnyArray, format: LinearFormat) -> bytes:
    """The file of a linear frame, (h, w, 3) or (h, w), top row first.

    npy keeps float32 and int32 as they are. exr has float32 channels R, G, B, or Y; hdr repeats a single
    channel. Raises EncodingError where the format cannot hold a number of the image.
    """
    match format:
        case LinearFormat.NPY:
            return _encode_npy(image)
        case LinearFormat.EXR:
            return _encode_exr(_as_float32(image, format))
        case LinearFormat.HDR:
            return _encode_hdr(_as_float32(image, format))


def _as_float32(image: AnyArray, format: LinearFormat) -> Float32Array:
    if np.issubdtype(image.dtype, np.integer) and np.abs(image).max(initial=0) > _EXACT:
        raise EncodingError(format, f"holds no numbers above {_EXACT} exactly: take npy")
    return np.ascontiguousarray(image, dtype=np.float32)


def _encode_npy(image: AnyArray) -> bytes:
    kept = image.astype(np.float32) if image.dtype == np.float64 else image
    file = io.BytesIO()
    np.save(file, np.ascontiguousarray(kept), allow_pickle=False)
    return file.getvalue()


def _encode_exr(image: Float32Array) -> bytes:
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    file = io.BytesIO()
    OpenEXR.File(header, {"RGB" if image.ndim == 3 else "Y": image}).write(file)
    return file.getvalue()


def _encode_hdr(image: Float32Array) -> bytes:
    if not np.all(np.isfinite(image)) or np.any(image < 0.0):
        raise EncodingError(LinearFormat.HDR, "holds finite numbers from 0 up only: take exr or npy")
    pixels = image if image.ndim == 3 else np.repeat(image[:, :, None], 3, axis=2)
    height, width = pixels.shape[:2]
    with tempfile.TemporaryDirectory() as folder:
        # The library writes to paths only.
        path = Path(folder, "frame.hdr")
        output = OpenImageIO.ImageOutput.create(str(path))
        if output is None:
            raise EncodingError(LinearFormat.HDR, OpenImageIO.geterror())
        specification = OpenImageIO.ImageSpec(width, height, 3, OpenImageIO.FLOAT)
        written = output.open(str(path), specification) and output.write_image(pixels) and output.close()
        if not written:
            raise EncodingError(LinearFormat.HDR, output.geterror())
        return path.read_bytes()
