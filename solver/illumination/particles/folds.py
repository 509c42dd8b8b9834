"""Images of lights behind mirrors, as lighting takes them ([K 4.2], after Diefenbach and Badler 1995).

The way from a light by mirrors to a receiver is a straight line from the last image, unfolded. An image has
the frame of its light, mirrored, so that a line leaves all of them through the same texel of their maps, and
each part of the way is looked up in the map of its own: the light sees as far as the first mirror, the image
in that as far as the second, and the last one the receiver. The image sees from its mirror on.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from solver.illumination.particles.hiding import is_hidden
from solver.illumination.particles.sights import Texels
from solver.kernels import inline_kernel
from solver.tolerances import TOUCH
from solver.types import Float32Array, IntArray


class Folds(NamedTuple):
    """What m lights, followed by k images, shine through, and what they are images of."""

    first: int
    """m"""
    parent: IntArray
    """(m + k,) the light or image that is shown; -1 for lights"""
    polygon: IntArray
    """(m + k,) the mirror, a polygon of the scene; 0 for lights"""
    pyramid: Float32Array
    """(m + k, 16) as the cone of `Sights`: inside of its mirror's edges, and behind it, an image shines"""
    clip: Float32Array
    """(s, 3) normals of planes through the image and where a seen polygon meets the mirror's plane: those
    parts of polygons that are behind the mirror hide nothing; 0 for lights"""


@inline_kernel
def first_of(folds: Folds | None) -> int:
    """The first light that shines."""
    if folds is None:
        return 0
    return folds.first


@inline_kernel
def passes_by(
    low: Float32Array, high: Float32Array, lights: Float32Array, k: int, folds: Folds | None
) -> bool:
    """Whether an image shines on nothing of the box from `low` to `high` (3,)."""
    if folds is None:
        return False
    pyramid = folds.pyramid
    zero = np.float32(0.0)
    for edge in range(5):
        reach = -pyramid[k, 15] if edge == 4 else zero
        for axis in range(3):
            a = pyramid[k, 3 * edge + axis]
            corner = high[axis] if a > zero else low[axis]
            reach += a * (corner if edge == 4 else corner - lights[axis, k])
        if reach < zero:
            return True
    return False


@inline_kernel
def _is_outside(
    x: np.float32, y: np.float32, z: np.float32, lights: Float32Array, k: int, pyramid: Float32Array
) -> bool:
    """Whether a point is not seen from an image through its mirror."""
    dx, dy, dz = x - lights[0, k], y - lights[1, k], z - lights[2, k]
    inside = min(
        min(
            pyramid[k, 0] * dx + pyramid[k, 1] * dy + pyramid[k, 2] * dz,
            pyramid[k, 3] * dx + pyramid[k, 4] * dy + pyramid[k, 5] * dz,
        ),
        min(
            pyramid[k, 6] * dx + pyramid[k, 7] * dy + pyramid[k, 8] * dz,
            pyramid[k, 9] * dx + pyramid[k, 10] * dy + pyramid[k, 11] * dz,
        ),
    )
    behind = pyramid[k, 12] * x + pyramid[k, 13] * y + pyramid[k, 14] * z - pyramid[k, 15]
    # What is on the mirror's plane, its own back among it, has nothing of it.
    outside: bool = inside < np.float32(0.0) or behind <= np.float32(TOUCH)
    return outside


@inline_kernel
def trim(
    x: Float32Array,
    y: Float32Array,
    z: Float32Array,
    lights: Float32Array,
    k: int,
    folds: Folds,
    gain: Float32Array,
) -> None:
    """Take the light from receivers (n,) that do not see the image through its mirror."""
    for i in range(len(x)):
        if _is_outside(x[i], y[i], z[i], lights, k, folds.pyramid):
            gain[i] = np.float32(0.0)


@inline_kernel
def is_hidden_on_the_way(
    x: np.float32,
    y: np.float32,
    z: np.float32,
    own: int,
    lights: Float32Array,
    k: int,
    texel: int,
    texels: Texels,
    start: IntArray,
    seen: IntArray,
    cone: Float32Array,
    folds: Folds,
) -> bool:
    """Whether anything is on the way from the light of which `k` is an image, by its mirrors, to a receiver.

    `texel` is the first of the four around the way, in all maps.
    """
    pyramid = folds.pyramid
    size = texels.shape[1]
    row, column = texel // size, texel % size
    node = k
    while True:
        base = start[node]
        q0, q1 = texels[node, row, column], texels[node, row, column + 1]
        q2, q3 = texels[node, row + 1, column], texels[node, row + 1, column + 1]
        dx, dy, dz = x - lights[0, node], y - lights[1, node], z - lights[2, node]
        is_clear = q0 == q1 and q0 == q2 and q0 == q3 and seen[base + q0] == own
        if not is_clear and is_hidden(x, y, z, dx, dy, dz, own, base, q0, q1, q2, q3, seen, cone, folds.clip):
            return True
        if node < folds.first:
            return False
        # On to where the way meets the mirror, and what it is an image of; that shows there, or not at all.
        ax, ay, az = pyramid[node, 12], pyramid[node, 13], pyramid[node, 14]
        fall = ax * dx + ay * dy + az * dz
        height = ax * x + ay * y + az * z - pyramid[node, 15]
        back = height / fall
        x, y, z = x - back * dx, y - back * dy, z - back * dz
        own = folds.polygon[node]
        node = folds.parent[node]
        if node >= folds.first and _is_outside(x, y, z, lights, node, pyramid):
            return True
