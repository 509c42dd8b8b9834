"""Which receivers a source may light, and what stands between: the pairs that can have discontinuities.

[H 5.5.3]: only mutually visible pairs count, and of each only the blockers that shafts find.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from solver.geometry.surfaces import Surfaces
from solver.kernels import kernel
from solver.parallel import run_chunks
from solver.transport.exchange import heights
from solver.types import Corners, FloatArray, Int64Array, IntArray
from solver.visibility.blockers import first_blockers
from solver.visibility.bvh import Hierarchy

_CHUNK: Final = 64
_LEAST: Final = 8


@dataclass(frozen=True, eq=False)
class Blocked:
    """Some pairs and their blockers."""

    visibility: IntArray
    """(n,) class of each pair: FULL, PARTIAL or NONE"""
    count: IntArray
    """(n,) blockers of each pair; none where nothing is seen"""
    pool: IntArray
    """The blockers, pair after pair"""


def facing_pairs(
    surfaces: Surfaces, receivers: IntArray, sources: IntArray, tolerance: float
) -> tuple[IntArray, IntArray]:
    """All pairs (receiver, source) that have a part in front of each other by more than `tolerance` metres.

    Receivers come in the order given.
    """
    counts = np.zeros(len(receivers), dtype=np.int64)
    none = np.empty(0, dtype=np.int32)
    s = surfaces

    def count(start: int, stop: int) -> None:
        _list_facing(s.corners, s.corner_count, s.normal, tolerance, receivers, sources, start, stop, False,
                     counts, none, none)  # fmt: skip

    run_chunks(count, len(receivers), _CHUNK, _LEAST)
    first = np.cumsum(counts) - counts
    facing = np.empty((2, int(counts.sum())), dtype=np.int32)

    def fill(start: int, stop: int) -> None:
        _list_facing(s.corners, s.corner_count, s.normal, tolerance, receivers, sources, start, stop, True,
                     first, facing[0], facing[1])  # fmt: skip

    run_chunks(fill, len(receivers), _CHUNK, _LEAST)
    return facing[0], facing[1]


@kernel
def _list_facing(
    corners: Corners,
    counts: IntArray,
    normals: FloatArray,
    tolerance: float,
    receivers: IntArray,
    sources: IntArray,
    start: int,
    stop: int,
    write: bool,
    slot: Int64Array,
    out_receiver: IntArray,
    out_source: IntArray,
) -> None:
    """Count in slot, or write from slot on, the sources that receivers [start, stop) face."""
    for i in range(start, stop):
        r = receivers[i]
        found = 0
        for s in sources:
            if r == s or heights(corners[s], counts[s], corners[r, 0], normals[r])[1] <= tolerance:
                continue
            if heights(corners[r], counts[r], corners[s, 0], normals[s])[1] <= tolerance:
                continue
            if write:
                out_receiver[slot[i] + found] = r
                out_source[slot[i] + found] = s
            found += 1
        if not write:
            slot[i] = found


def find_blockers(
    surfaces: Surfaces, hierarchy: Hierarchy, receivers: IntArray, sources: IntArray, tolerance: float
) -> Blocked:
    """Visibility classes and blockers of pairs (n,), by shafts; tolerance in metres."""
    n = len(receivers)
    visibility, kept = np.empty(n, dtype=np.int32), np.zeros(n, dtype=np.int32)
    pieces: list[IntArray] = []
    s, h = surfaces, hierarchy
    patch = np.arange(s.patch_count, dtype=np.int32)
    at, room = 0, 64 * n + len(h.order)
    while at < n:
        pool = np.empty(room, dtype=np.int32)
        used = first_blockers(
            receivers, sources, s.corners, s.corner_count, patch, s.corners, s.corner_count, s.normal, h.low,
            h.high, h.skip, h.first, h.count, h.order, tolerance, at, n, visibility, kept, pool,
        )  # fmt: skip
        done = n - at if used >= 0 else -1 - used
        count = kept[at : at + done]
        pieces.append(pool[: int(count.sum())])
        at += done
    return Blocked(visibility, kept, np.concatenate(pieces or [kept]))
