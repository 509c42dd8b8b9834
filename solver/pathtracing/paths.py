"""The paths in flight and the shadow rays they cast, as structs of arrays of fixed capacity."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from solver.kernels import inline_kernel
from solver.types import FloatArray, IntArray


class Paths(NamedTuple):
    """Rays about to be traced; the first `alive` rows are in use."""

    origin: FloatArray
    """(w, 3) metres, off the surface that the ray leaves"""
    direction: FloatArray
    """(w, 3) unit"""
    spread: FloatArray
    """(w,) pi times the probability per steradian of the direction: off diffuse surfaces the cosine to the
    normal; negative for a ray that emitter sampling cannot choose as well: from the camera, off a mirror"""
    throughput: FloatArray
    """(w, 3) what one W/m2 of radiosity at the next vertex adds to the estimate; where its radiance is not
    diffuse, radiosity stands for pi times that towards the origin"""
    item: IntArray
    """(w,) row of the task's sums that the path adds to"""
    vertex: IntArray
    """(w,) number of the next vertex, 0 for the first that reflects"""
    stream: NDArray[np.uint64]
    """(w,)"""
    sample: NDArray[np.uint64]
    """(w,) index of the sample in its stream"""


class ShadowRays(NamedTuple):
    """Light that arrives unless its segment is blocked."""

    origin: FloatArray
    """(s, 3) metres"""
    target: FloatArray
    """(s, 3) metres"""
    energy: FloatArray
    """(s, 3)"""
    item: IntArray
    """(s,) row of the task's sums"""


def allocate_paths(capacity: int) -> Paths:
    """Room for `capacity` paths."""
    return Paths(
        origin=np.empty((capacity, 3)),
        direction=np.empty((capacity, 3)),
        spread=np.empty(capacity),
        throughput=np.empty((capacity, 3)),
        item=np.empty(capacity, dtype=np.int32),
        vertex=np.empty(capacity, dtype=np.int32),
        stream=np.empty(capacity, dtype=np.uint64),
        sample=np.empty(capacity, dtype=np.uint64),
    )


def allocate_shadow_rays(capacity: int) -> ShadowRays:
    """Room for `capacity` shadow rays."""
    return ShadowRays(
        origin=np.empty((capacity, 3)),
        target=np.empty((capacity, 3)),
        energy=np.empty((capacity, 3)),
        item=np.empty(capacity, dtype=np.int32),
    )


@inline_kernel
def write_path(
    paths: Paths,
    row: int,
    x: float,
    y: float,
    z: float,
    dx: float,
    dy: float,
    dz: float,
    spread: float,
    red: float,
    green: float,
    blue: float,
    item: int,
    vertex: int,
    stream: np.uint64,
    index: np.uint64,
) -> None:
    """Write at `row` a ray from (x, y, z) along (dx, dy, dz) to the vertex of that number."""
    paths.origin[row, 0], paths.origin[row, 1], paths.origin[row, 2] = x, y, z
    paths.direction[row, 0], paths.direction[row, 1], paths.direction[row, 2] = dx, dy, dz
    paths.spread[row] = spread
    paths.throughput[row, 0], paths.throughput[row, 1], paths.throughput[row, 2] = red, green, blue
    paths.item[row] = item
    paths.vertex[row] = vertex
    paths.stream[row] = stream
    paths.sample[row] = index
