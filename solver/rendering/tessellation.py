"""From the leaves of a radiosity field to a triangle mesh without cracks.

A leaf is drawn as the polygon of its corners and of all vertices inside its edges, its own patch's and,
along seams, those of other patches. A polygon with none of these is cut along a diagonal, the one whose
ends differ less; with one, it is a fan from that vertex; with more, a fan from a vertex in its middle.
Vertices are shared in a patch. Vertices of different patches on a common seam coincide.

Coordinates are local: centred on the scene and divided by its size, so that float32 keeps its digits
for scenes of any size at any place.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.geometry.surfaces import Surfaces
from solver.illumination.meshing.seams import Seams, cut_borders, find_lines
from solver.illumination.meshing.topology import Topology, connect
from solver.kernels import inline_kernel, kernel
from solver.rendering.middles import fill_middles
from solver.rendering.reconstruction import vertex_irradiance
from solver.transport.field import RadiosityField
from solver.types import LUMINANCE_WEIGHTS, BoolArray, Float32Array, FloatArray, IntArray, Points


@dataclass(frozen=True, eq=False)
class RenderMesh:
    """Triangles over v vertices, for the n leaves of a field."""

    field: RadiosityField
    surfaces: Surfaces
    position: Float32Array
    """(v, 3) local coordinates: (metres - surfaces.center) / surfaces.size"""
    patch: IntArray
    """(v,) patch of each vertex"""
    irradiance: Float32Array
    """(v, 3) W/m2"""
    radiance: Float32Array
    """(v, 3) W/(m2 sr), (E + rho H) / pi"""
    triangles: IntArray
    """(t, 3) vertices, counter-clockwise from the front"""
    leaf: IntArray
    """(t,) leaf of each triangle"""
    leaf_irradiance: Float32Array
    """(n, 3) W/m2"""
    leaf_radiance: Float32Array
    """(n, 3) W/(m2 sr)"""


@dataclass(frozen=True, eq=False)
class _Outlines:
    """The vertices of leaves, with everything inside their edges."""

    topology: Topology
    seams: Seams
    inside_start: IntArray
    """(4 n + 1,)"""
    inside: IntArray
    """Vertices inside edges, in the order of the edge; those from seams follow the topology's"""
    middle: IntArray
    """(n,) the vertex in the middle of a leaf, or -1"""
    position: Float32Array
    patch: IntArray


class Tessellator:
    """Makes meshes for the fields of one scene; what does not change between two fields is kept."""

    def __init__(self, surfaces: Surfaces) -> None:
        self.surfaces = surfaces
        self._lines = find_lines(surfaces)
        self._field: RadiosityField | None = None
        self._outlines: _Outlines | None = None

    def mesh(self, field: RadiosityField) -> RenderMesh:
        """The mesh of `field`, a field over these surfaces."""
        outlines = self._outlines_of(field)
        irradiance = _all_values(field, outlines, vertex_irradiance(field, self.surfaces, outlines.topology))
        triangles, leaf = _triangulate(field, outlines, irradiance)
        reflectance = self.surfaces.reflectance[outlines.patch]
        emission = self.surfaces.emission[outlines.patch]
        return RenderMesh(
            field=field,
            surfaces=self.surfaces,
            position=outlines.position,
            patch=outlines.patch,
            irradiance=irradiance.astype(np.float32),
            radiance=((emission + reflectance * irradiance) / np.pi).astype(np.float32),
            triangles=triangles,
            leaf=leaf,
            leaf_irradiance=field.irradiance.astype(np.float32),
            leaf_radiance=(field.radiosity / np.pi).astype(np.float32),
        )

    def _outlines_of(self, field: RadiosityField) -> _Outlines:
        known = self._field
        if (
            self._outlines is None
            or known is None
            or not np.array_equal(known.patch, field.patch)
            or not np.array_equal(known.corners, field.corners)
        ):
            topology = connect(field)
            seams = cut_borders(topology, field, self.surfaces, self._lines)
            self._outlines = _outline(field, self.surfaces, topology, seams)
        self._field = field
        return self._outlines


def _outline(field: RadiosityField, surfaces: Surfaces, topology: Topology, seams: Seams) -> _Outlines:
    n, v, s = len(field.patch), len(topology.position), len(seams.edge)
    # An edge has vertices from its own patch or from a seam, never both: sorting by edge joins them.
    own = np.diff(topology.inside_start)
    edge = np.concatenate([np.repeat(np.arange(4 * n, dtype=np.int32), own), seams.edge])
    vertex = np.concatenate([topology.inside, np.arange(v, v + s, dtype=np.int32)])
    inside_start = np.zeros(4 * n + 1, dtype=np.int32)
    np.cumsum(np.bincount(edge, minlength=4 * n), out=inside_start[1:])
    extra = inside_start[4::4] - inside_start[:-1:4]
    has_middle = extra > 1
    middle = np.full(n, -1, dtype=np.int32)
    middle[has_middle] = np.arange(v + s, v + s + np.count_nonzero(has_middle), dtype=np.int32)
    position = np.concatenate([topology.position, seams.position, _middles(field, has_middle)])
    patch = np.empty(len(topology.position), dtype=np.int32)
    patch[topology.vertex] = field.patch[:, None]
    return _Outlines(
        topology=topology,
        seams=seams,
        inside_start=inside_start,
        inside=vertex[np.argsort(edge, kind="stable")],
        middle=middle,
        position=((position - surfaces.center) / surfaces.size).astype(np.float32),
        patch=np.concatenate([patch, field.patch[seams.edge >> 2], field.patch[has_middle]]),
    )


def _middles(field: RadiosityField, chosen: BoolArray) -> Points:
    """Middles of the leaves that are `chosen`."""
    corners, count = field.corners[chosen], field.corner_count[chosen]
    total = corners.sum(axis=1)
    total[count == 3] -= corners[count == 3, 3]
    return np.asarray(total / count[:, None])


def _all_values(field: RadiosityField, outlines: _Outlines, values: FloatArray) -> FloatArray:
    """Irradiance at all vertices of the mesh, from that at the topology's."""
    vertex, seams = outlines.topology.vertex, outlines.seams
    # Along an edge, linear: the patch looks as if nobody had cut its border.
    leaf, slot = seams.edge >> 2, seams.edge & 3
    start = values[vertex[leaf, slot]]
    end = values[vertex[leaf, (slot + 1) % field.corner_count[leaf]]]
    on_seams = start + seams.fraction[:, None] * (end - start)
    chosen = np.flatnonzero(outlines.middle >= 0)
    in_middles = np.empty((len(chosen), 3))
    fill_middles(
        field.corners[chosen],
        field.corner_count[chosen],
        vertex[chosen],
        field.irradiance[chosen],
        values,
        in_middles,
    )
    return np.concatenate([values, on_seams, in_middles])


def _triangulate(
    field: RadiosityField, outlines: _Outlines, irradiance: FloatArray
) -> tuple[IntArray, IntArray]:
    """Triangles (t, 3) of all leaves, and the leaf of each."""
    extra = outlines.inside_start[4::4] - outlines.inside_start[:-1:4]
    pieces = field.corner_count + extra - np.where(outlines.middle < 0, np.int32(2), np.int32(0))
    start = np.zeros(len(pieces) + 1, dtype=np.int32)
    np.cumsum(pieces, out=start[1:])
    triangles = np.empty((int(start[-1]), 3), dtype=np.int32)
    _fill_triangles(
        outlines.topology.vertex,
        field.corner_count,
        outlines.inside_start,
        outlines.inside,
        outlines.middle,
        irradiance @ LUMINANCE_WEIGHTS,
        start,
        triangles,
    )
    return triangles, np.repeat(np.arange(len(pieces), dtype=np.int32), pieces)


@kernel
def _fill_triangles(
    vertex: IntArray,
    count: IntArray,
    inside_start: IntArray,
    inside: IntArray,
    middle: IntArray,
    luminance: FloatArray,
    start: IntArray,
    triangles: IntArray,
) -> None:
    for leaf in range(len(count)):
        at = start[leaf]
        corners = count[leaf]
        extra = inside_start[4 * leaf + 4] - inside_start[4 * leaf]
        a = vertex[leaf, 0]
        b = vertex[leaf, 1]
        c = vertex[leaf, 2]
        d = vertex[leaf, 3]
        if extra == 0 and corners == 3:
            _put(triangles, at, a, b, c)
        elif extra == 0:
            # Cut along the diagonal whose ends differ less.
            if abs(luminance[a] - luminance[c]) <= abs(luminance[b] - luminance[d]):
                _put(triangles, at, a, b, c)
                _put(triangles, at + 1, a, c, d)
            else:
                _put(triangles, at, b, c, d)
                _put(triangles, at + 1, b, d, a)
        elif extra == 1:
            # A fan from the vertex inside edge k to all edges but k.
            apex = inside[inside_start[4 * leaf]]
            k = 0
            while inside_start[4 * leaf + k + 1] == inside_start[4 * leaf]:
                k += 1
            for i in range(1, corners):
                _put(
                    triangles, at, apex, vertex[leaf, (k + i) % corners], vertex[leaf, (k + i + 1) % corners]
                )
                at += 1
        else:
            # A fan from the middle to all pieces of all edges.
            for k in range(corners):
                previous = vertex[leaf, k]
                for i in range(inside_start[4 * leaf + k], inside_start[4 * leaf + k + 1]):
                    _put(triangles, at, middle[leaf], previous, inside[i])
                    previous = inside[i]
                    at += 1
                _put(triangles, at, middle[leaf], previous, vertex[leaf, (k + 1) % corners])
                at += 1


@inline_kernel
def _put(triangles: IntArray, at: int, a: int, b: int, c: int) -> None:
    triangles[at, 0] = a
    triangles[at, 1] = b
    triangles[at, 2] = c
