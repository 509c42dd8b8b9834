"""Lightmaps as files: linear numbers, a picture, or the scene with the picture on it."""

from __future__ import annotations

from enum import StrEnum
from typing import Final

import numpy as np

from solver.engine.lightmaps.bake import Lightmap
from solver.engine.overlays.lit_scene import LIGHTMAP_SET, lit_scene_glb
from solver.rendering.encoding import LinearFormat, PictureFormat, encode_linear, encode_picture
from solver.rendering.tone_mapping import encode_srgb

_WHITE_SHARE: Final = 0.999
"""Share of the texels that are not brighter than white, where white is not given."""


class LightmapFormat(StrEnum):
    """The files that a lightmap can be had as."""

    GLB = "glb"
    """The scene, with the picture as a texture"""
    EXR = "exr"
    """Irradiance in W/m2, float32"""
    PNG = "png"
    """sRGB, of irradiance over that of white"""


def white_of(lightmap: Lightmap) -> float:
    """Irradiance W/m2 that a picture shows white: nearly the largest of any channel; 1 where all is dark."""
    flat = lightmap.irradiance.reshape(-1, 3)[lightmap.texels.pixel]
    brightest = float(np.quantile(flat.max(axis=1), _WHITE_SHARE)) if len(flat) else 0.0
    return brightest if brightest > 0.0 else 1.0


def encode_lightmap(lightmap: Lightmap, chosen: LightmapFormat, white: float) -> bytes:
    """The file. In pictures `white` W/m2 are white, and more is cut off; EXR holds all as it is."""
    if chosen is LightmapFormat.EXR:
        return encode_linear(lightmap.irradiance, LinearFormat.EXR)
    scaled = lightmap.irradiance * np.float32(1.0 / white)
    picture = encode_picture(encode_srgb(scaled), PictureFormat.PNG)
    if chosen is LightmapFormat.PNG:
        return picture
    world, atlas = lightmap.world, lightmap.atlas
    facts = {
        "revision": lightmap.revision,
        "lightmap": {
            "texcoord": LIGHTMAP_SET,
            "width": atlas.width,
            "height": atlas.height,
            "texels_per_metre": atlas.density,
            "white_irradiance": white,
            "source": lightmap.source.value,
            "method": lightmap.method,
            "error_estimate": lightmap.error_estimate,
            "converged": lightmap.converged,
        },
        "luminous_efficacy": world.scene.luminous_efficacy,
        "units": {
            "length": "m",
            "axes": "those of the scene",
            "irradiance": "W/m2 = texture, linear, times white",
        },
    }
    name = world.scene.name or "scene"
    return lit_scene_glb(world.surfaces, atlas, picture, white, name, facts)
