"""Points that look at sources past blockers: made at random, and asked of the kernels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from solver.types import Points, Vector
from tests.illumination.visible_kernel import PER_BLOCKER, ROOM, visible_factor
from tests.illumination.visible_twin import ON_PLANE, View, normal_of

GUARD: Final = -7.25e77
"""What is written around the buffers that a kernel may use."""

_AXES: Final = np.eye(3)
_APART: Final = 0.01
"""A point is so far from the plane of the source at least, metres."""
_FLAT: Final = 1e-7
"""Twice the area, m2, with which a polygon is none."""
_PLACES: Final = (
    "anywhere", "along", "along", "on an edge", "on a corner", "in the same plane", "in the same place",
    "edge-on",
)  # fmt: skip


def as_seen(view: View, parts: int = 256) -> tuple[float, list[Points]]:
    """The visible form factor, and the visible parts in the world.

    The kernel gets as much memory as it asks for and no more; that it leaves the rest alone is asserted.
    """
    polygons = [*view.blockers, view.source]
    corners = np.array([polygon[[0, 1, 2, -1 if len(polygon) == 4 else 2]] for polygon in polygons])
    counts = np.array([len(polygon) for polygon in polygons], dtype=np.int32)
    normals = np.array([normal_of(polygon) for polygon in polygons])
    room = 2 + PER_BLOCKER * len(view.blockers)
    stack = np.full((room + 4, ROOM, 3), GUARD)
    stack_count = np.full(room + 4, -1, dtype=np.int32)
    stack_next = np.full(room + 4, -1, dtype=np.int32)
    work = np.full((6, ROOM, 3), GUARD)
    pieces = np.full((parts + 1, ROOM, 3), GUARD)
    piece_count = np.zeros(parts + 1, dtype=np.int32)
    factor, found = visible_factor(
        view.x, view.normal, corners[-1], int(counts[-1]), np.arange(len(view.blockers), dtype=np.int32), 0,
        len(view.blockers), corners, counts, normals, ON_PLANE * view.size, stack[:room],
        stack_count[:room], stack_next[:room], work[:5], pieces[:parts], piece_count[:parts],
    )  # fmt: skip
    for rest in (stack[room:], work[5:], pieces[parts:]):
        assert (rest == GUARD).all(), "written outside of what was given"
    assert (stack_count[room:] == -1).all() and (stack_next[room:] == -1).all()
    for buffer in (stack[:room], work[:5], pieces[:parts]):
        assert (buffer[:, ROOM - 1] == GUARD).all(), "no room left for a corner"
    assert found <= parts
    return factor, [pieces[k, : piece_count[k]] + view.x for k in range(found)]


def random_view(random: np.random.Generator, most: int = 6) -> View:
    """A point before a source, and 1 to `most` polygons in all positions to the two and to each other.

    Two in five lie on a lattice, where corners, edges and planes often meet exactly. Blockers may be behind
    the point or the source wholly or in part, reach below the horizon, be edge-on, or be where others are.
    """
    dealer = _Dealer(random, lattice=bool(random.random() < 0.4))
    while True:
        x, source = dealer.point(), dealer.polygon()
        height = float(normal_of(source) @ (x - source[0]))
        if abs(height) > _APART:
            break
    if height < 0.0:
        source = source[::-1]
    blockers: list[Points] = []
    for _ in range(random.integers(1, most + 1)):
        blocker = dealer.blocker(x, source, blockers)
        blockers.append(blocker if random.random() < 0.5 else blocker[::-1])
    normal = dealer.direction()
    if normal @ (source.mean(axis=0) - x) < 0.0 and random.random() < 0.8:
        normal = -normal
    return View(x, normal, source, tuple(blockers))


@dataclass(frozen=True)
class _Dealer:
    random: np.random.Generator
    lattice: bool

    def point(self) -> Vector:
        if self.lattice:
            return np.asarray(self.random.integers(-4, 5, 3) / 4.0)
        return self.random.uniform(-1.0, 1.0, 3)

    def direction(self) -> Vector:
        if self.lattice:
            return np.asarray(_AXES[self.random.integers(3)])
        way = self.random.normal(size=3)
        return np.asarray(way / np.linalg.norm(way))

    def polygon(self) -> Points:
        """A triangle or quadrilateral with an area."""
        if self.lattice and self.random.random() < 0.6:
            u, v = (
                np.roll(_AXES, self.random.integers(3), axis=0)[:2] * self.random.integers(1, 7, (2, 1)) / 4
            )
            return np.asarray(self.point() + np.array([0.0 * u, u, u + v, v])[: self._corners()])
        while True:
            made = np.array([self.point() for _ in range(3)]) if self.lattice else self._inscribed()
            if _doubled_area(made) > _FLAT:
                return made

    def _corners(self) -> int:
        return int(self.random.integers(3, 5))

    def _inscribed(self) -> Points:
        """In an ellipse, one in ten of those 10,000 times as long as wide."""
        gaps = self.random.uniform(0.2, 1.0, self._corners())
        angle = 2.0 * np.pi * np.cumsum(gaps) / gaps.sum()
        wide = self.random.choice([1.0, 0.3, 1e-4], p=[0.6, 0.3, 0.1])
        radii = self.random.uniform(0.1, 1.2) * np.array([1.0, wide])
        frame = np.linalg.qr(self.random.normal(size=(3, 2)))[0].T
        return np.asarray(self.point() + radii * np.stack([np.cos(angle), np.sin(angle)], axis=1) @ frame)

    def blocker(self, x: Vector, source: Points, others: list[Points]) -> Points:
        random, fresh = self.random, self.polygon()
        models = [source, *others]
        model = models[random.integers(len(models))]
        made = fresh
        match random.choice(_PLACES):
            case "along" if not self.lattice:
                # Before the source, or beyond it, or behind the point.
                target = random.dirichlet(np.ones(len(source))) @ source
                made = fresh - fresh.mean(axis=0) + x + random.uniform(-0.5, 1.5) * (target - x)
            case "on an edge":
                third = model[1] + fresh[0] - fresh[1]
                made = np.array([*model[:2], third, third + model[0] - model[1]])[: self._corners()]
            case "on a corner":
                made = fresh + (model[0] - fresh[0])
            case "in the same plane":
                steps = random.integers(-4, 5, (2, 1)) / 4 if self.lattice else random.uniform(-1, 1, (2, 1))
                made = model + (steps * (model[1:3] - model[0])).sum(axis=0)
            case "in the same place":
                made = model
            case "edge-on":
                # The point is at a corner of it, on an edge, or within.
                place = (fresh[0], 0.5 * (fresh[0] + fresh[1]), fresh.mean(axis=0))[random.integers(3)]
                made = fresh + (x - place)
        return made if _doubled_area(made) > _FLAT else fresh


def _doubled_area(triangle: Points) -> float:
    return float(np.linalg.norm(np.cross(triangle[1] - triangle[0], triangle[2] - triangle[0])))
