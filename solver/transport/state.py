"""What a solve works on: the element tree, the links, and the light on them as functions."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass, field

import numpy as np

from solver.geometry.surfaces import Surfaces
from solver.kernels import kernel
from solver.transport.elements import ElementTree
from solver.transport.links import LinkTable
from solver.transport.pushpull import irradiance, irradiance_in_steps, pull, take_in
from solver.types import LUMINANCE_WEIGHTS, BoolArray, FloatArray, IntArray, Spectra


@dataclass(eq=False)
class TransportState:
    """Elements, links, and linear functions (n, 3, channels) on the n elements.

    Only the rows of leaves are meaningful in `radiosity`.
    """

    surfaces: Surfaces
    tree: ElementTree
    links: LinkTable
    weights: FloatArray
    """(channels,) of luminance"""
    emission: Spectra
    """(p, channels) W/m2, of the patches"""
    reflectance: Spectra
    """(p, channels)"""
    radiosity: FloatArray
    """(n, 3, channels) W/m2, and W/m2 per metre"""
    received: FloatArray
    """(n, 3, channels) irradiance: W/m2, and W/m2 per metre"""
    closure: FloatArray
    """(n,) scale of what each leaf sends and receives"""
    remainder: FloatArray
    """(n, 3) coupling of each leaf with itself"""
    gathers: int = 0
    loss: float = 1.0
    """Least share of any light that one reflection takes away, as far as settling has found out"""
    _rooms: dict[str, FloatArray] = field(default_factory=dict, init=False, repr=False)
    """Arrays of which some of these are the first rows"""

    @staticmethod
    def of(surfaces: Surfaces) -> TransportState:
        """Patches as the first elements; no light has moved, and the ambient term stands for it."""
        n = surfaces.patch_count
        weights, emission, reflectance = shine_of(surfaces)
        radiosity, received = np.zeros((2, n, 3, len(weights)))
        radiosity[:, 0] = emission
        received[:, 0] = ambient(surfaces.area, emission, reflectance)
        return TransportState(
            surfaces=surfaces,
            tree=ElementTree(surfaces),
            links=LinkTable(),
            weights=weights,
            emission=emission,
            reflectance=reflectance,
            radiosity=radiosity,
            received=received,
            closure=np.ones(n),
            remainder=np.zeros((n, 3)),
        )

    @property
    def channels(self) -> int:
        """1 in a grey scene, 3 otherwise."""
        return int(self.emission.shape[1])

    @property
    def nbytes(self) -> int:
        """Bytes held, those of the settling included."""
        return self.tree.nbytes + self.links.nbytes + 7 * self.radiosity.nbytes

    def gather(self, radiosity: FloatArray) -> FloatArray:
        """Irradiance functions (n, 3, channels) from the leaf radiosities (n, 3, channels)."""
        self.gathers += 1
        return irradiance(self.tree, self.links, self.closure, self.remainder, radiosity)

    def gather_in_steps(self, radiosity: FloatArray) -> Generator[None, None, FloatArray]:
        """As `gather`; yields every few milliseconds."""
        self.gathers += 1
        return irradiance_in_steps(self.tree, self.links, self.closure, self.remainder, radiosity)

    def add_received(self, arrived: FloatArray, factor: float = 1.0) -> None:
        """Take in irradiance functions (n, 3, channels) as links bring them to their ends, times `factor`."""
        take_in(self.tree.parent, self.tree.offset, self.closure, factor, arrived, self.received)

    def answering(self) -> FloatArray:
        """Radiosity functions (n, 3, channels) that answer what has been received; of leaves alone right."""
        radiosity = np.empty_like(self.received)
        _answer(self.tree.patch, self.emission, self.reflectance, self.received, radiosity)
        return radiosity

    def split(self, ids: IntArray) -> None:
        """Subdivide leaves; the children start with their parent's light."""
        before = len(self.tree)
        self.tree.split(ids)
        parent = self.tree.parent[before:]
        offset = self.tree.offset[before:]
        for name in ("radiosity", "received"):
            fresh = getattr(self, name)[parent]
            fresh[:, 0] += np.einsum("nk,nkc->nc", offset, fresh[:, 1:])
            self._append(name, fresh)
        self._append("closure", self.closure[parent])
        self._append("remainder", np.zeros((len(parent), 3)))

    def _append(self, name: str, rows: FloatArray) -> None:
        """Let rows follow those of an array, in the same place where there is room behind them."""
        known: FloatArray = getattr(self, name)
        count = len(known) + len(rows)
        room = self._rooms.get(name, known)
        if known.base is not room or len(room) < count:
            room = self._rooms[name] = np.empty((count + count // 8, *known.shape[1:]))
            room[: len(known)] = known
        room[len(known) : count] = rows
        setattr(self, name, room[:count])

    def fold(self, gone: BoolArray) -> None:
        """Let elements (n,) go that have no links; parents whose children go have the light of those."""
        heads = np.flatnonzero((self.tree.child >= 0) & gone[self.tree.child] & ~gone).astype(np.int32)
        for name in ("radiosity", "received"):
            functions: FloatArray = getattr(self, name)
            functions[heads] = linear_functions(self.tree, functions, heads)
        self.closure[heads] = self.closure[self.tree.child[heads]]
        self.tree, number = self.tree.without(gone)
        kept = np.flatnonzero(number >= 0)
        for name in ("radiosity", "received", "closure", "remainder"):
            setattr(self, name, getattr(self, name)[kept])
        self.remainder[number[heads]] = 0.0
        self.links.renumber(number, np.arange(self.tree.patch_count, dtype=np.int32))


@kernel
def _answer(
    patch: IntArray, emission: Spectra, reflectance: Spectra, received: FloatArray, radiosity: FloatArray
) -> None:
    for e in range(len(patch)):
        for c in range(received.shape[2]):
            rho = reflectance[patch[e], c]
            radiosity[e, 0, c] = emission[patch[e], c] + rho * received[e, 0, c]
            radiosity[e, 1, c] = rho * received[e, 1, c]
            radiosity[e, 2, c] = rho * received[e, 2, c]


def linear_functions(tree: ElementTree, functions: FloatArray, elements: IntArray) -> FloatArray:
    """The linear functions (k, 3, channels) closest to those on the leaves below `elements` (k,)."""
    moments = np.empty_like(functions)
    pull(tree.child, tree.child_count, tree.area, tree.moment, tree.offset, functions, moments)
    found = moments[elements]
    uu, uv, vv = (tree.moment[elements, k, None] for k in range(3))
    determinant = uu * vv - uv * uv
    u, v = found[:, 1].copy(), found[:, 2].copy()
    found[:, 1] = (vv * u - uv * v) / determinant
    found[:, 2] = (uu * v - uv * u) / determinant
    return found


def shine_of(surfaces: Surfaces) -> tuple[FloatArray, Spectra, Spectra]:
    """Luminance weights (channels,), emission and reflectance (p, channels); grey has one channel."""
    channels = 1 if surfaces.is_grey else 3
    return (
        np.ones(1) if channels == 1 else LUMINANCE_WEIGHTS,
        np.ascontiguousarray(surfaces.emission[:, :channels]),
        np.ascontiguousarray(surfaces.reflectance[:, :channels]),
    )


def ambient(area: FloatArray, emission: Spectra, reflectance: Spectra) -> FloatArray:
    """Mean irradiance (channels,) of the scene if it were one well-mixed enclosure."""
    total = max(float(area.sum()), 1e-300)
    emitted = (area[:, None] * emission).sum(axis=0) / total
    absorbed = 1.0 - (area[:, None] * reflectance).sum(axis=0) / total
    return np.asarray(emitted / absorbed)
