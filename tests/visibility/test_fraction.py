"""Visible fractions: without bias, and with a noise that is what it says, against the path tracer.

The same pair is given many times over, as elements of other numbers, whose samples are independent.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest

from solver.geometry.scene import Material, Mesh, Scene, SceneObject
from solver.geometry.surfaces import Surfaces, flatten
from solver.pathtracing import PathTracer
from solver.transport.elements import ElementTree
from solver.types import Points
from solver.visibility.brute_force import visible_fraction
from solver.visibility.fraction import BATCH, VisibleFractions, visible_fractions
from solver.visibility.lifts import ray_lifts
from solver.visibility.pair_rays import STRATA
from solver.visibility.rays import RayScene

SQUARE = np.array([[-0.5, -0.5, 0.0], [0.5, -0.5, 0.0], [0.5, 0.5, 0.0], [-0.5, 0.5, 0.0]])
DOWN = SQUARE[::-1]
COPIES = 3000


def at(polygon: Points, x: float, y: float, z: float, size: float = 1.0) -> Points:
    return np.asarray(size * polygon + np.array([x, y, z]))


@dataclass(frozen=True, eq=False)
class Pair:
    """Two polygons that face each other, and one between them."""

    first: Points
    second: Points
    blocker: Points


WALL = np.array([[0.5, -0.5, 0.0], [0.5, -0.5, 1.0], [0.5, 0.5, 1.0], [0.5, 0.5, 0.0]])
SCREEN = np.array([[0.3, -0.6, 0.0], [0.3, 0.2, 0.0], [0.3, 0.2, 0.3], [0.3, -0.6, 0.3]])
PAIRS = {
    "half": Pair(SQUARE, at(DOWN, 0, 0, 6), np.array([[0, -2, 3], [2, -2, 3], [2, 2, 3], [0, 2, 3.0]])),
    "far": Pair(SQUARE, at(DOWN, 1, 0.5, 6), at(SQUARE, 0.8, 0.3, 2)),
    "small-screen": Pair(SQUARE, at(DOWN, 0, 0, 6), at(SQUARE, 0.1, 0.05, 3, size=0.3)),
    "near": Pair(SQUARE, at(DOWN, 0, 0, 1), at(SQUARE, 0.2, 0.1, 0.5, size=0.6)),
    "touching": Pair(SQUARE, WALL, SCREEN),
    "unequal": Pair(0.2 * SQUARE, at(DOWN, 0, 0, 1, size=3.0), at(SQUARE, 0.3, 0, 0.5, size=0.5)),
    "triangles": Pair(SQUARE[:3], at(DOWN[:3], 0, 0, 1.5), at(SQUARE, 0.2, 0.1, 0.5, size=0.6)),
}


def surfaces_of(*polygons: Points, shining: int = -1) -> Surfaces:
    objects = [
        SceneObject(
            str(k),
            Mesh(np.asarray(polygon, dtype=float), (tuple(range(len(polygon))),)),
            Material(np.zeros(3), np.full(3, float(k == shining))),
        )
        for k, polygon in enumerate(polygons)
    ]
    return flatten(Scene(objects={o.id: o for o in objects}))


def rays_of(surfaces: Surfaces) -> RayScene:
    return RayScene(surfaces.triangles, surfaces.center, surfaces.size)


@cache
def truth(name: str) -> tuple[float, float]:
    """The visible fraction, and its standard error: light that arrives, with the blocker and without."""
    pair = PAIRS[name]
    arrived = []
    for blockers in ([], [pair.blocker]):
        s = surfaces_of(pair.first, pair.second, *blockers, shining=1)
        mean, error = PathTracer(s, rays_of(s)).mean_irradiance(
            s.corners[:1], s.corner_count[:1], np.zeros(1, dtype=np.int32), 1 << 18
        )
        arrived.append((mean[0, 0], error[0, 0]))
    (whole, whole_error), (rest, rest_error) = arrived
    return float(rest / whole), float(np.hypot(rest_error, rest / whole * whole_error) / whole)


def fractions(pair: Pair, samples: int, copies: int = COPIES, blocked: bool = True) -> VisibleFractions:
    """Of `copies` of a pair."""
    s = surfaces_of(pair.first, pair.second)
    tree = ElementTree(s)
    both = np.repeat(np.arange(2, dtype=np.int32), copies)
    p = np.arange(copies, dtype=np.int32)
    world = surfaces_of(pair.first, pair.second, *([pair.blocker] if blocked else []))
    return visible_fractions(
        rays_of(world), p, p + np.int32(copies), tree.corners[both], tree.corner_count[both], tree.area[both],
        tree.patch[both], s.normal, tree.axes, ray_lifts(s.corners, s.normal, s.size), tree.centroid[both],
        tree.moment[both], np.arange(2 * copies), samples,
    )  # fmt: skip


@pytest.mark.parametrize("name", sorted(PAIRS.keys() - {"touching", "half"}))
def test_the_path_tracer_agrees_with_brute_force(name: str) -> None:
    """The yardstick itself, where a grid will do: between ends that do not touch, and no edge on the grid."""
    pair = PAIRS[name]
    triangles = surfaces_of(pair.blocker).triangles
    fraction, error = truth(name)
    assert visible_fraction(pair.first, pair.second, triangles, 16, 1e-9) == pytest.approx(
        fraction, abs=4.0 * error + 0.02
    )


def test_half_is_half() -> None:
    fraction, error = truth("half")
    assert abs(fraction - 0.5) < 4.0 * error
    assert error < 1e-3


@pytest.mark.parametrize("samples", [1, 4])
@pytest.mark.parametrize("name", PAIRS)
def test_fractions_have_no_bias_and_the_noise_they_tell(name: str, samples: int) -> None:
    fraction, error = truth(name)
    found = fractions(PAIRS[name], samples)
    scatter = found.visibility.std() / np.sqrt(COPIES)
    assert abs(found.visibility.mean() - fraction) < 4.0 * np.hypot(scatter, error)
    assert scatter < 0.003
    # Root of the told over the true squared error: within a factor of two.
    told, true = found.noise.mean(), ((found.visibility - fraction) ** 2).mean()
    assert 0.5 < np.sqrt(told / true) < 2.0


@pytest.mark.parametrize("name", PAIRS)
def test_error_falls_with_rays_faster_than_chance(name: str) -> None:
    """Sixteen times the rays: less than a quarter of the error."""
    few, many = (fractions(PAIRS[name], samples, 1000).visibility.std() for samples in (1, 16))
    assert many < 0.25 * few


@pytest.mark.parametrize("name", PAIRS)
def test_what_is_not_blocked_is_seen_whole(name: str) -> None:
    found = fractions(PAIRS[name], 1, 50, blocked=False)
    np.testing.assert_array_equal(found.visibility, 1.0)
    assert np.all(found.noise > 0.0), "a blocker may have been missed"
    assert found.noise.max() < 0.001


def test_what_is_blocked_whole_is_not_seen() -> None:
    pair = Pair(SQUARE, at(DOWN, 0, 0, 1), at(SQUARE, 0, 0, 0.5, size=5.0))
    np.testing.assert_array_equal(fractions(pair, 1, 50).visibility, 0.0)


def test_batches_do_not_matter() -> None:
    """A pair has the same samples in any company."""
    samples = 64
    copies = 2 * (BATCH // (STRATA * samples)) + 3
    whole = fractions(PAIRS["near"], samples, copies)
    assert len(whole.visibility) == copies
    again = fractions(PAIRS["near"], samples, copies)
    np.testing.assert_array_equal(whole.visibility, again.visibility)
    assert len(np.unique(whole.visibility)) > copies / 2
