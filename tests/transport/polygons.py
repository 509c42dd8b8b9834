"""Polygons for the tests of form factors: tabled ones, and random convex ones from hypothesis."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from hypothesis import strategies as st

from solver.types import FloatArray, Points

REFERENCE: Final = Path(__file__).parents[1] / "data" / "reference"
CASES: Final[list[dict[str, Any]]] = json.loads((REFERENCE / "viewfactors.json").read_text())["cases"]


def cases(kind: str) -> list[dict[str, Any]]:
    """The tabled form factors of one kind."""
    return [case for case in CASES if case["kind"] == kind]


def case(name: str) -> dict[str, Any]:
    """One tabled form factor."""
    return next(case for case in CASES if case["id"] == name)


def array(numbers: Sequence[Any]) -> FloatArray:
    """Numbers that the tables hold as text."""
    return np.array(numbers, dtype=np.float64)


def area_of(polygon: Points) -> float:
    """m2, of a planar convex polygon (n, 3)."""
    spokes = polygon[1:] - polygon[0]
    return 0.5 * float(np.linalg.norm(np.cross(spokes[:-1], spokes[1:]).sum(axis=0)))


def rotation(seed: int) -> FloatArray:
    """A proper rotation (3, 3)."""
    q, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return np.asarray(q * np.sign(np.linalg.det(q)))


def regular(corners: int, radius: float, height: float = 0.0, down: bool = False) -> Points:
    """A regular polygon at a height, facing up or down."""
    angle = 2.0 * np.pi * np.arange(corners) / corners
    ring = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.full(corners, height)], axis=1)
    return ring[::-1].copy() if down else ring


SEEDS: Final = st.integers(0, 2**32 - 1)


@st.composite
def convex_polygons(draw: st.DrawFn, most: int = 4) -> Points:
    """3 to `most` corners on an ellipse of 0.2 to 1 m, anywhere within 2 m of the origin, any way up."""
    corners = draw(st.integers(3, most))
    random = np.random.default_rng(draw(SEEDS))
    gaps = random.uniform(0.3, 1.0, corners)
    angle = 2.0 * np.pi * np.cumsum(gaps) / gaps.sum()
    flat = np.stack([np.cos(angle), np.sin(angle)], axis=1) * random.uniform(0.2, 1.0, 2)
    return np.asarray(flat @ rotation(draw(SEEDS))[:2] + random.uniform(-1.0, 1.0, 3))


def cut(polygon: Points, share: float) -> tuple[Points, Points]:
    """Two convex pieces of a triangle or quadrilateral, by a line from its first edge to its third (or
    to its last corner)."""
    a = (1.0 - share) * polygon[0] + share * polygon[1]
    if len(polygon) == 3:
        return np.stack([polygon[0], a, polygon[2]]), np.stack([a, polygon[1], polygon[2]])
    b = share * polygon[2] + (1.0 - share) * polygon[3]
    return np.stack([polygon[0], a, b, polygon[3]]), np.stack([a, polygon[1], polygon[2], b])


@st.composite
def prisms(draw: st.DrawFn) -> list[Points]:
    """Faces, seen from inside, of a right prism over a convex polygon; boxes among them."""
    corners = draw(st.integers(3, 6))
    random = np.random.default_rng(draw(SEEDS))
    gaps = random.uniform(0.5, 1.0, corners)
    if corners == 4 and draw(st.booleans()):
        gaps = np.array([0.4, 0.6, 0.4, 0.6])
    angle = 2.0 * np.pi * np.cumsum(gaps) / gaps.sum()
    radii = random.uniform(0.3, 1.0, 2)
    base = np.stack([radii[0] * np.cos(angle), radii[1] * np.sin(angle), np.zeros(corners)], axis=1)
    top = base + np.array([0.0, 0.0, draw(st.sampled_from([0.05, 0.5, 3.0]))])
    sides = [np.stack([base[k - 1], top[k - 1], top[k], base[k]]) for k in range(corners)]
    turn = rotation(draw(SEEDS))
    return [face @ turn.T + 0.7 for face in [base, top[::-1], *sides]]
