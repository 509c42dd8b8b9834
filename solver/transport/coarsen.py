"""Coarsening: links that have become alike are merged, and elements that none needs are folded back.

What refinement did to a shadow is of no use where the shadow is gone ([G]); a session of many edits would
fill up with it. The children of an element that have a link to the same partner are merged into one link of
their parent, where that errs little. What stands between is what stands between any of them.
"""

from __future__ import annotations

from collections.abc import Generator
from typing import Final

import numpy as np

from solver.kernels import kernel
from solver.transport.elements import ElementTree
from solver.transport.estimate import Residuals
from solver.transport.linking import Linker
from solver.transport.links import LinkTable, take_ranges
from solver.transport.pace import Pace
from solver.transport.state import TransportState
from solver.types import BoolArray, Int64Array, IntArray

_KEPT: Final = 0.5
"""Part of the error that would be refined, which a merger may have: or it might be refined at once."""

_SMOOTHER: Final = _KEPT / 16.0
"""The same of the links that are tried, in sum: over twice the length, what is not linear is four times as
much."""


def coarsen(
    state: TransportState,
    linker: Linker,
    pace: Pace,
    rows: IntArray,
    merging: IntArray,
    residuals: Residuals,
    bound: float,
) -> Generator[None, None, IntArray]:
    """Merge links among `merging` (k,) where a link errs by less than `bound` after it, squared, times area.

    Yields every few milliseconds. Returns the rows (m,), ascending, of what has become of `rows` (n,), which
    are those and others.
    """
    tree, links = state.tree, state.links
    tried = np.ones(len(links), dtype=np.bool_)
    tried[merging] = False
    while True:
        candidates = rows[~tried[rows]]
        errors = residuals.estimate(state, candidates).links.sum(axis=0)
        group, ends = _families(tree, links, candidates, errors, _SMOOTHER * bound)
        yield
        if len(ends) == 0:
            return rows
        members = candidates[np.flatnonzero(group >= 0)]
        family = group[group >= 0]
        order = np.argsort(family, kind="stable")
        members, family = members[order], family[order]
        tried[members] = True
        start, count, pool = _joint_blockers(links, members, family, len(ends))
        batches, accepted = [], np.zeros(len(ends), dtype=np.bool_)
        for part in pace.batches((2 + count // 4).astype(np.int64)):
            p, q = np.ascontiguousarray(ends[part, 0]), np.ascontiguousarray(ends[part, 1])
            least = np.ones(len(p), dtype=np.int32)
            batch = linker.link_children(
                tree, p, q, start[part], count[part], pool, least, residuals.light, keep_dark=True
            )
            error = residuals.estimate(state, batch).links.sum(axis=0)
            good = error <= _KEPT * bound
            accepted[part] = good
            batches.append(batch.chosen(np.flatnonzero(good)))
            yield
        if not accepted.any():
            return rows
        gone = np.sort(members[accepted[family]])
        before = len(links)
        merged = int(accepted.sum())
        kept = np.setdiff1d(rows, gone, assume_unique=True)
        moved = moved_rows(gone, merged, before)
        for _ in links.replace(gone, batches):
            yield
        tried[moved[:, 1]] = tried[moved[:, 0]]
        tried = tried[: len(links)]
        place = np.arange(before, dtype=np.int32)
        place[moved[:, 0]] = moved[:, 1]
        tried[gone[:merged]] = False
        rows = np.sort(np.concatenate([place[kept], gone[:merged]]))


def unneeded(tree: ElementTree, links: LinkTable) -> BoolArray:
    """Elements (n,) that may go: neither they nor what is below them has links, nor have their siblings.

    Light over them is the linear function of their parent all the same.
    """
    own = np.zeros(len(tree), dtype=np.bool_)
    own[links.p] = True
    own[links.q] = True
    gone = np.zeros(len(tree), dtype=np.bool_)
    _fold(tree.child, tree.child_count, own, gone)
    return gone


@kernel
def _fold(child: IntArray, child_count: IntArray, own: BoolArray, gone: BoolArray) -> None:
    bare = np.zeros(len(child), dtype=np.bool_)
    for e in range(len(child) - 1, -1, -1):
        if child[e] >= 0:
            all_bare = True
            for k in range(child[e], child[e] + child_count[e]):
                if own[k] or not bare[k]:
                    all_bare = False
                    break
            if all_bare:
                for k in range(child[e], child[e] + child_count[e]):
                    gone[k] = True
            bare[e] = all_bare
        else:
            bare[e] = True


def _families(
    tree: ElementTree,
    links: LinkTable,
    rows: IntArray,
    errors: np.ndarray[tuple[int, ...], np.dtype[np.float64]],
    limit: float,
) -> tuple[IntArray, IntArray]:
    """Which of `rows` (n,) are whole sets of siblings with one partner, with errors below `limit` in sum.

    Returns the set that each belongs to, or -1, and the ends (k, 2) of the link that each set could become.
    """
    group = np.full(len(rows), -1, dtype=np.int32)
    ends: list[IntArray] = []
    total = 0
    n = np.int64(len(tree))
    for child, partner in ((links.p[rows], links.q[rows]), (links.q[rows], links.p[rows])):
        parent = tree.parent[child]
        free = np.flatnonzero((parent >= 0) & (group < 0))
        key = parent[free].astype(np.int64) * n + partner[free]
        known, place, count = np.unique(key, return_inverse=True, return_counts=True)
        whole = count == tree.child_count[(known // n).astype(np.int32)]
        whole &= np.bincount(place, errors[free], len(known)) <= limit
        number = np.where(whole, np.cumsum(whole) - 1 + total, -1)
        group[free] = number[place]
        chosen = known[whole]
        ends.append(np.stack([chosen // n, chosen % n], axis=1).astype(np.int32))
        total += len(chosen)
    return group, np.concatenate(ends)


def _joint_blockers(
    links: LinkTable, members: IntArray, family: IntArray, count: int
) -> tuple[Int64Array, IntArray, IntArray]:
    """Blockers of any of the links of each of `count` families, as starts, counts and lists."""
    listed = links.blocker_count[members]
    pool = take_ranges(links.pool, links.blocker_start[members], listed).astype(np.int64)
    most = np.int64(1 << 32)
    both = np.unique(np.repeat(family.astype(np.int64), listed) * most + pool)
    counts = np.bincount(both // most, minlength=count).astype(np.int32)
    return np.cumsum(counts, dtype=np.int64) - counts, counts, (both % most).astype(np.int32)


def moved_rows(gone: IntArray, filled: int, before: int) -> IntArray:
    """Rows (k, 2) that change places, from and to, when of `gone` rows only the first are filled again."""
    holes = gone[filled:]
    left = before - len(holes)
    inside = holes[holes < left]
    stays = np.ones(before - left, dtype=np.bool_)
    stays[holes[len(inside) :] - left] = False
    return np.stack([left + np.flatnonzero(stays), inside], axis=1).astype(np.int32)
