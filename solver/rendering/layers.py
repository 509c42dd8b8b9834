"""The layers of a frame, and how those that are not radiance are shown as pictures."""

from __future__ import annotations

from enum import StrEnum
from typing import Final

import numpy as np

from solver.rendering.false_colour import scale_maximum
from solver.rendering.tone_mapping import ToneCurve, encode_srgb, tone_map
from solver.types import AnyArray, ByteArray, Float32Array, FloatArray

_HASH: Final = np.array([0x9E3779B1, 0x85EBCA77, 0xC2B2AE3D], dtype=np.uint64)
"""Odd numbers of 32 bits without a pattern: multiplicative hashing."""

_DARKEST: Final = 40
"""Hashed colours stay away from black, which is nothing."""


class Layer(StrEnum):
    """What a frame shows."""

    RADIANCE = "radiance"
    """W/(m2 sr)"""
    IRRADIANCE = "irradiance"
    """W/m2"""
    ILLUMINANCE = "illuminance"
    """Luminance of the irradiance, W/m2; times the scene's luminous efficacy it is lux"""
    DEPTH = "depth"
    """Metres along the viewing direction"""
    POSITION = "position"
    """World coordinates, metres"""
    NORMAL = "normal"
    """Unit, of the front of what is seen"""
    OBJECT = "object"
    """Index into `surfaces.object_ids`"""
    ELEMENT = "element"
    """Index of the leaf"""
    TRIANGLE = "triangle"
    """Index of the mesh's triangle"""
    BARYCENTRIC = "barycentric"
    """Weights of the triangle's three corners"""
    ERROR = "error"
    """Estimated RMS error of the luminance of the irradiance over the triangle, W/m2"""
    FALSE_COLOUR = "false_colour"
    """Illuminance as sRGB colours in 0..1, by `false_colour`"""


def picture_of(image: AnyArray, layer: Layer) -> ByteArray:
    """`image`, a frame of `layer`, as an sRGB picture, uint8 (h, w, 3).

    - radiance, irradiance: tone-mapped, automatic exposure, linear curve;
    - illuminance, error: grey, white at the 99.5th percentile of what is more than 0;
    - depth: grey, white at the nearest, dark at the farthest, black where nothing is seen;
    - position: red, green, blue over the extent of x, y, z in view, black where nothing is seen;
    - normal: (n + 1) / 2, black where nothing is seen;
    - object, element, triangle: a colour for each number, black where nothing is seen;
    - barycentric: red, green, blue for the three corners, black where nothing is seen;
    - false_colour: as it is.

    Depth, position, normal and barycentric are data, not light: they are not sRGB-encoded.
    """
    match layer:
        case Layer.RADIANCE | Layer.IRRADIANCE:
            return tone_map(image, None, ToneCurve.LINEAR)
        case Layer.ILLUMINANCE | Layer.ERROR:
            return _grey(_scaled_light(image))
        case Layer.DEPTH:
            return _grey(_scaled_depth(image))
        case Layer.POSITION:
            return _scaled_positions(image)
        case Layer.NORMAL:
            seen = np.any(image != 0.0, axis=-1, keepdims=True)
            return _bytes(np.where(seen, (image + 1.0) / 2.0, 0.0))
        case Layer.OBJECT | Layer.ELEMENT | Layer.TRIANGLE:
            return _hashed_colours(image)
        case Layer.BARYCENTRIC | Layer.FALSE_COLOUR:
            return _bytes(image)


def _grey(values: ByteArray) -> ByteArray:
    return np.repeat(values[:, :, None], 3, axis=2)


def _bytes(values: FloatArray) -> ByteArray:
    return np.asarray(np.rint(255.0 * np.clip(values, 0.0, 1.0)), dtype=np.uint8)


def _scaled_light(light: Float32Array) -> ByteArray:
    return encode_srgb(light / np.float32(scale_maximum(light)))


def _scaled_depth(depth: Float32Array) -> ByteArray:
    seen = np.isfinite(depth)
    if not seen.any():
        return np.zeros(depth.shape, dtype=np.uint8)
    near, far = float(depth[seen].min()), float(depth[seen].max())
    nearness = (far - np.where(seen, depth, far)) / ((far - near) or 1.0)
    # The farthest that is seen is not yet black.
    return _bytes(np.where(seen, 0.1 + 0.9 * nearness, 0.0))


def _scaled_positions(position: Float32Array) -> ByteArray:
    seen = np.all(np.isfinite(position), axis=-1)
    if not seen.any():
        return np.zeros(position.shape, dtype=np.uint8)
    low, high = position[seen].min(axis=0), position[seen].max(axis=0)
    extent = np.where(high > low, high - low, 1.0)
    return _bytes(np.where(seen[:, :, None], (np.where(seen[:, :, None], position, low) - low) / extent, 0.0))


def _hashed_colours(numbers: AnyArray) -> ByteArray:
    mixed = (numbers[:, :, None].astype(np.int64) + 1).astype(np.uint64)
    for shift in (15, 13, 16):
        mixed = (mixed * _HASH) & np.uint64(0xFFFFFFFF)
        mixed ^= mixed >> np.uint64(shift)
    spread = _DARKEST + (mixed & np.uint64(255)) * np.uint64(255 - _DARKEST) // np.uint64(255)
    return np.where(numbers[:, :, None] >= 0, spread, 0).astype(np.uint8)
