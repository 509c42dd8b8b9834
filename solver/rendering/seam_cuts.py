"""The vertices that borders take in from other patches, found anew along those lines alone where they differ.

Vertices are sorted along the lines on which edges of several patches lie
(`solver.illumination.meshing.seams`). What a patch takes in stays the same if neither its leaves nor those of
any patch on its lines have changed. Positions along all lines are measured from one vertex, the first: it is
found in either case, and where it is another all is found anew, so that what is kept is bit by bit what would
be found.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from solver.geometry.surfaces import Surfaces
from solver.illumination.meshing.seams import SeamLines, Seams, cut_borders, edges_on_lines, find_lines
from solver.rendering.connections import Connections
from solver.rendering.leaf_blocks import LeafBlocks
from solver.types import BoolArray, IntArray, Points


@dataclass(frozen=True, eq=False)
class SeamCuts:
    """What borders of leaves in blocks take in, and the lines along which it was found."""

    surfaces: Surfaces
    blocks: LeafBlocks
    lines: SeamLines
    seams: Seams
    origin: Points
    """(1, 3) the vertex that positions along lines are measured from, metres; (0, 3) if there is none"""

    @staticmethod
    def of(
        blocks: LeafBlocks,
        connections: Connections,
        surfaces: Surfaces,
        before: SeamCuts | None,
        earlier: IntArray,
    ) -> SeamCuts:
        """The cuts of `blocks`; `earlier` (p,) names the patch with the same leaves in `before`, or is -1."""
        lines = find_lines(surfaces)
        first = _first_with_lines(lines)
        origin = _origin(blocks, connections, surfaces, lines, first)
        if before is None or not _are_comparable(before, surfaces, origin, earlier):
            seams = cut_borders(connections.topology, blocks, surfaces, lines)
            return SeamCuts(surfaces, blocks, lines, seams, origin)
        affected = _affected(lines, before.lines, earlier)
        # All lines of these are looked at, and of the first, where positions along lines begin.
        looked_at = _have(lines.line, _members(lines, affected | first))
        seams = _cut(blocks, connections, surfaces, lines, looked_at)
        return SeamCuts(surfaces, blocks, lines, _merge(seams, blocks, affected, before, earlier), origin)


def _first_with_lines(lines: SeamLines) -> BoolArray:
    """Marks the first patch (p,) that has an edge on a line."""
    has_line = (lines.line >= 0).any(axis=1)
    return np.asarray(has_line & (np.cumsum(has_line) == 1))


def _origin(
    blocks: LeafBlocks, connections: Connections, surfaces: Surfaces, lines: SeamLines, first: BoolArray
) -> Points:
    topology = connections.topology
    border = topology.border[first[blocks.patch[topology.border >> 2]]]
    found = edges_on_lines(replace(topology, border=border), blocks, surfaces, lines)
    return topology.position[found.start[:1]]


def _are_comparable(before: SeamCuts, surfaces: Surfaces, origin: Points, earlier: IntArray) -> bool:
    """Whether lines are grouped by the same roundings, measured from the same vertex, in the same order."""
    old = before.surfaces
    return (
        len(origin) == 1
        and np.array_equal(before.origin, origin)
        and old.size == surfaces.size
        and np.array_equal(old.center, surfaces.center)
        and bool(np.all(np.diff(earlier[earlier >= 0]) > 0))
    )


def _members(lines: SeamLines, chosen: BoolArray) -> BoolArray:
    """Marks the lines of the `chosen` patches (p,), and at the end what is no line, which is never marked."""
    found = np.zeros(len(lines.direction) + 1, dtype=np.bool_)
    found[lines.line[chosen]] = True
    found[-1] = False
    return found


def _have(line: IntArray, marked: BoolArray) -> BoolArray:
    """Which edges (k, 4) lie on lines that are `marked`."""
    return marked[line]


def _affected(lines: SeamLines, old: SeamLines, earlier: IntArray) -> BoolArray:
    """Marks the patches (p,) that changed, or that have a line which they share with one that did."""
    changed, kept = earlier < 0, np.flatnonzero(earlier >= 0)
    gone = np.ones(len(old.line), dtype=np.bool_)
    gone[earlier[kept]] = False
    touched = _members(lines, changed)
    was_touched = _have(old.line[earlier[kept]], _members(old, gone))
    touched[lines.line[kept][was_touched]] = True
    touched[-1] = False
    on_touched: BoolArray = np.asarray(_have(lines.line, touched).any(axis=1))
    on_touched[kept] |= was_touched.any(axis=1)
    return np.asarray(changed | on_touched)


def _cut(
    blocks: LeafBlocks,
    connections: Connections,
    surfaces: Surfaces,
    lines: SeamLines,
    looked_at: BoolArray,
) -> Seams:
    """The cuts along those lines that are `looked_at`, told by edges of patches (p, 4)."""
    topology = connections.topology
    patches: BoolArray = np.asarray(looked_at.any(axis=1))
    border = topology.border[patches[blocks.patch[topology.border >> 2]]]
    some = SeamLines(np.where(looked_at, lines.line, np.int32(-1)), lines.direction)
    return cut_borders(replace(topology, border=border), blocks, surfaces, some)


def _merge(
    found: Seams, blocks: LeafBlocks, affected: BoolArray, before: SeamCuts, earlier: IntArray
) -> Seams:
    """Of `affected` patches what was `found`, of the others what was known `before`."""
    old = before.seams
    # The new place of each patch before, and how far its leaves have moved.
    place = np.full(len(before.blocks.start) - 1, -1, dtype=np.int32)
    kept = np.flatnonzero(~affected)
    place[earlier[kept]] = kept
    patch = before.blocks.patch[old.edge >> 2]
    stays = place[patch] >= 0
    moved = blocks.start[place[patch[stays]]] - before.blocks.start[patch[stays]]
    fresh = affected[blocks.patch[found.edge >> 2]]
    edge = np.concatenate([old.edge[stays] + 4 * moved, found.edge[fresh]])
    order = np.argsort(edge, kind="stable")
    return Seams(
        edge[order],
        np.concatenate([old.fraction[stays], found.fraction[fresh]])[order],
        np.concatenate([old.position[stays], found.position[fresh]])[order],
    )
