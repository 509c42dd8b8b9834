"""How a form factor varies over its receiver, against dense quadrature."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from solver.geometry.scene import Mesh, SceneObject
from solver.transport.elements import ElementTree
from solver.transport.exchange import exchange_area
from solver.transport.lambert import points_to_polygon
from solver.transport.variation import form_factor_variation, solve_moment
from solver.types import FloatArray, Points
from tests.pathtracing.worlds import material, world
from tests.transport.polygons import area_of

SQUARE = np.array([[-0.5, -0.5, 0], [0.5, -0.5, 0], [0.5, 0.5, 0], [-0.5, 0.5, 0]])
KITE = np.array([[-0.5, -0.6, 0], [0.7, -0.2, 0], [0.4, 0.5, 0], [-0.2, 0.3, 0]])
TRIANGLE = np.array([[-0.5, -0.5, 0], [0.6, -0.3, 0], [0.1, 0.7, 0]])
DOWN = SQUARE[::-1]


@dataclass(frozen=True, eq=False)
class Variation:
    """Mean position of the light on a receiver, m, and the residual of the form factor."""

    position: FloatArray
    residual: float
    mean: float


def tree_of(receiver: Points, source: Points) -> ElementTree:
    objects = [
        SceneObject(name, Mesh(corners, (tuple(range(len(corners))),)), material(0.5))
        for name, corners in (("receiver", receiver), ("source", source))
    ]
    return ElementTree(world(*objects).surfaces)


def told(receiver: Points, source: Points) -> Variation:
    """What the kernel says."""
    t = tree_of(receiver, source)
    scratch, position = np.empty((2, 8, 3)), np.zeros(2)
    ends = [(t.corners[e], t.corner_count[e], t.patch_normal[e], t.area[e]) for e in (0, 1)]
    exchange = exchange_area(*ends[0], *ends[1], 1e-9, 1e-8, scratch)
    residual = form_factor_variation(
        *ends[0][:3], t.axes[0], t.centroid[0], t.moment[0], t.area[0], *ends[1], t.centroid[1], exchange,
        scratch[0], position,
    )  # fmt: skip
    return Variation(position, residual, exchange / float(t.area[0]))


def measured(receiver: Points, source: Points, n: int = 48) -> Variation:
    """The same by n x n Gauss points over each triangle of the receiver."""
    t = tree_of(receiver, source)
    nodes, weights = np.polynomial.legendre.leggauss(n)
    s, r = np.meshgrid(0.5 * (nodes + 1.0), 0.5 * (nodes + 1.0), indexing="ij")
    points, weight = [], []
    for k in range(1, len(receiver) - 1):
        a, b, c = receiver[0], receiver[k], receiver[k + 1]
        points.append((a + s[..., None] * ((b - a) + r[..., None] * (c - b))).reshape(-1, 3))
        weight.append((np.outer(weights, weights) * s).ravel() * area_of(np.stack([a, b, c])))
    x, w = np.concatenate(points), np.concatenate(weight)
    w /= w.sum()
    factor = points_to_polygon(x, np.tile(t.patch_normal[0], (len(x), 1)), source)
    place = (x - t.centroid[0]) @ t.axes[0].T
    mean = float(w @ factor)
    position = (w * factor) @ place / mean
    slope = np.array(solve_moment(t.moment[0], *position))
    rest = factor - mean * (1.0 + place @ slope)
    return Variation(position, float(np.sqrt(w @ rest**2)), mean)


def placed(source: Points, turn: float, at: tuple[float, float, float]) -> Points:
    """The source turned about the y axis by degrees, and moved."""
    c, s = np.cos(np.radians(turn)), np.sin(np.radians(turn))
    return np.asarray(source @ np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]]) + at)


AT_EASE = [
    (20.0, (0.9, 0.4, 2.0)),
    (0.0, (0.3, -0.2, 1.5)),
    (35.0, (-1.5, 1.0, 3.0)),
    (-50.0, (6.0, 2.0, 8.0)),
]


@pytest.mark.parametrize("receiver", [SQUARE, KITE, TRIANGLE], ids=["square", "kite", "triangle"])
@pytest.mark.parametrize(("turn", "at"), AT_EASE)
def test_linear_part_is_that_of_quadrature(
    receiver: Points, turn: float, at: tuple[float, float, float]
) -> None:
    source = placed(DOWN, turn, at)
    found, expected = told(receiver, source), measured(receiver, source)
    assert found.mean == pytest.approx(expected.mean, rel=1e-6)
    size = np.linalg.norm(expected.position)
    assert np.linalg.norm(found.position - expected.position) < 0.12 * size


@pytest.mark.parametrize("receiver", [SQUARE, KITE, TRIANGLE], ids=["square", "kite", "triangle"])
def test_linear_part_gets_exact_with_distance(receiver: Points) -> None:
    """The form factor of a distant source is linear over the receiver."""
    off = []
    for distance in (2.0, 8.0, 32.0):
        source = placed(DOWN, 40.0, (-0.6 * distance, 0.3 * distance, distance))
        found, expected = told(receiver, source), measured(receiver, source)
        off.append(np.linalg.norm(found.position - expected.position) / np.linalg.norm(expected.position))
    assert off[2] < 2e-3
    assert off[2] < 0.3 * off[1] < 0.1 * off[0]


@pytest.mark.parametrize("receiver", [SQUARE, KITE, TRIANGLE], ids=["square", "kite", "triangle"])
@pytest.mark.parametrize(("turn", "at"), [*AT_EASE[:3], (0.0, (0.0, 0.0, 0.7)), (60.0, (1.0, 0.0, 0.6))])
def test_residual_is_of_the_right_size(receiver: Points, turn: float, at: tuple[float, float, float]) -> None:
    source = placed(DOWN, turn, at)
    found, expected = told(receiver, source), measured(receiver, source)
    assert 0.25 < found.residual / expected.residual < 4.0


@pytest.mark.parametrize("side", [0.2, 0.05, 0.01])
@pytest.mark.parametrize("at", [(0.21, 0.13), (0.0, 0.0), (-0.4, 0.4)])
def test_spot_that_all_points_miss_is_known(side: float, at: tuple[float, float]) -> None:
    """A small source close to a large receiver lights a spot: all is residual, or nearly."""
    source = placed(side * DOWN, 0.0, (*at, side))
    found, expected = told(SQUARE, source), measured(SQUARE, source, n=200)
    assert 0.5 < found.residual / expected.residual < 2.0


@pytest.mark.parametrize("receiver", [SQUARE, TRIANGLE], ids=["square", "triangle"])
@pytest.mark.parametrize("distance", [1e-3, 1e-5])
def test_edge_of_light_that_no_point_sees_is_known(receiver: Points, distance: float) -> None:
    """A source lies on nearly all of the receiver: a strip that all points miss is as dark as can be."""
    source = 2.0 * DOWN + np.array([0.0, 0.58, distance])
    found, expected = told(receiver, source), measured(receiver, source, n=200)
    assert 0.9 < expected.mean < 0.99
    assert 0.5 < found.residual / expected.residual < 2.0


def test_symmetric_light_arrives_in_the_middle() -> None:
    found = told(SQUARE, placed(DOWN, 0.0, (0.0, 0.0, 1.3)))
    np.testing.assert_allclose(found.position, 0.0, atol=1e-15)


def test_solve_moment_inverts_the_moments() -> None:
    moment = np.array([0.3, -0.1, 0.2])
    a, b = solve_moment(moment, 0.7, -0.4)
    np.testing.assert_allclose(np.array([[0.3, -0.1], [-0.1, 0.2]]) @ [a, b], [0.7, -0.4])
