"""Lights of KHR_lights_punctual as small lamps of the same candelas, lumens or lux.

A point light becomes a ball, a spot light a square that shines by the power of a cosine that is nearest to
its cone, a directional light a square far away. Channels are converted each by itself: a white light
of I cd emits I / efficacy W/sr.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from solver.document.fields import Location
from solver.formats.beams import fit_beam
from solver.formats.building import SceneBuilder
from solver.formats.gltf.models import Light
from solver.formats.lamps import (
    BULB,
    SUN_ANGLE,
    SUN_DISTANCE,
    area_of,
    icosahedron,
    lamp,
    lamp_radius,
    quadrilateral,
)
from solver.types import FloatArray, Vector

_ANGLES: Final = np.linspace(0.0, 0.5 * math.pi, 2001)


def add_light(builder: SceneBuilder, light: Light, name: str, node: FloatArray, where: Location) -> None:
    """Add the lamp of `light` at a node of that world matrix (4, 4). Raises LimitExceededError."""
    tint = np.array(light.color)
    if light.intensity == 0.0 or not tint.any():
        return
    scale = builder.options.scale
    position = node[:3, 3] * scale
    # A light shines along its node's -z.
    axis = -node[:3, 2]
    length = float(np.linalg.norm(axis))
    axis = axis / length if length > 0.0 else np.array([0.0, 0.0, -1.0])
    title = name or light.name or light.type
    intensity = light.intensity / builder.efficacy * tint
    if light.range is not None:
        builder.warn("`range` of a light is left out: light goes on for ever")
    radius = lamp_radius(builder)
    match light.type:
        case "point":
            vertices, faces = icosahedron(position, radius)
            emission = 4.0 * math.pi * intensity / area_of(vertices, faces)
            exponent = 0.0
            builder.warn(f"point lights are balls of their lumens, {_size(radius)} in radius")
        case "spot":
            beam = fit_beam(_ANGLES, light.intensity * _cone(light))
            if beam is None:
                return
            vertices, faces = quadrilateral(position, axis, 2.0 * radius, 2.0 * radius)
            emission = beam.lumens / builder.efficacy * tint / area_of(vertices, faces)
            exponent = beam.exponent
            builder.warn(
                f"the spot light {title[:80]!r} is a square of its {beam.lumens:.4g} lm with the "
                f"emission exponent {beam.exponent:.3g}, which errs by {beam.error:.1%} (RMS)"
            )
        case "directional":
            vertices, faces, emission = _sun(builder, axis, intensity)
            exponent = 0.0
            builder.warn(
                f"directional lights are squares far away, right at the middle of the scene and within "
                f"{1.0 / (SUN_DISTANCE - 0.5) ** 2 * SUN_DISTANCE**2 - 1.0:.0%} at its ends"
            )
    builder.add(title, vertices / scale, faces, lamp(emission, exponent), where, is_lamp=True)


def _sun(
    builder: SceneBuilder, axis: Vector, lux: FloatArray
) -> tuple[FloatArray, list[list[int]], FloatArray]:
    """A square that gives the irradiance `lux` (3,) W/m2 to what faces it in the middle of the scene."""
    distance = SUN_DISTANCE * builder.size
    side = math.sqrt(math.pi) * distance * math.tan(SUN_ANGLE)
    vertices, faces = quadrilateral(builder.middle - distance * axis, axis, side, side)
    return vertices, faces, lux * math.pi * distance**2 / side**2


def _cone(light: Light) -> FloatArray:
    """(n,) of the intensity that goes at each angle, as the extension recommends."""
    inner, outer = math.cos(light.spot.innerConeAngle), math.cos(light.spot.outerConeAngle)
    edge = (np.cos(_ANGLES) - outer) / max(1e-3, inner - outer)
    return np.asarray(edge.clip(0.0, 1.0) ** 2)


def _size(radius: float) -> str:
    return f"{radius:.3g} m" if radius != BULB else f"{100 * BULB:g} cm"
