"""The kernel of `arrangement`: one cell after the other, each in its own frame."""

from __future__ import annotations

from typing import Final

import numpy as np

from solver.illumination.meshing.cell_plane import (
    beside,
    find_radii,
    intersect,
    line_met,
    project,
    stretch_near,
    stretches_between,
    vertex_beside,
    vertex_near,
)
from solver.kernels import inline_kernel, kernel
from solver.types import FloatArray, IntArray, Points

_PATIENCE: Final = 64
"""Lines are given up if this times the square of the number of chords and vertices was not steps enough."""


@kernel
def arrange_cells(
    begin: int,
    stop: int,
    crossed: IntArray,
    chord_start: IntArray,
    chord_constraint: IntArray,
    chord_from: IntArray,
    chord_to: IntArray,
    ends: FloatArray,
    ring_start: IntArray,
    ring_stop: IntArray,
    ring_piece: IntArray,
    low: FloatArray,
    high: FloatArray,
    position: Points,
    side: IntArray,
    rail: IntArray,
    center: Points,
    axes: FloatArray,
    tolerance: FloatArray,
) -> tuple[
    IntArray,
    FloatArray,
    IntArray,
    IntArray,
    IntArray,
    IntArray,
    IntArray,
    IntArray,
    FloatArray,
    IntArray,
]:
    """Arrange the cells `crossed[begin:stop]`; the columns of an `Arrangement`, in its order."""
    # What is found, in all cells.
    vertex_cell, vertices, vertex_total = np.empty(64, np.int32), np.empty((64, 3)), 0
    edge_cell, edge_ends, edge_label = (
        np.empty(64, np.int32),
        np.empty((64, 2), np.int32),
        np.empty(64, np.int32),
    )
    edge_total = 0
    marks, mark_label, mark_total = np.empty(64, np.int32), np.empty(64, np.int32), 0
    wanted, wanted_at, wanted_total = np.empty(64, np.int32), np.empty(64), 0
    dropped, dropped_total = np.empty(64, np.int32), 0
    # Of one cell: vertices with their radius, the lines that are in, and those that are yet to be laid.
    xy, radius = np.empty((64, 2)), np.empty(64)
    line, lines = np.empty((64, 3), np.int32), 0
    waiting, left = np.empty((64, 3), np.int32), 0
    corner = np.empty(6, np.int32)
    point = np.empty(2)
    for index in range(begin, stop):
        cell = crossed[index]
        ring = ring_start[cell]
        count = ring_start[cell + 1] - ring
        frame = axes[cell]
        inner_radius = tolerance[cell]
        # The ring, and where its sides begin.
        total = count
        sides = 0
        for i in range(count):
            if i >= len(xy):
                xy, radius = _wider(xy), _longer(radius)
            project(position[ring_stop[ring + i]], center[cell], frame, xy[i])
            if i == 0 or side[ring_piece[ring + i]] != side[ring_piece[ring + i - 1]]:
                corner[sides] = i
                sides += 1
        corner[sides] = count
        find_radii(xy, radius, count, corner, sides, inner_radius)
        # The chords, and their ends within the cell; the first chord lies on top.
        left = 0
        lines = 0
        for c in range(chord_start[index + 1] - 1, chord_start[index] - 1, -1):
            if left >= len(waiting):
                waiting = _wider_ids(waiting)
            for k in range(2):
                code = chord_from[c] if k == 0 else chord_to[c]
                if code < 0:
                    project(ends[(-1 - code) >> 1, (-1 - code) & 1], center[cell], frame, point)
                    found = vertex_near(xy, radius, total, point, inner_radius)
                    if found < 0:
                        if total >= len(xy):
                            xy, radius = _wider(xy), _longer(radius)
                        xy[total] = point
                        radius[total] = inner_radius
                        found = total
                        total += 1
                else:
                    found = 0
                    while ring_stop[ring + found] != code:
                        found += 1
                waiting[left, k] = found
            waiting[left, 2] = chord_constraint[c]
            left += 1
        patience = _PATIENCE * (left + total) * (left + total)
        while left > 0:
            left -= 1
            a = waiting[left, 0]
            b = waiting[left, 1]
            label = waiting[left, 2]
            if a == b:
                continue
            patience -= 1
            if patience < 0:
                if dropped_total >= len(dropped):
                    dropped = _longer_ids(dropped)
                dropped[dropped_total] = cell
                dropped_total += 1
                break
            if left + lines + 4 > len(waiting):
                waiting = _wider_ids(waiting)
            # Along a side: the stretches between its ends are on a constraint.
            at, past = stretches_between(corner, sides, count, a, b)
            if at >= 0:
                while mark_total + past - at > len(marks):
                    marks, mark_label = _longer_ids(marks), _longer_ids(mark_label)
                for i in range(at, past):
                    marks[mark_total] = ring + i
                    mark_label[mark_total] = label
                    mark_total += 1
                continue
            # Past a vertex: through it.
            near = vertex_beside(xy, radius, total, a, b)
            if near >= 0:
                left = _lay(waiting, left, near, b, label)
                left = _lay(waiting, left, a, near, label)
                continue
            # Across a line: through a vertex there.
            met, is_same = line_met(xy, line, lines, a, b)
            if met < 0:
                if lines >= len(line):
                    line = _wider_ids(line)
                line[lines, 0] = a
                line[lines, 1] = b
                line[lines, 2] = label
                lines += 1
                continue
            if is_same:
                line[met, 2] = min(line[met, 2], label)
                continue
            c = line[met, 0]
            d = line[met, 1]
            other = line[met, 2]
            lines -= 1
            line[met] = line[lines]
            intersect(xy[a], xy[b], xy[c], xy[d], point)
            near = vertex_near(xy, radius, total, point, inner_radius)
            if near < 0:
                near, t = stretch_near(xy, count, point, inner_radius, low, high, ring)
                if t > 0.0:
                    # On a side: ask for it, and go on with a vertex that the next attempt will find there.
                    if wanted_total >= len(wanted):
                        wanted, wanted_at = _longer_ids(wanted), _longer(wanted_at)
                    stretch = ring + near
                    wanted[wanted_total] = rail[ring_piece[stretch]]
                    wanted_at[wanted_total] = low[stretch] + t * (high[stretch] - low[stretch])
                    wanted_total += 1
                    near = -1
            if near < 0:
                if total >= len(xy):
                    xy, radius = _wider(xy), _longer(radius)
                near = total
                xy[near] = point
                radius[near] = inner_radius
                total += 1
                lines, left = _take_up(xy, radius[near], near, line, lines, waiting, left)
            left = _lay(waiting, left, near, b, label)
            left = _lay(waiting, left, a, near, label)
            left = _lay(waiting, left, c, near, other)
            left = _lay(waiting, left, near, d, other)
        # Inner vertices that lines have, numbered behind the ring.
        number = np.full(total, -1, np.int32)
        for i in range(lines):
            number[line[i, 0]] = 0
            number[line[i, 1]] = 0
        used = count
        for i in range(total):
            if i < count:
                number[i] = i
            elif number[i] == 0:
                number[i] = used
                used += 1
                if vertex_total >= len(vertices):
                    vertices, vertex_cell = _wider(vertices), _longer_ids(vertex_cell)
                for axis in range(3):
                    vertices[vertex_total, axis] = (
                        center[cell, axis] + xy[i, 0] * frame[0, axis] + xy[i, 1] * frame[1, axis]
                    )
                vertex_cell[vertex_total] = cell
                vertex_total += 1
        for i in range(lines):
            if edge_total >= len(edge_cell):
                edge_cell, edge_label = _longer_ids(edge_cell), _longer_ids(edge_label)
                edge_ends = _wider_ids(edge_ends)
            edge_cell[edge_total] = cell
            edge_ends[edge_total, 0] = number[line[i, 0]]
            edge_ends[edge_total, 1] = number[line[i, 1]]
            edge_label[edge_total] = line[i, 2]
            edge_total += 1
    return (
        vertex_cell[:vertex_total],
        vertices[:vertex_total],
        edge_cell[:edge_total],
        edge_ends[:edge_total],
        edge_label[:edge_total],
        marks[:mark_total],
        mark_label[:mark_total],
        wanted[:wanted_total],
        wanted_at[:wanted_total],
        dropped[:dropped_total],
    )


@kernel
def _longer(values: FloatArray) -> FloatArray:
    more = np.empty(2 * len(values))
    more[: len(values)] = values
    return more


@kernel
def _longer_ids(values: IntArray) -> IntArray:
    more = np.empty(2 * len(values), np.int32)
    more[: len(values)] = values
    return more


@kernel
def _wider(values: FloatArray) -> FloatArray:
    more = np.empty((2 * len(values), values.shape[1]))
    more[: len(values)] = values
    return more


@kernel
def _wider_ids(values: IntArray) -> IntArray:
    more = np.empty((2 * len(values), values.shape[1]), np.int32)
    more[: len(values)] = values
    return more


@inline_kernel
def _lay(waiting: IntArray, left: int, a: int, b: int, label: int) -> int:
    """Put a line on the pile; returns its new height."""
    waiting[left, 0] = a
    waiting[left, 1] = b
    waiting[left, 2] = label
    return left + 1


@inline_kernel
def _take_up(
    xy: FloatArray, radius: float, vertex: int, line: IntArray, lines: int, waiting: IntArray, left: int
) -> tuple[int, int]:
    """Put the lines that come near a new vertex back on the pile; returns how many lines are in, and wait."""
    i = 0
    while i < lines:
        along, square = beside(xy, xy[vertex], line[i, 0], line[i, 1])
        if 0.0 < along < 1.0 and square < radius * radius:
            left = _lay(waiting, left, line[i, 0], line[i, 1], line[i, 2])
            lines -= 1
            line[i] = line[lines]
        else:
            i += 1
    return lines, left
