"""Interpolants in the making: what is looked at first, where there is most to gain ([H 3, 4.4.2]).

Every sample starts with the solution's own linear functions, so that there is a picture from the first
moment; point irradiances take their place one batch after the other. A triangle whose six samples are
exact is checked at its middle: what the quadratic misses there is its error, which says which cells to split.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from solver.illumination.interpolation.fit import fit_interpolants
from solver.illumination.interpolation.locating import told_at, triangles_at
from solver.illumination.interpolation.matching import find_places
from solver.illumination.interpolation.mesh import InterpolantMesh
from solver.illumination.interpolation.samples import Samples, in_channels, linear_samples, place_samples
from solver.illumination.meshing.cells import Cells
from solver.illumination.meshing.triangulation import Triangulation
from solver.illumination.points.point_irradiance import PointIrradiance
from solver.transport.pace import Pace
from solver.types import BoolArray, FloatArray, Int64Array, IntArray, Points, Spectra

_MIDDLE: Final = 0.7
"""RMS error of a quadratic over a triangle, relative to that at its middle: of a cubic, half a kink."""

STRAYED: Final = 0.1
"""Change of a sample, relative to itself, that the solution's linear functions may tell in place of a point
irradiance; they are wrong about some hundredths of it."""

_SHADOW: Final = 5.0
"""What moves with a shadow counts so many times: linear functions do not tell where it ends."""

_BATCH: Final = 4096
"""Samples, at most, whose turn is decided at once."""


class Interpolants:
    """The interpolants over one triangulation of a settled solution."""

    def __init__(
        self,
        point: PointIrradiance,
        elements: IntArray,
        cells: Cells,
        triangulation: Triangulation,
        leaf_irradiance: Spectra,
        before: Interpolants | None = None,
    ) -> None:
        """Start from the linear functions of `elements` (leaves,), and from what `before` has sampled."""
        self.cells = cells
        self.triangulation = triangulation
        self.version = 0
        """Counts the changes of the interpolants."""
        self._point = point
        self._elements = elements
        self._leaf_irradiance = leaf_irradiance
        mesh = triangulation
        self._samples: Samples = place_samples(mesh)
        t = len(mesh.triangles)
        vertices = mesh.position[mesh.triangles]
        self.area: FloatArray = 0.5 * np.linalg.norm(
            np.cross(vertices[:, 1] - vertices[:, 0], vertices[:, 2] - vertices[:, 0]), axis=1
        )
        self._middle: Points = vertices.mean(axis=1)
        self._values = linear_samples(mesh, self._samples, elements, point.tree, point.received)
        self._exact = np.zeros(len(self._samples.position), dtype=np.bool_)
        self._strayed = np.zeros(len(self._samples.position))
        """How far exact samples may have strayed from point irradiance since they were, relative"""
        self._checked = np.zeros(t, dtype=np.bool_)
        self._check = np.zeros((t, self._values.shape[1]))
        self._wanted = np.zeros(t)
        self._pace = Pace()
        self._mesh: InterpolantMesh | None = None
        self._expected = np.full(t, np.nan)
        """Error of what triangles have taken from those that were in their place, NaN where there are none"""
        self.evaluations = 0
        """Point irradiances computed."""
        if before is not None:
            self._take_over(before)
        self._error = np.zeros(t)
        self._mean = np.zeros(t)
        self._measure(np.arange(t, dtype=np.int32))
        self.is_between = False
        """Whether all that has been sampled has been checked, too"""
        self._work = self._run()

    # --- what it holds -------------------------------------------------------------------------------

    @property
    def is_fine(self) -> BoolArray:
        """(t,) whether all samples of a triangle are point irradiances."""
        return np.asarray(self._exact[self._samples.node].all(axis=1))

    @property
    def is_checked(self) -> BoolArray:
        """(t,) whether the error of a triangle is known."""
        return self._checked

    def mesh(self) -> InterpolantMesh:
        """The interpolants as they stand; the same object until `version` changes."""
        if self._mesh is None:
            tri = self.triangulation
            self._mesh = InterpolantMesh(
                surfaces=self._point.surfaces,
                position=tri.position,
                patch=tri.vertex_patch,
                triangles=tri.triangles,
                leaf=tri.leaf,
                coefficients=fit_interpolants(self._samples.node, self._values),
                error=self.errors().astype(np.float32),
                is_fine=self.is_fine,
                leaf_irradiance=self._leaf_irradiance,
            )
        return self._mesh

    def errors(self) -> FloatArray:
        """(t,) estimated RMS error of the luminance irradiance over each triangle, W/m2.

        Of triangles not yet checked, what those that were in their place err by, or as much as they curve.
        Who waits for a frame asks often: both this and the mean are kept, and brought up to date for the
        triangles that are worked on.
        """
        return self._error

    def mean_luminance(self) -> FloatArray:
        """(t,) mean luminance irradiance of each triangle, W/m2."""
        return self._mean

    @property
    def samples(self) -> Samples:
        """Where the triangles are sampled."""
        return self._samples

    def sample_points(self) -> tuple[Points, Spectra, BoolArray]:
        """Positions (m, 3), irradiances (m, channels), and which of them are exact (m,)."""
        return self._samples.position, self._values, self._exact

    @property
    def nodes(self) -> IntArray:
        """(t, 6) samples of each triangle."""
        return self._samples.node

    # --- the work ------------------------------------------------------------------------------------

    def want(self, pixels: FloatArray) -> None:
        """Say how many pixels (t,) see each triangle: those come first, in that order."""
        self._wanted = np.maximum(self._wanted, pixels)

    def step(self) -> bool:
        """Work for some milliseconds; False once all that is wanted is sampled and checked."""
        return next(self._work)

    def _run(self) -> Iterator[bool]:
        while True:
            triangles = self._next_triangles()
            if triangles is None:
                yield False
                continue
            self.is_between = False
            nodes = np.unique(self._samples.node[triangles])
            nodes = nodes[~self._exact[nodes]].astype(np.int32)
            leaf = self.triangulation.leaf
            for part in self._pace.batches(np.ones(len(nodes), dtype=np.int64)):
                chosen = nodes[part]
                elements = self._elements[leaf[self._samples.triangle[chosen]]]
                self._values[chosen] = self._point.at(self._samples.position[chosen], elements)
                self._exact[chosen] = True
                self._changed(len(chosen))
                yield True
            self._measure(triangles)
            for part in self._pace.batches(np.ones(len(triangles), dtype=np.int64)):
                chosen = triangles[part]
                elements = self._elements[leaf[chosen]]
                self._check[chosen] = self._point.at(self._middle[chosen], elements)
                self._checked[chosen] = True
                self._measure(chosen)
                self._changed(len(chosen))
                self.is_between = part.stop == len(triangles)
                yield True

    def _next_triangles(self) -> IntArray | None:
        open_ = np.flatnonzero(~self._checked & (self._wanted > 0.0))
        if len(open_) == 0:
            return None
        # Where it shows most: many pixels, and a picture that does not yet know how light runs.
        worth = self._wanted[open_] * (1e-3 + self.errors()[open_] / max(self.mean_luminance().max(), 1e-300))
        best = open_[np.argsort(-worth, kind="stable")[: _BATCH // 4]]
        return best.astype(np.int32)

    def _measure(self, triangles: IntArray) -> None:
        """Find error and mean of some triangles (m,) anew."""
        r = self._values[self._samples.node[triangles]] @ self._point.weights
        middle = (4.0 * r[:, 1::2].sum(axis=1) - r[:, 0::2].sum(axis=1)) / 9.0
        found = _MIDDLE * np.abs(middle - self._check[triangles] @ self._point.weights)
        curved = np.abs(r[:, 1::2] - 0.5 * (r[:, 0::2] + r[:, [2, 4, 0]])).max(axis=1)
        expected = self._expected[triangles]
        untold = np.where(np.isnan(expected), curved, expected)
        self._error[triangles] = np.where(self._checked[triangles], found, untold)
        self._mean[triangles] = r[:, 1::2].mean(axis=1)

    def _changed(self, evaluations: int) -> None:
        self.evaluations += evaluations
        self.version += 1
        self._mesh = None

    def _take_over(self, before: Interpolants) -> None:
        """Keep what has been sampled at the very same places, and what was told between them."""
        mine, theirs = self.triangulation.patch, before.triangulation.patch
        found, at = find_places(
            before._samples.position,
            theirs[before._samples.triangle],
            self._samples.position,
            mine[self._samples.triangle],
        )
        found[found] = before._exact[at[found]]
        self._values[found] = before._values[at[found]]
        self._strayed[found] = before._strayed[at[found]]
        self._exact[found] = True
        found, at = find_places(before._middle, theirs, self._middle, mine)
        found[found] = before._checked[at[found]]
        self._check[found] = before._check[at[found]]
        self._checked[found] = self._exact[self._samples.node[found]].all(axis=1)
        leaf = self.triangulation.leaf
        new = np.flatnonzero(~self._exact)
        triangle, place = triangles_at(
            before.triangulation, self._samples.position[new], leaf[self._samples.triangle[new]]
        )
        self._values[new] = told_at(before.nodes, before._values, triangle, place)
        new = np.flatnonzero(~self._checked)
        triangle, _ = triangles_at(before.triangulation, self._middle[new], leaf[new])
        self._expected[new] = before.errors()[triangle]

    def follow(self, before: Interpolants, number: IntArray, doubt: FloatArray) -> int:
        """Go on from the interpolants of an earlier revision; returns how many samples stand for exact ones.

        number (p,): what each patch was then, -1 where it was not. doubt (leaves,): luminance irradiance,
        W/m2, that has come or gone because something is seen or hidden. Samples change by what the solution's
        own linear functions have changed by, which is right while that is little, and no shadow has moved.
        """
        patch = number[self.triangulation.patch]
        theirs = before.triangulation.patch[before._samples.triangle]
        where = self._samples.position
        found, at = find_places(before._samples.position, theirs, where, patch[self._samples.triangle])
        found[found] = before._exact[at[found]]
        mine, old = np.flatnonzero(found), at[found]
        leaf = self.triangulation.leaf
        values, strayed = self._moved(
            before, before._values[old], before._samples.position[old], before._samples.triangle[old],
            where[mine], self._samples.triangle[mine], doubt,
        )  # fmt: skip
        strayed += before._strayed[old]
        self._values[mine] = values
        good = strayed <= STRAYED
        self._strayed[mine[good]] = strayed[good]
        self._exact[mine[good]] = True
        found, at = find_places(before._middle, before.triangulation.patch, self._middle, patch)
        found[found] = before._checked[at[found]] & self._exact[self._samples.node[found]].all(axis=1)
        mine, old = np.flatnonzero(found), at[found]
        self._check[mine], _ = self._moved(
            before, before._check[old], before._middle[old], old, self._middle[mine], mine, doubt
        )
        self._checked[mine] = True
        self._measure(np.arange(len(leaf), dtype=np.int32))
        return int(good.sum())

    def _moved(
        self,
        before: Interpolants,
        values: Spectra,
        then: Points,
        then_triangle: Int64Array | IntArray,
        now: Points,
        now_triangle: Int64Array | IntArray,
        doubt: FloatArray,
    ) -> tuple[Spectra, FloatArray]:
        """Irradiances (k, channels) of places (k, 3), from earlier ones, and how doubtful (k,) they are."""
        leaf, leaf_then = self.triangulation.leaf[now_triangle], before.triangulation.leaf[then_triangle]
        told = self._point.solved(now, self._elements[leaf])
        change = told - in_channels(before._point.solved(then, before._elements[leaf_then]), told.shape[1])
        values = np.maximum(in_channels(values, told.shape[1]) + change, 0.0)
        change_seen = np.abs(change) @ self._point.weights
        scale = np.maximum(values @ self._point.weights, 1e-300)
        return values, (change_seen + _SHADOW * doubt[leaf]) / scale
