"""Row sums of form factors: never above 1, and exactly 1 in a closed scene.

Form factors of an enclosure sum to 1 from every element; sampled visibility and tolerances leave errors
of parts in a thousand, which reflectances near 1 would amplify a hundredfold. The sums are restored, and so
is the lack of a gradient in a uniform field, by coupling each leaf with itself. Scaling its links instead
would let those that carry no light, and may be coarse, change those that carry all of it. In an open scene
the row sums are what they are, but for patches where they are above 1 on average: these are scaled down,
G'_ij = d_i d_j G_ij (Sinkhorn's iteration), which keeps reciprocity. It goes on from the scales that were
there before, since few links change at a time. Whether a scene is closed is asked of
rays: if `PROBES` cosine-distributed rays, spread over the surfaces by area, all
end on fronts, at most about 3 / PROBES of the light can escape unseen (95 % confidence).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final

import numpy as np

from solver import tolerances
from solver.geometry.surfaces import Surfaces
from solver.transport.elements import ElementTree
from solver.transport.pushpull import patch_sums
from solver.transport.state import TransportState
from solver.types import BoolArray, FloatArray, Int64Array
from solver.visibility.rays import RayScene

PROBES: Final = 16384
_STEPS: Final = 5
"""At most, in an open scene; another balance goes on from there"""
_EXCESS: Final = 1e-3
"""Of the sum of a patch, that is left alone"""
_MOST_REFLECTED: Final = 0.995
"""Where balance is strict, no leaf reflects more than this share of a uniform field."""


def is_closed(surfaces: Surfaces, rays: RayScene) -> bool:
    """Whether no light leaves the scene and none falls on a black back."""
    if surfaces.patch_count < 4:
        return False
    share = np.cumsum(surfaces.area) / surfaces.area.sum()
    # Open scenes are known by the first few, spread as all are.
    return all(_all_end_on_fronts(surfaces, rays, share, np.arange(k, PROBES, 16)) for k in range(16))


def _all_end_on_fronts(surfaces: Surfaces, rays: RayScene, share: FloatArray, k: Int64Array) -> bool:
    """Whether the rays k (n,) of all `PROBES` end on fronts."""
    strata = (k + 0.5) / PROBES
    patch = np.minimum(np.searchsorted(share, strata), surfaces.patch_count - 1)
    # R4 sequence: point on the patch, direction of the ray.
    root = 1.1673039782614187
    u, v, r, t = (((k + 1) * root**-n) % 1.0 for n in range(1, 5))
    c = surfaces.corners[patch]
    folded = (surfaces.corner_count[patch] == 3) & (u + v > 1.0)
    u, v = np.where(folded, 1.0 - u, u)[:, None], np.where(folded, 1.0 - v, v)[:, None]
    triangle = (surfaces.corner_count[patch] == 3)[:, None]
    on_triangle = c[:, 0] + u * (c[:, 1] - c[:, 0]) + v * (c[:, 2] - c[:, 0])
    on_quad = (1 - u) * (1 - v) * c[:, 0] + u * (1 - v) * c[:, 1] + u * v * c[:, 2] + (1 - u) * v * c[:, 3]
    normal = surfaces.normal[patch]
    origin = np.where(triangle, on_triangle, on_quad) + tolerances.RAY_OFFSET * surfaces.size * normal
    helper = np.eye(3)[np.argmin(np.abs(normal), axis=1)]
    tangent = np.cross(helper, normal)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    bitangent = np.cross(normal, tangent)
    sine = np.sqrt(r)[:, None]
    angle = (2.0 * math.pi * t)[:, None]
    direction = (
        sine * np.cos(angle) * tangent + sine * np.sin(angle) * bitangent + np.sqrt(1.0 - r)[:, None] * normal
    )
    hits = rays.intersect(origin, direction)
    if np.any(hits.triangle < 0):
        return False
    corners = surfaces.triangles[hits.triangle]
    facing = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    from_front = np.einsum("ij,ij->i", facing, direction) < 0.0
    two_sided = surfaces.triangle_patch[hits.triangle, 1] >= 0
    return bool(np.all(from_front | two_sided))


def balance(state: TransportState, closed: bool, strict: bool = False) -> Iterator[None]:
    """Bring the row sums to where they must be, after links have changed.

    In an open scene: of every patch on average; `strict`: of every leaf, so that light cannot multiply
    anywhere, at the price of what leaves with too great a sum receive rightly.
    """
    n = len(state.tree)
    leaf = state.tree.child < 0
    before = state.closure
    state.closure, state.remainder = np.ones(n), np.zeros((n, 3))
    if closed:
        rows = (yield from state.gather_in_steps(_uniform(n)))[:, :, 0]
        state.remainder[leaf] = -rows[leaf]
        state.remainder[leaf, 0] += 1.0
        yield
    elif strict:
        yield from _balance_leaves(state, leaf)
    else:
        yield from _balance_patches(state, leaf, before)


def _balance_patches(state: TransportState, leaf: BoolArray, before: FloatArray) -> Iterator[None]:
    """Scale patches down, and up again where they need it no more, from where they were `before` (n,)."""
    patch = state.tree.patch[leaf]
    scale = np.minimum(of_patches(state.tree, before), 1.0)
    slope = np.full(len(scale), 1.5)
    step, excess = np.zeros((2, len(scale)))
    exchange = state.links.exchange
    for _ in range(_STEPS):
        row_sum = patch_sums(state.tree, state.links, exchange, scale)
        yield
        if not np.any((row_sum > 1.0 + _EXCESS) | ((scale < 1.0) & (row_sum < 1.0 - _EXCESS))):
            break
        # A sum goes down as the scale, or as its square, or by what lies between: by how many of those that
        # the patch sees are scaled too. One step tells.
        was, excess = excess, np.log(np.maximum(row_sum, 1e-300))
        moved = step > 0.0
        slope[moved] = np.clip((was - excess)[moved] / step[moved], 1.0, 2.0)
        scaled = np.minimum(scale * np.exp(-excess / slope), 1.0)
        step, scale = np.log(scale / scaled), scaled
    state.closure[leaf] = scale[patch]


def of_patches(tree: ElementTree, values: FloatArray) -> FloatArray:
    """Means (p,) over the patches of values (n,) of their leaves."""
    leaf = tree.child < 0
    total = np.bincount(tree.patch[leaf], tree.area[leaf] * values[leaf], tree.patch_count)
    return np.asarray(total / tree.area[: tree.patch_count])


def _balance_leaves(state: TransportState, leaf: BoolArray) -> Iterator[None]:
    tree = state.tree
    highest = state.reflectance.max(axis=1)[tree.patch]
    for _ in range(_STEPS):
        row_sum = (yield from state.gather_in_steps(_uniform(len(tree))))[:, 0, 0]
        yield
        most = _MOST_REFLECTED / np.maximum(highest, 1e-300)
        target = np.where(leaf, np.minimum(row_sum, most), row_sum)
        if not (row_sum > (1.0 + _EXCESS) * target).any():
            return
        off = target != row_sum
        state.closure[off] *= np.sqrt(target[off] / row_sum[off])


def _uniform(count: int) -> FloatArray:
    """Functions (count, 3, 1) of 1 everywhere."""
    unit = np.zeros((count, 3, 1))
    unit[:, 0] = 1.0
    return unit
