"""Interpolants of an earlier revision in the light of the present one, while this is on its way.

What interpolants know beyond the linear functions of their solution, where edges of shadows run and how light
falls off within an element, stays as it was but where an edit moves a shadow. So they are shown with what the
solution's functions have changed by since, told on elements as large as they were. Where much has come to be
seen or hidden they are of no use any more, and elements are to be shown, as on patches that are new.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from solver.illumination.interpolation.fit import fit_interpolants
from solver.illumination.interpolation.interpolants import Interpolants
from solver.illumination.interpolation.samples import in_channels
from solver.kernels import kernel
from solver.transport.elements import ElementTree
from solver.transport.places import functions_at, leaves_at
from solver.transport.state import TransportState, linear_functions
from solver.types import BoolArray, Float32Array, FloatArray, IntArray, Spectra

FADED: Final = 0.2
"""Irradiance that has come or gone because something is seen or hidden, relative to what is there, at which
nothing is left of what was known beyond the solution's functions, and elements are shown."""

_SAME: Final = 0.75
"""An element of more than this part of the area of another at the same place is not a part of it."""


@dataclass(frozen=True, eq=False)
class Followed:
    """What is to be shown of a solution, t triangles and all elements besides; n elements."""

    triangles: IntArray
    """(t,) those of the earlier interpolants"""
    patch: IntArray
    """(t,) the patches that these lie on now"""
    coefficients: Float32Array
    """(t, 6, 3) as those of `InterpolantMesh`"""
    by_elements: BoolArray
    """(n,) elements that are shown themselves, if they are leaves"""


@dataclass(frozen=True, eq=False)
class _Stayed:
    """Patches that were there before: k samples, t triangles."""

    number: IntArray
    """(p,) what patches were then, -1 for those that came"""
    tree: ElementTree
    shown: IntArray
    """(k,) samples of the earlier interpolants"""
    wholes: IntArray
    """(k,) elements that they lie on, as large as the leaves were then"""
    triangles: IntArray
    """(t,) triangles of the earlier interpolants"""
    node: IntArray
    """(t, 6) samples of each, of those shown"""
    triangle_wholes: IntArray
    """(t,) elements that triangles lie on"""


class Following:
    """Interpolants that follow a solution."""

    def __init__(self, before: Interpolants, state: TransportState) -> None:
        """`state` is the settled solution that `before` are of, without what links missed."""
        tree, mesh = state.tree, before.triangulation
        self._before = before
        self._version = before.version
        self._position, values, _ = before.sample_points()
        # Of the leaf that is found there now, too, where several meet.
        leaves = leaves_at(tree, self._position, mesh.patch[before.samples.triangle])
        self._told = np.maximum(functions_at(tree, state.received, self._position, leaves), 0.0)
        self._beyond: Spectra = values - self._told
        self._area: FloatArray = tree.area[leaves]
        self._middle = mesh.position[mesh.triangles].mean(axis=1)
        self._triangle_area: FloatArray = tree.area[leaves_at(tree, self._middle, mesh.patch)]
        self._stayed: _Stayed | None = None

    @property
    def interpolants(self) -> Interpolants:
        """What follows."""
        return self._before

    def is_of(self, interpolants: Interpolants) -> bool:
        """Whether what follows is `interpolants` as they stand."""
        return interpolants is self._before and interpolants.version == self._version

    def follow(self, state: TransportState, number: IntArray, doubt: FloatArray) -> Followed:
        """What is to be shown by the light of `state`, as far as it has come.

        number (p,): what each of its patches was then, -1 where it was not. doubt (n,): luminance irradiance
        of each element, W/m2, that has come or gone because something is seen or hidden.
        """
        stayed = self._stayed = self._stayed_of(state.tree, number)
        moved = _greatest(state.tree, doubt, state.received[:, 0] @ state.weights)
        now = functions_at(state.tree, _on_wholes(state, stayed), self._position[stayed.shown], stayed.wholes)
        now = np.maximum(now, 0.0)
        beyond = in_channels(self._beyond[stayed.shown], now.shape[1])
        told = in_channels(self._told[stayed.shown], now.shape[1])
        # Where light has gone, so has what was known of it.
        left = np.minimum(now / np.maximum(told, 1e-300), 1.0)
        left *= np.maximum(1.0 - moved[stayed.wholes] / FADED, 0.0)[:, None]
        values = np.maximum(now + left * beyond, 0.0)
        by_elements = (number < 0)[state.tree.patch]
        by_elements[stayed.triangle_wholes] |= moved[stayed.triangle_wholes] >= FADED
        kept = np.flatnonzero(~by_elements[stayed.triangle_wholes])
        _hand_down(state.tree.parent, by_elements)
        return Followed(
            triangles=stayed.triangles[kept],
            patch=state.tree.patch[stayed.triangle_wholes[kept]],
            coefficients=fit_interpolants(stayed.node[kept], values),
            by_elements=by_elements,
        )

    def _stayed_of(self, tree: ElementTree, number: IntArray) -> _Stayed:
        known = self._stayed
        if known is not None and known.tree is tree and np.array_equal(known.number, number):
            return known
        before = self._before.triangulation
        now = np.full(len(before.triangle_start) - 1, -1, dtype=np.int32)
        stays = np.flatnonzero(number >= 0)
        now[number[stays]] = stays
        patch = now[before.patch]
        triangles = np.flatnonzero(patch >= 0).astype(np.int32)
        used = np.zeros(len(self._position), dtype=np.bool_)
        used[self._before.nodes[triangles]] = True
        shown = np.flatnonzero(used).astype(np.int32)
        place = (np.cumsum(used) - 1).astype(np.int32)
        owner = patch[self._before.samples.triangle[shown]]
        leaves = leaves_at(tree, self._position[shown], owner)
        triangle_leaves = leaves_at(tree, self._middle[triangles], patch[triangles])
        return _Stayed(
            number=number,
            tree=tree,
            shown=shown,
            wholes=_as_large_as(tree, leaves, self._area[shown]),
            triangles=triangles,
            node=place[self._before.nodes[triangles]],
            triangle_wholes=_as_large_as(tree, triangle_leaves, self._triangle_area[triangles]),
        )


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


def _greatest(tree: ElementTree, doubt: FloatArray, light: FloatArray) -> FloatArray:
    """The greatest `doubt` over each element (n,), relative to the `light` of leaves, both W/m2."""
    found = doubt / np.maximum(light, 1e-300)
    _pull_greatest(tree.parent, tree.child, found)
    return found


@kernel
def _pull_greatest(parent: IntArray, child: IntArray, found: FloatArray) -> None:
    for e in range(len(parent)):
        if child[e] >= 0:
            found[e] = 0.0
    for e in range(len(parent) - 1, -1, -1):
        if parent[e] >= 0:
            found[parent[e]] = max(found[parent[e]], found[e])


@kernel
def _hand_down(parent: IntArray, marked: BoolArray) -> None:
    """Mark what is part of elements that are marked."""
    for e in range(len(parent)):
        if parent[e] >= 0 and marked[parent[e]]:
            marked[e] = True
