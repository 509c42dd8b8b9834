"""What a point sees of its sources, against projections and the light that it receives."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from solver.illumination.points.backprojection import Backprojection, backproject
from solver.illumination.points.point_irradiance import PointIrradiance
from solver.transport.solve import RadiositySolver
from solver.types import Points, Vector
from tests.illumination.visible_twin import View, normal_of, source_region, visible_region
from tests.pathtracing.worlds import material, polygon, square, world
from tests.transport.polygons import area_of
from tests.transport.solving import box, shelf, solved

UP = np.array([0.0, 0.0, 1.0])


def point_of(solver: RadiositySolver) -> PointIrradiance:
    return PointIrradiance.of(solver.state, solver.hierarchy)


def shining(point: PointIrradiance, x: Vector, normal: Vector) -> Backprojection:
    """What is seen of the patches that light comes from."""
    bright = point.light.luminance[: point.surfaces.patch_count] > 0.0
    patches = np.flatnonzero(bright).astype(np.int32)
    return backproject(point.surfaces, point.hierarchy, x, normal, patches)


def views(point: PointIrradiance, seen: Backprojection, x: Vector, normal: Vector) -> list[View]:
    """The same for the twin: each source past all other patches."""
    s = point.surfaces
    polygons = [s.corners[p, : s.corner_count[p]] for p in range(s.patch_count)]
    return [
        View(x, normal, polygons[p], tuple(polygon for q, polygon in enumerate(polygons) if q != p))
        for p in seen.patch.tolist()
    ]


@pytest.mark.parametrize("seed", range(3))
def test_pieces_tile_what_a_projection_leaves(seed: int) -> None:
    random = np.random.default_rng(seed)
    block = box("block", 0.0, 0.3, (0.4, 0.3, 0.2), (0.6, 0.5, 0.7), inward=False)
    point = point_of(solved(world(*shelf().scene, block), 0.3))
    x = random.uniform(0.02, 0.18, 3)
    normal = random.normal(size=3)
    normal /= np.linalg.norm(normal)
    seen = shining(point, x, normal)
    assert len(seen) >= 3
    hidden = 0
    for k, view in enumerate(views(point, seen, x, normal)):
        whole, left = source_region(view), visible_region(view)
        outline = shapely.Polygon(whole.flat(seen.source(k)))
        assert outline.symmetric_difference(whole.shape).area < 1e-12
        shapes = [shapely.Polygon(left.flat(piece)) for piece in seen.visible(k)]
        assert shapely.union_all(shapes, grid_size=1e-13).symmetric_difference(left.shape).area < 1e-11
        visible_area = sum(map(area_of, seen.visible(k)))
        assert visible_area == pytest.approx(left.shape.area, abs=1e-11)
        # Visible and hidden parts are what is above the horizon.
        assert visible_area + seen.hidden[k] * area_of(seen.source(k)) == pytest.approx(
            whole.shape.area, abs=1e-11
        )
        assert seen.visible_factor[k] == pytest.approx(left.factor(x, normal), abs=1e-10)
        assert seen.factor[k] == pytest.approx(whole.factor(x, normal), abs=1e-10)
        hidden += seen.hidden[k] > 1e-6
    assert hidden > 0


def test_light_is_what_is_seen() -> None:
    """Lamps alone: form factors of what is visible, times emission, are the irradiance."""
    objects = [
        square("lamp", material(0.0, 3.0), 1.0, down=True),
        square("dim", material(0.0, 0.5, True), 0.7, down=True, low=-0.3, high=0.4),
        square("board", material(0.0), 0.5, low=0.3, high=0.6),
        square("floor", material(0.0), 0.0),
    ]
    point = point_of(solved(world(*objects), 0.5))
    emission = point.emission[:, 0]
    for x in ([0.1, 0.2, 0.0], [0.45, 0.45, 0.0], [0.9, 0.3, 0.2], [0.2, 0.2, 0.69]):
        at = np.array(x)
        seen = shining(point, at, UP)
        assert np.all(emission[seen.patch] > 0.0)
        received = point.anywhere(at[None], UP[None])[0, 0]
        assert seen.visible_factor @ emission[seen.patch] == pytest.approx(received, rel=1e-12)


def test_what_is_hidden_and_what_is_whole() -> None:
    objects = [
        square("lamp", material(0.0, 1.0), 1.0, down=True, low=0.2, high=0.4),
        square("other", material(0.0, 1.0), 1.0, down=True, low=0.7, high=0.8),
        square("board", material(0.0), 0.5, low=0.1, high=0.5),
    ]
    point = point_of(solved(world(*objects), 0.5))
    seen = shining(point, np.array([0.3, 0.3, 0.0]), UP)
    assert seen.patch.tolist() == [0, 1]
    assert seen.hidden.tolist() == [1.0, 0.0]
    assert seen.visible(0) == []
    assert seen.visible_factor[0] == 0.0
    (piece,) = seen.visible(1)
    np.testing.assert_allclose(normal_of(piece), -UP, atol=1e-12)
    np.testing.assert_allclose(piece.mean(axis=0), [0.75, 0.75, 1.0])
    assert seen.visible_factor[1] == pytest.approx(seen.factor[1], rel=1e-12)


def test_sources_below_the_horizon_and_backs_are_none() -> None:
    point = point_of(solved(shelf(), 0.3))
    assert len(shining(point, np.array([0.5, 0.5, 2.0]), UP)) == 0
    # The back of the ceiling is in the way of the rest.
    from_above = shining(point, np.array([0.5, 0.5, 2.0]), -UP)
    assert 1 not in from_above.patch
    assert np.all(from_above.hidden == 1.0)
    floor = shining(point, np.array([0.5, 0.5, 0.0]), UP)
    heights = [floor.source(k)[:, 2].min() for k in range(len(floor))]
    assert min(heights) >= 0.0


def test_more_pieces_than_there_is_room_for_at_first() -> None:
    """Grids of boards before one another leave a thousand holes and more."""
    bars: list[Points] = []
    for k in np.arange(80) / 80.0:
        bars.append(np.array([[k, 0.0, 0.5], [k + 0.005, 0.0, 0.5], [k + 0.005, 1.0, 0.5], [k, 1.0, 0.5]]))
        bars.append(np.array([[0.0, k, 0.6], [1.0, k, 0.6], [1.0, k + 0.005, 0.6], [0.0, k + 0.005, 0.6]]))
    lamp = square("lamp", material(0.0, 1.0), 1.0, down=True, low=0.0, high=1.0)
    built = world(lamp, *(polygon(f"bar{k}", bar, material(0.0)) for k, bar in enumerate(bars)))
    point = point_of(solved(built, 0.5))
    x = np.array([0.51, 0.47, 0.0])
    seen = shining(point, x, UP)
    assert len(seen.pieces) > 1024
    (view,) = views(point, seen, x, UP)
    assert seen.visible_factor[0] == pytest.approx(visible_region(view).factor(x, UP), abs=1e-9)
    assert 0.2 < seen.hidden[0] < 0.9
