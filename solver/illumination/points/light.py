"""A radiosity solution as sources of light for points: what point irradiance is computed from ([H 6])."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from typing import Final

import numpy as np

from solver import tolerances
from solver.geometry.surfaces import Surfaces
from solver.parallel import run_chunks
from solver.transport.links import LinkTable
from solver.transport.oracle import element_residuals
from solver.transport.pace import Pace
from solver.transport.pushpull import pull
from solver.transport.state import TransportState
from solver.types import BoolArray, Corners, FloatArray, Int64Array, IntArray
from solver.visibility.blockers import first_blockers
from solver.visibility.bvh import Hierarchy

_CHUNK: Final = 256
_LEAST: Final = 16

_DIAGONAL: Final = 12.0
"""Squared diagonal of a rectangle over the sum of its second moments."""


@dataclass(frozen=True, eq=False)
class Sources:
    """Radiosity as functions (n, 3, channels) on n elements, and how far they can be trusted."""

    functions: FloatArray
    """(n, 3, channels) W/m2: mean, and gradient by the patch's axes"""
    luminance: FloatArray
    """(n,) of the mean, not negative"""
    spread: FloatArray
    """(n,) RMS residual of the luminance from its linear function"""
    slope: FloatArray
    """(n,) RMS of the linear function about its mean"""
    extent: FloatArray
    """(n,) about the square of the element's diagonal, m2"""

    @staticmethod
    def of(state: TransportState, reflected_only: bool) -> Sources:
        """The radiosities of `state`, or what of them is reflected."""
        tree = state.tree
        light = state.radiosity.copy()
        if reflected_only:
            light[:, 0] -= state.emission[tree.patch]
        moments = np.empty_like(light)
        pull(tree.child, tree.child_count, tree.area, tree.moment, tree.offset, light, moments)
        spread = np.empty(len(tree))
        element_residuals(
            tree.child, tree.child_count, tree.area, tree.moment, moments @ state.weights,
            np.zeros(len(tree)), spread,
        )  # fmt: skip
        uu, uv, vv = (tree.moment[:, k, None] for k in range(3))
        determinant = uu * vv - uv * uv
        functions = moments.copy()
        functions[:, 1] = (vv * moments[:, 1] - uv * moments[:, 2]) / determinant
        functions[:, 2] = (uu * moments[:, 2] - uv * moments[:, 1]) / determinant
        u, v = (functions[:, k] @ state.weights for k in (1, 2))
        square = tree.moment[:, 0] * u * u + 2.0 * tree.moment[:, 1] * u * v + tree.moment[:, 2] * v * v
        return Sources(
            functions=functions,
            luminance=np.maximum(functions[:, 0] @ state.weights, 0.0),
            spread=spread,
            slope=np.sqrt(np.maximum(square, 0.0)),
            extent=_DIAGONAL * (tree.moment[:, 0] + tree.moment[:, 2]),
        )


@dataclass(frozen=True, eq=False)
class LinksByElement:
    """The links of every element, n elements."""

    first: Int64Array
    """(n + 1,) where each element's part of the others begins"""
    link: IntArray
    """row of the link table"""
    other: IntArray
    """the element at the other end"""

    @staticmethod
    def of(links: LinkTable, elements: int) -> LinksByElement:
        """The links of `elements` elements, each at both its ends."""
        ends = np.concatenate([links.p, links.q])
        order = np.argsort(ends, kind="stable")
        first = np.zeros(elements + 1, dtype=np.int64)
        np.cumsum(np.bincount(ends, minlength=elements), out=first[1:])
        link = np.tile(np.arange(len(links), dtype=np.int32), 2)[order]
        return LinksByElement(first, link, np.concatenate([links.q, links.p])[order])


@dataclass(frozen=True, eq=False)
class Lamps:
    """The patches that emit, as each leaf sees them, and what may stand between."""

    first: Int64Array
    """(n + 1,) by element; only leaves have any"""
    patch: IntArray
    kind: IntArray
    """visibility class"""
    blocker_start: Int64Array
    blocker_count: IntArray
    pool: IntArray

    @staticmethod
    def of(
        surfaces: Surfaces,
        hierarchy: Hierarchy,
        corners: Corners,
        counts: IntArray,
        patch: IntArray,
        leaves: IntArray,
    ) -> Generator[None, None, Lamps]:
        """Pairs of `leaves` (l,) and emitting patches; corners, counts, patch are the elements'.

        Yields every few milliseconds.
        """
        lamps = np.flatnonzero(surfaces.emission.any(axis=1)).astype(np.int32)
        tolerance = tolerances.SIDE * surfaces.size
        p, q = np.repeat(leaves, len(lamps)), np.tile(lamps, len(leaves))
        facing = _is_before(surfaces, corners, p, q, tolerance)
        p, q = p[facing], q[facing]
        n = len(p)
        kind, kept = np.empty(n, dtype=np.int32), np.zeros(n, dtype=np.int32)
        lists: dict[int, IntArray] = {}
        h, s = hierarchy, surfaces

        def work(start: int, stop: int) -> None:
            pieces = []
            at = start
            while at < stop:
                pool = np.empty(64 * (stop - at) + len(h.order), dtype=np.int32)
                used = first_blockers(
                    p, q, corners, counts, patch, s.corners, s.corner_count, s.normal, h.low, h.high, h.skip,
                    h.first, h.count, h.order, tolerance, at, stop, kind, kept, pool,
                )  # fmt: skip
                done = stop - at if used >= 0 else -1 - used
                pieces.append(pool[: int(kept[at : at + done].sum())].copy())
                at += done
            lists[start] = np.concatenate(pieces)

        for part in Pace().batches(np.ones(n, dtype=np.int64)):

            def batch(start: int, stop: int, first: int = part.start) -> None:
                work(first + start, first + stop)

            run_chunks(batch, part.stop - part.start, _CHUNK, _LEAST)
            yield
        pool = np.concatenate([lists[start] for start in sorted(lists)] or [kept[:0]])
        first = np.zeros(len(patch) + 1, dtype=np.int64)
        np.cumsum(np.bincount(p, minlength=len(patch)), out=first[1:])
        start = np.cumsum(kept, dtype=np.int64) - kept
        return Lamps(first, q, kind, start, kept, pool)


def _is_before(surfaces: Surfaces, corners: Corners, p: IntArray, q: IntArray, tolerance: float) -> BoolArray:
    """Whether elements p have a part before the front of patches q."""
    heights = np.einsum("nka,na->nk", corners[p] - corners[q][:, :1], surfaces.normal[q])
    return np.asarray(heights.max(axis=1) > tolerance)
