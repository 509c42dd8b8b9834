"""The outlines of leaves, with all vertices inside their edges: what a mesh is before light falls on it.

Vertices of the mesh are those that leaves share in their patch, then those that borders take in from other
patches, then the middles of leaves that are drawn as fans.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.geometry.surfaces import Surfaces
from solver.kernels import kernel
from solver.rendering.connections import Connections
from solver.rendering.leaf_blocks import LeafBlocks, earlier_patches
from solver.rendering.plane_points import PlanePoints, plane_points
from solver.rendering.seam_cuts import SeamCuts
from solver.transport.field import RadiosityField
from solver.types import Corners, Float32Array, IntArray, Points


@dataclass(frozen=True, eq=False)
class Outlines:
    """The outlines of n leaves, patch by patch, with v vertices."""

    surfaces: Surfaces
    blocks: LeafBlocks
    connections: Connections
    points: PlanePoints
    cuts: SeamCuts
    inside_start: IntArray
    """(4 n + 1,)"""
    inside: IntArray
    """Vertices inside edges, in the order of the edge; those from seams follow the topology's"""
    middle: IntArray
    """(n,) the vertex in the middle of a leaf, or -1"""
    position: Float32Array
    """(v, 3) local coordinates: (metres - surfaces.center) / surfaces.size"""
    patch: IntArray
    """(v,)"""
    first_triangle: IntArray
    """(n + 1,) where the triangles of each leaf begin"""
    leaf: IntArray
    """(t,) the field's leaf of each triangle"""


def outline(field: RadiosityField, surfaces: Surfaces, before: Outlines | None) -> Outlines:
    """The outlines of the leaves of `field`, with what is as it was `before` taken over."""
    blocks = LeafBlocks.of(field, surfaces.patch_count)
    if before is None:
        earlier = np.full(surfaces.patch_count, -1, dtype=np.int32)
        known, connections = LeafBlocks.none(), Connections.of(LeafBlocks.none())
    else:
        earlier = earlier_patches(surfaces, before.surfaces)
        known, connections = before.blocks, before.connections
    earlier = blocks.as_before(known, earlier)
    connections = connections.updated(blocks, earlier)
    cuts = SeamCuts.of(blocks, connections, surfaces, None if before is None else before.cuts, earlier)
    topology, seams = connections.topology, cuts.seams
    n, v, s = len(blocks.patch), len(topology.position), len(seams.edge)
    inside_start = np.empty(4 * n + 1, dtype=np.int32)
    inside = np.empty(len(topology.inside) + s, dtype=np.int32)
    middle, first_triangle = np.empty(n, dtype=np.int32), np.empty(n + 1, dtype=np.int32)
    _join_insides(
        blocks.corner_count, topology.inside_start, topology.inside, seams.edge, v,
        inside_start, inside, middle, first_triangle,
    )  # fmt: skip
    fans = np.flatnonzero(middle >= 0)
    centres = _middles(blocks.field.corners[blocks.order[fans]], blocks.corner_count[fans])
    position = np.concatenate([topology.position, seams.position, centres])
    position -= surfaces.center
    position /= surfaces.size
    patches = np.arange(surfaces.patch_count, dtype=np.int32)
    return Outlines(
        surfaces=surfaces,
        blocks=blocks,
        connections=connections,
        points=plane_points(blocks, surfaces, topology),
        cuts=cuts,
        inside_start=inside_start,
        inside=inside,
        middle=middle,
        position=position.astype(np.float32),
        patch=np.concatenate(
            [
                np.repeat(patches, np.diff(connections.start[1])),
                blocks.patch[seams.edge >> 2],
                blocks.patch[fans],
            ]
        ),
        first_triangle=first_triangle,
        leaf=np.repeat(blocks.order, np.diff(first_triangle)),
    )


def _middles(corners: Corners, count: IntArray) -> Points:
    """Middles of leaves."""
    total = corners.sum(axis=1)
    total[count == 3] -= corners[count == 3, 3]
    return np.asarray(total / count[:, None])


@kernel
def _join_insides(
    count: IntArray,
    own_start: IntArray,
    own: IntArray,
    seam_edge: IntArray,
    vertices: int,
    inside_start: IntArray,
    inside: IntArray,
    middle: IntArray,
    first_triangle: IntArray,
) -> None:
    """List what is inside edges, from their own patch and from seams; number middles and triangles.

    An edge has vertices from its own patch or from a seam, never both.
    """
    at = 0
    seam = 0
    triangle = 0
    next_middle = vertices + len(seam_edge)
    for leaf in range(len(count)):
        first_triangle[leaf] = triangle
        begin = at
        for edge in range(4 * leaf, 4 * leaf + 4):
            inside_start[edge] = at
            for i in range(own_start[edge], own_start[edge + 1]):
                inside[at] = own[i]
                at += 1
            while seam < len(seam_edge) and seam_edge[seam] == edge:
                inside[at] = vertices + seam
                at += 1
                seam += 1
        triangle += count[leaf] + at - begin
        if at - begin > 1:
            middle[leaf] = next_middle
            next_middle += 1
        else:
            middle[leaf] = -1
            triangle -= 2
    inside_start[4 * len(count)] = at
    first_triangle[len(count)] = triangle
