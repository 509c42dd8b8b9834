"""Virtual lights: points that light up a scene in the place of all emission and diffuse reflection."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from solver.types import FloatArray, Int64Array, IntArray, Points


@dataclass(frozen=True, eq=False)
class VirtualLights:
    """m point lights on surfaces; what they add up to is the estimate ([K eq. 2]).

    Positions are on their surfaces: who casts rays to them has to leave the surface first.
    """

    position: Points
    """(m, 3) metres"""
    normal: FloatArray
    """(m, 3) unit"""
    power: FloatArray
    """(m, 3) W, weights of the estimate included"""
    lobe: FloatArray
    """(m,) k of the radiant intensity power (k + 1) / (2 pi) cos^k of the angle to the normal: 1 is
    Lambert's, which gives an irradiance of power / pi cos cos' / r^2"""
    gloss: FloatArray
    """(m,) n of a glossy light, or -1: its intensity is power (n + 2) / (2 pi) cos^n(alpha) cos, alpha from
    the direction in which `incident` is mirrored; its lobe is 1, to take it for where that is too much"""
    incident: FloatArray
    """(m, 3) unit direction in which the light arrived that goes on from here; 0 on emitters"""
    patch: IntArray
    """(m,) patch that the light is on"""
    mirror: IntArray
    """(m,) patch in which the light is an image: it shines through that alone; -1 for lights proper"""
    generation: IntArray
    """(m,) diffuse or glossy reflections since the emitter"""
    path: Int64Array
    """(m,) index of the path"""
    paths: int
    """Number of paths whose lights add up to an estimate"""

    def __len__(self) -> int:
        return len(self.path)

    def take(self, rows: IntArray | Int64Array) -> VirtualLights:
        """Some of them, as they are."""
        return replace(self, **{name: getattr(self, name)[rows] for name in _ARRAYS})

    def scaled(self, factor: float) -> VirtualLights:
        """All of them, `factor` times as strong."""
        return replace(self, power=factor * self.power)


_ARRAYS = tuple(field.name for field in fields(VirtualLights) if field.name != "paths")


def join(parts: Sequence[VirtualLights], paths: int) -> VirtualLights:
    """All lights of some parts, one at least, as they are, for an estimate of `paths` paths."""
    return VirtualLights(
        **{name: np.concatenate([getattr(part, name) for part in parts]) for name in _ARRAYS}, paths=paths
    )


def join_blocks(blocks: Sequence[VirtualLights]) -> VirtualLights:
    """The estimate that blocks of different paths make together: each counts by its number of paths."""
    paths = sum(block.paths for block in blocks)
    return join([block.scaled(block.paths / paths) for block in blocks], paths)
