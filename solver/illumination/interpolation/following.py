"""Interpolants of an earlier revision in the light of the present one, while this is on its way.

What interpolants know beyond the linear functions of their solution, where edges of shadows run and how light
falls off within an element, stays as it was but where an edit moves a shadow. So they are shown with what the
solution's functions have changed by since, told on elements as large as they were. Where something has come
to be seen or hidden all this fades to the functions themselves, which patches that came with an edit show.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from solver.geometry.surfaces import Surfaces
from solver.illumination.interpolation.fit import fit_interpolants
from solver.illumination.interpolation.interpolants import Interpolants
from solver.illumination.interpolation.mesh import InterpolantMesh
from solver.illumination.interpolation.samples import Samples, linear_samples, place_samples
from solver.illumination.meshing.cells import Cells, ConstraintEdges
from solver.illumination.meshing.triangulation import Triangulation, triangulate
from solver.transport.elements import ElementTree
from solver.transport.places import functions_at, leaves_at
from solver.transport.state import TransportState, linear_functions
from solver.types import BoolArray, FloatArray, IntArray, Spectra

FADED: Final = 0.2
"""Irradiance that has come or gone because something is seen or hidden, relative to what is there, at which
nothing is left of what was known beyond the solution's functions."""


_SAME: Final = 0.75
"""An element of more than this part of the area of another at the same place is not a part of it."""


@dataclass(frozen=True, eq=False)
class _Stayed:
    """What is shown of the patches that were there: k samples, t triangles."""

    number: IntArray
    """(p,) what patches were then"""
    tree: ElementTree
    shown: IntArray
    """(k,) samples of the earlier interpolants"""
    elements: IntArray
    """(k,) the leaves that they lie on now"""
    wholes: IntArray
    """(k,) what these are parts of: elements as large as the leaves were then"""
    node: IntArray
    """(t, 6) samples of each triangle, of those shown"""
    triangles: IntArray
    """(t, 3)"""
    patch: IntArray
    """(t,) what their patches are now"""
    vertex_patch: IntArray
    """(v,) the same of vertices"""


@dataclass(frozen=True, eq=False)
class _Fresh:
    """The patches that came since."""

    elements: IntArray
    """(l,) leaves"""
    triangulation: Triangulation
    samples: Samples


@dataclass(frozen=True, eq=False)
class _Shape:
    """Both, of one world, when there were `count` elements."""

    surfaces: Surfaces
    count: int
    stayed: _Stayed
    fresh: _Fresh | None
    node: IntArray
    """(t, 6) samples of each triangle: those shown of what stayed, then those of fresh patches"""
    mesh: InterpolantMesh
    """of these triangles, of which the light is not told"""


class Following:
    """Interpolants that follow a solution."""

    def __init__(self, before: Interpolants, state: TransportState) -> None:
        """`state` is the settled solution that `before` are of, without what links missed."""
        position, values, _ = before.sample_points()
        self._before = before
        self._position = position
        # Of the leaf that is found there now, too, where several meet.
        leaves = leaves_at(state.tree, position, before.triangulation.patch[before.samples.triangle])
        self._told = told = np.maximum(functions_at(state.tree, state.received, position, leaves), 0.0)
        self._area: FloatArray = state.tree.area[leaves]
        self._beyond: Spectra = values - told
        self._stayed: _Stayed | None = None
        self._shape: _Shape | None = None

    def mesh(self, state: TransportState, number: IntArray, doubt: FloatArray) -> InterpolantMesh:
        """The interpolants by the light of `state`, as far as it has come.

        number (p,): what each of its patches was then, -1 where it was not. doubt (n,): luminance irradiance
        of each element, W/m2, that has come or gone because something is seen or hidden.

        Raises TriangulationError where the leaves of fresh patches cannot be triangulated.
        """
        stayed = self._stayed = self._stayed_of(state.tree, number)
        shape = self._shape = self._shape_of(state, stayed)
        where = self._position[stayed.shown]
        now = np.maximum(functions_at(state.tree, state.received, where, stayed.elements), 0.0)
        coarse = np.maximum(functions_at(state.tree, _on_wholes(state, stayed), where, stayed.wholes), 0.0)
        beyond = _in_channels(self._beyond[stayed.shown], now.shape[1])
        told = _in_channels(self._told[stayed.shown], now.shape[1])
        # Where light has gone, so has what was known of it.
        left = np.minimum(coarse / np.maximum(told, 1e-300), 1.0)
        moved = doubt[stayed.elements] / np.maximum(now @ state.weights, 1e-300)
        trusted = np.clip(1.0 - moved / FADED, 0.0, 1.0)[:, None]
        values = np.maximum(now + trusted * (coarse + left * beyond - now), 0.0)
        if shape.fresh is not None:
            fresh = shape.fresh
            own = linear_samples(
                fresh.triangulation, fresh.samples, fresh.elements, state.tree, state.received
            )
            values = np.concatenate([values, own])
        return replace(shape.mesh, coefficients=fit_interpolants(shape.node, values))

    def _stayed_of(self, tree: ElementTree, number: IntArray) -> _Stayed:
        known = self._stayed
        if known is not None and known.tree is tree and np.array_equal(known.number, number):
            # Elements may have been divided since.
            inner = np.flatnonzero(tree.child[known.elements] >= 0)
            if len(inner):
                where = self._position[known.shown[inner]]
                known.elements[inner] = leaves_at(tree, where, known.elements[inner])
            return known
        before = self._before.triangulation
        now = np.full(len(before.triangle_start) - 1, -1, dtype=np.int32)
        stays = np.flatnonzero(number >= 0)
        now[number[stays]] = stays
        patch = now[before.patch]
        kept = np.flatnonzero(patch >= 0)
        used = np.zeros(len(self._position), dtype=np.bool_)
        used[self._before.nodes[kept]] = True
        shown = np.flatnonzero(used).astype(np.int32)
        place = (np.cumsum(used) - 1).astype(np.int32)
        owner = patch[self._before.samples.triangle[shown]]
        elements = leaves_at(tree, self._position[shown], owner)
        return _Stayed(
            number=number,
            tree=tree,
            shown=shown,
            elements=elements,
            wholes=_as_large_as(tree, elements, self._area[shown]),
            node=place[self._before.nodes[kept]],
            triangles=before.triangles[kept],
            patch=patch[kept],
            vertex_patch=np.maximum(now[before.vertex_patch], 0),
        )

    def _shape_of(self, state: TransportState, stayed: _Stayed) -> _Shape:
        """What to draw; the same arrays while elements are the same."""
        tree, surfaces, known = state.tree, state.surfaces, self._shape
        if known is not None and known.stayed is stayed and known.surfaces is surfaces:
            is_same = known.fresh is None or known.count == len(tree)
            if is_same:
                return known
        position, vertex_patch = self._before.triangulation.position, stayed.vertex_patch
        triangles, patch, node = stayed.triangles, stayed.patch, stayed.node
        fresh = _fresh_of(tree, surfaces, stayed.number < 0)
        if fresh is not None:
            added = fresh.triangulation
            triangles = np.concatenate([triangles, added.triangles + np.int32(len(position))])
            position = np.concatenate([position, added.position])
            vertex_patch = np.concatenate([vertex_patch, added.vertex_patch])
            node = np.concatenate([node, fresh.samples.node + np.int32(len(stayed.shown))])
            patch = np.concatenate([patch, added.patch])
        # Which of two patches at one depth is drawn must not depend on which of them is new.
        order = np.argsort(patch, kind="stable")
        t = len(order)
        mesh = InterpolantMesh(
            surfaces=surfaces,
            position=position,
            patch=vertex_patch,
            triangles=triangles[order],
            leaf=np.zeros(t, dtype=np.int32),
            coefficients=np.zeros((t, 6, 3), dtype=np.float32),
            error=np.full(t, np.nan, dtype=np.float32),
            is_fine=np.zeros(t, dtype=np.bool_),
            leaf_irradiance=np.zeros((1, 3)),
        )
        return _Shape(surfaces, len(tree), stayed, fresh, node[order], mesh)


def _as_large_as(tree: ElementTree, elements: IntArray, area: FloatArray) -> IntArray:
    """The elements (k,), or what holds them, of most of `area` (k,), m2, or more where there are such."""
    found = elements.copy()
    while True:
        small = np.flatnonzero((tree.area[found] < _SAME * area) & (tree.parent[found] >= 0))
        if len(small) == 0:
            return found
        found[small] = tree.parent[found[small]]


def _on_wholes(state: TransportState, stayed: _Stayed) -> FloatArray:
    """Irradiance functions (n, 3, channels) on `wholes` (k,), too: the closest where these are divided."""
    divided = np.unique(stayed.wholes[state.tree.child[stayed.wholes] >= 0])
    if len(divided) == 0:
        return state.received
    functions = state.received.copy()
    functions[divided] = linear_functions(state.tree, state.received, divided)
    return functions


def _fresh_of(tree: ElementTree, surfaces: Surfaces, came: BoolArray) -> _Fresh | None:
    """The leaves of patches (p,) that `came`, if any has."""
    leaves = tree.leaves
    elements = leaves[came[tree.patch[leaves]]]
    if len(elements) == 0:
        return None
    known_by = np.arange(len(elements), dtype=np.int32)
    cells = Cells(tree.corners[elements], tree.corner_count[elements], tree.patch[elements], known_by)
    triangulation = triangulate(cells, surfaces, ConstraintEdges.none())
    return _Fresh(elements, triangulation, place_samples(triangulation))


def _in_channels(values: Spectra, channels: int) -> Spectra:
    return values if values.shape[1] == channels else np.repeat(values[:, :1], channels, axis=1)
