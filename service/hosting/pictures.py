"""Pictures for a stream: smaller or coarser while a camera moves, without loss where it rests, and false
colours on a scale in lux that is told.
"""

from __future__ import annotations

import io
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from PIL import Image

from solver.engine.engine import Engine
from solver.engine.requests import Encoding, FrameRequest, LayerName
from solver.rendering.encoding import LinearFormat, PictureFormat
from solver.rendering.false_colour import false_colour, scale_maximum
from solver.rendering.layers import Layer, picture_of
from solver.rendering.tone_mapping import tone_map
from solver.types import AnyArray, ByteArray


@dataclass(frozen=True)
class Presentation:
    """How a stream shows a frame."""

    scale: float = 1.0
    """Of its width and height"""
    quality: int | None = None
    """Of lossy pictures, out of 100; None: without loss where the format can, else as good as it gets"""
    scale_maximum: float | None = None
    """Lux at the end of the scale of false colours; None: as suits what is seen"""


@dataclass(frozen=True)
class Picture:
    """A frame as it is sent."""

    content: bytes
    scale_maximum: float | None = None
    """Lux at the end of the scale of false colours; None where the picture has none"""


_BEST: Final = 95
"""Quality of a JPEG that is to be looked at for long: above, it grows faster than it gets better."""


def presented(engine: Engine, frame: FrameRequest, presentation: Presentation) -> FrameRequest:
    """What is drawn for a frame that is shown so. Raises UnknownCameraError, SceneError."""
    if frame.layer is LayerName.FALSE_COLOUR:
        frame = replace(frame, layer=LayerName.ILLUMINANCE)
    if presentation.scale == 1.0:
        return frame
    full = frame.camera.resolve(engine.scene)
    width, height = (max(1, round(presentation.scale * side)) for side in (full.width, full.height))
    return replace(frame, camera=replace(frame.camera, width=width, height=height))


def picture(image: AnyArray, layer: LayerName, encoding: Encoding, presentation: Presentation) -> Picture:
    """The file of an image that was drawn for `presented`; `layer` is the one that was asked for.

    Raises ValueError where `encoding` is no format of pictures.
    """
    if isinstance(encoding.format, LinearFormat):
        raise ValueError(f"{encoding.format} is no format of pictures")
    if layer is LayerName.FALSE_COLOUR:
        end = scale_maximum(image, presentation.scale_maximum)
        pixels = picture_of(false_colour(image, end), Layer.FALSE_COLOUR)
        return Picture(_file(pixels, encoding.format, presentation.quality), end)
    if layer is LayerName.RADIANCE:
        pixels = tone_map(image, encoding.exposure, encoding.tone_map)
    else:
        pixels = picture_of(image, Layer(layer.value))
    return Picture(_file(pixels, encoding.format, presentation.quality))


def _file(pixels: ByteArray, format: PictureFormat, quality: int | None) -> bytes:
    shown = Image.fromarray(np.ascontiguousarray(pixels))
    file = io.BytesIO()
    match format:
        case PictureFormat.PNG:
            shown.save(file, "PNG", compress_level=1)
        case PictureFormat.JPEG if quality is None:
            shown.save(file, "JPEG", quality=_BEST, subsampling=0)
        case PictureFormat.JPEG:
            shown.save(file, "JPEG", quality=quality)
        case PictureFormat.WEBP:
            # Without loss, quality is the effort; method 0 is the fastest.
            shown.save(file, "WEBP", lossless=quality is None, quality=quality or 0, method=0)
    return file.getvalue()
