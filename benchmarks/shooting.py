"""Progressive refinement by shooting, from an unlit scene: what [G] tells redistribution against.

Source: M. F. Cohen et al. 1988, "A progressive refinement approach to fast radiosity image generation": each
shot sends out what the element with the most unshot energy holds. Form factors are found as in J. R. Wallace
et al. 1989, "A ray tracing algorithm for progressive radiosity": at the middle of each receiver, by Lambert's
formula for the shooter without what stands between, times the part of rays to it that nothing blocks. The
mesh is given and stays; there is no ambient term, so that nothing but light that was shot counts.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from solver.geometry.surfaces import Surfaces
from solver.kernels import kernel
from solver.parallel import run_chunks
from solver.transport.elements import ElementTree
from solver.transport.lambert import point_form_factor
from solver.types import LUMINANCE_WEIGHTS, BoolArray, Corners, Float32Array, FloatArray, IntArray, Points
from solver.visibility.rays import RayScene
from solver.visibility.sampling import hash_index, sample_element

RAYS: Final = 4
"""To each receiver that faces the shooter, one to each of its quarters"""

_CHUNK: Final = 2048


class Shooting:
    """Radiosities of n elements in the making."""

    def __init__(self, surfaces: Surfaces, rays: RayScene, tree: ElementTree) -> None:
        """Take the leaves of `tree`, a mesh of `surfaces`, as elements; nothing but emitters shines yet."""
        leaves = tree.leaves
        patch = tree.patch[leaves]
        self._rays = rays
        self._corners = np.ascontiguousarray(tree.corners[leaves])
        self._counts = tree.corner_count[leaves]
        self._middle = np.ascontiguousarray(tree.centroid[leaves])
        self._normal = np.ascontiguousarray(surfaces.normal[patch])
        self.area: FloatArray = tree.area[leaves]
        """(n,) m2"""
        self.reflectance = surfaces.reflectance[patch]
        """(n, 3)"""
        self.emission = surfaces.emission[patch]
        """(n, 3) W/m2"""
        self.radiosity = self.emission.copy()
        """(n, 3) W/m2"""
        self._unshot = self.emission.copy()
        self.shots = 0
        self.ray_count = 0

    @property
    def unshot(self) -> FloatArray:
        """W (n,) of luminance that elements have still to shoot."""
        return np.asarray(self.area * (self._unshot @ LUMINANCE_WEIGHTS))

    def shoot(self) -> None:
        """Send out what the element with the most unshot energy holds."""
        shooter = int(np.argmax(self.unshot))
        arrived = self.reflectance * self.form_factors(shooter)[:, None] * self._unshot[shooter]
        self._unshot[shooter] = 0.0
        self._unshot += arrived
        self.radiosity += arrived
        self.shots += 1

    def form_factors(self, shooter: int) -> FloatArray:
        """The part (n,) of a hemisphere over each element's middle that it sees one element in."""
        n = len(self.area)
        factors = np.empty(n)
        points = (self._middle, self._normal, self._corners, self._counts)

        def open_factors(start: int, stop: int) -> None:
            _open_factors(*points, shooter, start, stop, factors)

        run_chunks(open_factors, n, _CHUNK)
        facing = np.flatnonzero(factors > 0.0).astype(np.int32)
        origins, directions = np.empty((2, RAYS * len(facing), 3), dtype=np.float32)
        rays = self._rays

        def aim(start: int, stop: int) -> None:
            _aim(
                facing, *points, self.area, shooter, rays.center, rays.scale, rays.offset, start, stop,
                origins, directions,
            )  # fmt: skip

        run_chunks(aim, len(facing), _CHUNK)
        blocked: BoolArray = rays.occluded_local(origins, directions)
        self.ray_count += len(blocked)
        factors[facing] *= 1.0 - blocked.reshape(-1, RAYS).mean(axis=1)
        return factors


@kernel
def _open_factors(
    middle: Points,
    normal: FloatArray,
    corners: Corners,
    counts: IntArray,
    shooter: int,
    start: int,
    stop: int,
    factors: FloatArray,
) -> None:
    scratch = np.empty((5, 3))
    for i in range(start, stop):
        factors[i] = 0.0
        # Behind the shooter, or on its plane.
        height = 0.0
        for axis in range(3):
            height += (middle[i, axis] - middle[shooter, axis]) * normal[shooter, axis]
        if i != shooter and height > 0.0:
            factors[i] = point_form_factor(
                middle[i, 0], middle[i, 1], middle[i, 2], normal[i, 0], normal[i, 1], normal[i, 2],
                corners[shooter], counts[shooter], scratch,
            )  # fmt: skip


@kernel
def _aim(
    facing: IntArray,
    middle: Points,
    normal: FloatArray,
    corners: Corners,
    counts: IntArray,
    area: FloatArray,
    shooter: int,
    center: FloatArray,
    scale: float,
    offset: float,
    start: int,
    stop: int,
    origins: Float32Array,
    directions: Float32Array,
) -> None:
    """Rays from the middles of elements `facing`, off their surfaces, to jittered points of the shooter."""
    point = np.empty(3)
    for k in range(start, stop):
        i = facing[k]
        h = hash_index(np.int64(i) * np.int64(1000003) + np.int64(shooter))
        for s in range(RAYS):
            u = (((h >> (14 * s)) & 0x7F) + 0.5) / 128.0
            v = (((h >> (14 * s + 7)) & 0x7F) + 0.5) / 128.0
            sample_element(
                corners[shooter], counts[shooter], normal[shooter], area[shooter],
                0.5 * ((s & 1) + u), 0.5 * ((s >> 1) + v), point,
            )  # fmt: skip
            for axis in range(3):
                a = (middle[i, axis] - center[axis]) * scale + offset * normal[i, axis]
                b = (point[axis] - center[axis]) * scale + offset * normal[shooter, axis]
                origins[RAYS * k + s, axis] = a
                directions[RAYS * k + s, axis] = b - a
