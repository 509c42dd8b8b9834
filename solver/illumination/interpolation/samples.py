"""Where interpolants are sampled: corners and middles of edges, once on each side of a jump ([H 3.3])."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from solver.illumination.meshing.triangulation import Triangulation
from solver.kernels import kernel
from solver.transport.elements import ElementTree
from solver.transport.places import functions_at
from solver.types import BoolArray, FloatArray, IntArray, Points, Spectra

NUDGE: Final = 1e-3
"""A sample on a jump, or on the border of a patch, is taken this part of the way towards the middle of its
triangle: from inside of what it stands for, however small that is."""


@dataclass(frozen=True, eq=False)
class Samples:
    """m samples of t triangles. What triangles share without a jump between them is one sample."""

    node: IntArray
    """(t, 6) samples at corner a, middle of ab, corner b, middle of bc, corner c, middle of ca"""
    position: Points
    """(m, 3) metres"""
    triangle: IntArray
    """(m,) a triangle that the sample belongs to, the largest at corners"""


def place_samples(mesh: Triangulation) -> Samples:
    """The samples of a triangulation."""
    t = len(mesh.triangles)
    root = np.arange(3 * t, dtype=np.int32)
    bounded = np.zeros(3 * t, dtype=np.bool_)
    middle = np.empty((t, 3), dtype=np.int32)
    middle_bounded = np.empty((t, 3), dtype=np.bool_)
    _join_corners(mesh.triangles, mesh.neighbour, mesh.edge_jump, root, bounded)
    middles = _number_middles(mesh.neighbour, mesh.edge_jump, middle, middle_bounded)
    area = np.linalg.norm(
        np.cross(
            mesh.position[mesh.triangles[:, 1]] - mesh.position[mesh.triangles[:, 0]],
            mesh.position[mesh.triangles[:, 2]] - mesh.position[mesh.triangles[:, 0]],
        ),
        axis=1,
    )
    corner = np.empty((t, 3), dtype=np.int32)
    corners, where, is_bounded = _number_corners(root, bounded, area, corner)
    node = np.empty((t, 6), dtype=np.int32)
    node[:, 0::2] = corner
    node[:, 1::2] = corners + middle
    position = np.empty((corners + middles, 3))
    triangle = np.empty(corners + middles, dtype=np.int32)
    vertices = mesh.position[mesh.triangles]
    centre = vertices.mean(axis=1)
    # Corners, as the largest of their triangles has them.
    of, k = where[:corners] // 3, where[:corners] % 3
    triangle[:corners] = of
    here = vertices[of, k]
    position[:corners] = here + np.where(is_bounded[:corners, None], NUDGE, 0.0) * (centre[of] - here)
    # Middles, as the first of their two triangles has them.
    first = np.full(middles, 3 * t, dtype=np.int64)
    np.minimum.at(first, middle.ravel(), np.arange(3 * t))
    of, k = (first // 3).astype(np.int32), (first % 3).astype(np.int32)
    triangle[corners:] = of
    here = 0.5 * (vertices[of, k] + vertices[of, (k + 1) % 3])
    nudge = np.where(middle_bounded[of, k, None], NUDGE, 0.0)
    position[corners:] = here + nudge * (centre[of] - here)
    return Samples(node, position, triangle)


def linear_samples(
    mesh: Triangulation, samples: Samples, elements: IntArray, tree: ElementTree, functions: FloatArray
) -> Spectra:
    """What linear functions (n, 3, channels) on elements tell at the samples (m, channels), never negative.

    Triangles lie on `elements` (leaves,), as they are numbered in the triangulation; what is told on several
    triangles around a sample is taken on average.
    """
    a, b, c = np.moveaxis(mesh.position[mesh.triangles], 1, 0)
    places = np.stack([a, 0.5 * (a + b), b, 0.5 * (b + c), c, 0.5 * (c + a)], axis=1).reshape(-1, 3)
    told = np.maximum(functions_at(tree, functions, places, np.repeat(elements[mesh.leaf], 6)), 0.0)
    node, m = samples.node.ravel(), len(samples.position)
    count = np.bincount(node, minlength=m)
    return np.stack([np.bincount(node, column, m) / count for column in told.T], axis=1)


def in_channels(values: Spectra, channels: int) -> Spectra:
    """Samples (m, 1 or 3) in so many channels; of three that are to be one, the first."""
    return values if values.shape[1] == channels else np.repeat(values[:, :1], channels, axis=1)


@kernel
def _find(root: IntArray, k: int) -> int:
    while root[k] != k:
        root[k] = root[root[k]]
        k = root[k]
    return k


@kernel
def _join_corners(
    triangles: IntArray, neighbour: IntArray, jump: BoolArray, root: IntArray, bounded: BoolArray
) -> None:
    """Unite the corners (3 t,) that triangles share across edges without a jump; mark those at bounds."""
    for t in range(len(triangles)):
        for k in range(3):
            m = (k + 1) % 3
            other = neighbour[t, k]
            if other < 0 or jump[t, k]:
                bounded[3 * t + k] = True
                bounded[3 * t + m] = True
                continue
            if other < t:
                continue
            for j in range(3):
                if triangles[other, j] == triangles[t, k]:
                    root[_find(root, 3 * other + j)] = _find(root, 3 * t + k)
                elif triangles[other, j] == triangles[t, m]:
                    root[_find(root, 3 * other + j)] = _find(root, 3 * t + m)


@kernel
def _number_corners(
    root: IntArray, bounded: BoolArray, area: FloatArray, number: IntArray
) -> tuple[int, IntArray, BoolArray]:
    """Number the united corners; returns how many, the corner of the largest triangle, whether at bounds."""
    label = np.full(len(root), -1, dtype=np.int32)
    where = np.empty(len(root), dtype=np.int32)
    at_bounds = np.zeros(len(root), dtype=np.bool_)
    count = 0
    for k in range(len(root)):
        r = _find(root, k)
        if label[r] < 0:
            label[r] = count
            where[count] = k
            count += 1
        n = label[r]
        if area[k // 3] > area[where[n] // 3]:
            where[n] = k
        at_bounds[n] = at_bounds[n] or bounded[k]
        number[k // 3, k % 3] = n
    return count, where, at_bounds


@kernel
def _number_middles(neighbour: IntArray, jump: BoolArray, number: IntArray, bounded: BoolArray) -> int:
    """Number the middles of edges (t, 3), one for the two triangles of an edge without a jump."""
    count = 0
    for t in range(len(neighbour)):
        for k in range(3):
            other = neighbour[t, k]
            bounded[t, k] = other < 0 or jump[t, k]
            if not bounded[t, k] and other < t:
                for j in range(3):
                    if neighbour[other, j] == t:
                        number[t, k] = number[other, j]
            else:
                number[t, k] = count
                count += 1
    return count
