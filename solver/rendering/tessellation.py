"""From the leaves of a radiosity field to a triangle mesh without cracks.

A leaf is drawn as the polygon of its corners and of all vertices inside its edges, its own patch's and,
along seams, those of other patches. A polygon with none of these is cut along a diagonal, the one whose
ends differ less; with one, it is a fan from that vertex; with more, a fan from a vertex in its middle.
Triangles come patch by patch, so that which of two
patches at one depth is drawn does not depend on how they are divided.

Vertices are shared in a patch. Vertices of different patches on a common seam coincide.

Coordinates are local: centred on the scene and divided by its size, so that float32 keeps its digits
for scenes of any size at any place.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from solver.geometry.surfaces import Surfaces
from solver.kernels import inline_kernel, kernel
from solver.parallel import run_chunks
from solver.rendering.middles import fill_middles
from solver.rendering.outlines import Outlines, outline
from solver.rendering.reconstruction import vertex_irradiance
from solver.transport.field import RadiosityField
from solver.types import LUMINANCE_WEIGHTS, Float32Array, FloatArray, IntArray

_CHUNK: Final = 1 << 14
"""Leaves or vertices of a piece of work"""


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


class Tessellator:
    """Makes meshes for the fields of one scene; what does not change between two fields is kept."""

    def __init__(self, surfaces: Surfaces, before: Tessellator | None = None) -> None:
        """For fields over `surfaces`; `before`, of an earlier revision, may know some of their leaves."""
        self.surfaces = surfaces
        self._field: RadiosityField | None = None
        self._outlines: Outlines | None = None if before is None else before._outlines

    def mesh(self, field: RadiosityField) -> RenderMesh:
        """The mesh of `field`, a field over these surfaces.

        Fields with the same leaves share all but light: least is done where their arrays are the same
        objects. Nobody writes into an array of a field.
        """
        outlines = self._outlines_of(field)
        irradiance, radiance, luminance = _shade(_all_values(field, outlines), outlines)
        return RenderMesh(
            field=field,
            surfaces=self.surfaces,
            position=outlines.position,
            patch=outlines.patch,
            irradiance=irradiance,
            radiance=radiance,
            triangles=_triangulate(outlines, luminance),
            leaf=outlines.leaf,
            leaf_irradiance=field.irradiance.astype(np.float32),
            leaf_radiance=(field.radiosity / np.pi).astype(np.float32),
        )

    def _outlines_of(self, field: RadiosityField) -> Outlines:
        known = self._field
        if self._outlines is None or known is None or not _have_same_leaves(known, field):
            self._outlines = outline(field, self.surfaces, self._outlines)
        self._field = field
        return self._outlines


def _have_same_leaves(a: RadiosityField, b: RadiosityField) -> bool:
    pairs = ((a.patch, b.patch), (a.corner_count, b.corner_count), (a.corners, b.corners))
    return all(one is other or np.array_equal(one, other) for one, other in pairs)


def _all_values(field: RadiosityField, outlines: Outlines) -> FloatArray:
    """Irradiance at all vertices of the mesh, W/m2."""
    blocks, seams = outlines.blocks, outlines.cuts.seams
    means = field.irradiance.take(blocks.order, axis=0)
    values = vertex_irradiance(means, outlines.points)
    # Along an edge, linear: the patch looks as if nobody had cut its border.
    vertex = outlines.connections.topology.vertex
    leaf, slot = seams.edge >> 2, seams.edge & 3
    start = values[vertex[leaf, slot]]
    end = values[vertex[leaf, (slot + 1) % blocks.corner_count[leaf]]]
    on_seams = start + seams.fraction[:, None] * (end - start)
    fans = np.flatnonzero(outlines.middle >= 0)
    in_middles = np.empty((len(fans), 3))
    corners = field.corners[blocks.order[fans]]
    fill_middles(corners, blocks.corner_count[fans], vertex[fans], means[fans], values, in_middles)
    return np.concatenate([values, on_seams, in_middles])


def _shade(values: FloatArray, outlines: Outlines) -> tuple[Float32Array, Float32Array, FloatArray]:
    """Irradiance (v, 3), radiance (v, 3) and the luminance of the irradiance (v,)."""
    surfaces = outlines.surfaces
    irradiance, radiance = np.empty(values.shape, np.float32), np.empty(values.shape, np.float32)
    run_chunks(
        lambda start, stop: _fill_radiance(
            start, stop, outlines.patch, surfaces.emission, surfaces.reflectance, values, irradiance, radiance
        ),
        len(values),
        _CHUNK,
    )
    return irradiance, radiance, values @ LUMINANCE_WEIGHTS


def _triangulate(outlines: Outlines, luminance: FloatArray) -> IntArray:
    """Triangles (t, 3) of all leaves."""
    triangles = np.empty((len(outlines.leaf), 3), dtype=np.int32)
    blocks = outlines.blocks
    run_chunks(
        lambda start, stop: _fill_triangles(
            start, stop, outlines.connections.topology.vertex, blocks.corner_count, outlines.inside_start,
            outlines.inside, outlines.middle, luminance, outlines.first_triangle, triangles,
        ),
        len(blocks.order),
        _CHUNK,
    )  # fmt: skip
    return triangles


@kernel
def _fill_radiance(
    begin: int,
    end: int,
    patch: IntArray,
    emission: FloatArray,
    reflectance: FloatArray,
    values: FloatArray,
    irradiance: Float32Array,
    radiance: Float32Array,
) -> None:
    for i in range(begin, end):
        for c in range(3):
            irradiance[i, c] = values[i, c]
            radiance[i, c] = (emission[patch[i], c] + reflectance[patch[i], c] * values[i, c]) / np.pi


@kernel
def _fill_triangles(
    begin: int,
    end: int,
    vertex: IntArray,
    count: IntArray,
    inside_start: IntArray,
    inside: IntArray,
    middle: IntArray,
    luminance: FloatArray,
    start: IntArray,
    triangles: IntArray,
) -> None:
    for leaf in range(begin, end):
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
