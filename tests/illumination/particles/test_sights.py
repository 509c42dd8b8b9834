"""Maps of what lights see: what is in them, and how they are cut and joined."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from solver.document.samples import load_sample
from solver.illumination.particles.hemisphere import texel_directions
from solver.illumination.particles.receivers import Polygons, Receivers
from solver.illumination.particles.sights import MOST_RESOLUTION, Sights, join_sights, look_around
from tests.illumination.particles.rooms import CEILING_LIGHT, Room, material, polygon, room, room_of, square
from tests.illumination.particles.shining import lamps, shining_of

WHITE = material(0.5)


def sights_of(of: Room, count: int, resolution: int) -> tuple[Polygons, Sights]:
    polygons = Polygons.of(of.surfaces)
    lights = of.block(count)
    return polygons, look_around(of.rays, polygons, shining_of(polygons, lights).frames, resolution)


def assert_same(a: Sights, b: Sights) -> None:
    for name in ("texels", "start", "polygon", "cone"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name))


# --- polygons ---


def test_both_sides_of_a_face_are_one_polygon() -> None:
    """And so are both triangles of a quadrilateral; a triangle repeats its last corner."""
    of = room(
        square("single", WHITE, z=0.0),
        square("double", material(0.5, two_sided=True), z=1.0),
        polygon("triangle", [[0, 0, 2], [1, 0, 2], [0, 1, 2]], WHITE),
    )
    polygons, s = Polygons.of(of.surfaces), of.surfaces
    assert len(polygons) == 3
    assert sorted(polygons.of_triangle.tolist()) == [1, 1, 2, 2, 3]
    front, back = s.triangle_patch.T
    np.testing.assert_array_equal(polygons.of_patch[front], polygons.of_triangle)
    np.testing.assert_array_equal(polygons.of_patch[back[back >= 0]], polygons.of_triangle[back >= 0])
    corners = polygons.corners[1:] * s.size + s.center
    for q in (1, 2, 3):
        height = corners[q - 1] @ polygons.plane[q, :3] - (polygons.plane[q, 3] * s.size + s.center[2])
        np.testing.assert_allclose(height, 0.0, atol=1e-6)
    np.testing.assert_array_equal(corners[polygons.of_triangle[-1] - 1, 3], corners[2, 2])


def test_receivers_can_be_chosen() -> None:
    s = CEILING_LIGHT.surfaces
    polygons = Polygons.of(s)
    positions = np.random.default_rng(1).random((7, 3))
    patch = np.arange(7, dtype=np.int32) % 6
    receivers = Receivers.on(polygons, positions, patch)
    chosen = np.array([5, 0, 5], dtype=np.int32)
    some = receivers.take(chosen)
    assert (len(receivers), len(some)) == (7, 3)
    np.testing.assert_array_equal(some.frame, receivers.frame[:, chosen])
    np.testing.assert_array_equal(some.polygon, polygons.of_patch[patch[chosen]])
    np.testing.assert_allclose(receivers.frame[:3].T * s.size + s.center, positions, atol=1e-6)
    np.testing.assert_array_equal(receivers.frame[3:].T, s.normal[patch].astype(np.float32))


# --- what is seen ---


@pytest.mark.parametrize("name", ["cornell", "office"])
def test_texels_hold_what_rays_meet_first(name: str) -> None:
    of = room_of(load_sample(name))
    resolution = 24
    lights = of.block(8)
    polygons, sights = sights_of(of, 8, resolution)
    shining = shining_of(polygons, lights)
    frames = shining.frames.astype(np.float64)
    table = texel_directions(resolution).astype(np.float64)
    for k in range(len(lights)):
        tangent, other = frames[6:9, k], frames[9:12, k]
        along = table @ np.stack([tangent, other, frames[3:6, k]])
        start = lights.position[k] + of.rays.offset / of.rays.scale * lights.normal[k]
        hit = of.rays.intersect(np.tile(start, (len(along), 1)), along).triangle
        expected = np.where(hit >= 0, polygons.of_triangle[hit], 0)
        seen = sights.polygon[sights.start[k] + sights.texels[k].ravel()]
        # Rays along edges of polygons may be rounded to either side.
        assert np.mean(seen != expected) < 1e-2


def test_each_polygon_has_one_number_and_nothing_is_the_first() -> None:
    of = room_of(load_sample("office"))
    _, sights = sights_of(of, 8, 32)
    for k in range(len(sights)):
        own = sights.polygon[sights.start[k] : sights.start[k + 1]]
        assert own[0] == 0
        assert len(np.unique(own)) == len(own)
        assert set(np.unique(sights.texels[k])) | {0} == set(range(len(own)))


def test_cones_hold_what_is_behind_their_polygons() -> None:
    """A light below a square sees it: what is above it, and on lines through it, is within all planes."""
    of = room(square("floor", WHITE, z=0.0, low=-3.0, high=3.0), square("lid", WHITE, z=1.0, down=True))
    polygons = Polygons.of(of.surfaces)
    lights = lamps(np.array([[0.5, 0.2, 0.0]]), np.array([0.0, 0.0, 1.0]))
    sights = look_around(of.rays, polygons, shining_of(polygons, lights).frames, 16)
    (row,) = np.flatnonzero(sights.polygon == polygons.of_patch[of.surfaces.normal[:, 2] < 0.0])
    cone = sights.cone[row].astype(np.float64)
    random = np.random.default_rng(3)
    points = random.uniform([-2.0, -2.0, 0.1], [3.0, 3.0, 2.0], (500, 3))
    towards = points - lights.position[0]
    crossing = lights.position[0] + towards / towards[:, 2:]
    behind = points[:, 2] > 1.0
    inside = np.all((crossing[:, :2] > 0.0) & (crossing[:, :2] < 1.0), axis=1)
    local = (points - of.surfaces.center) / of.surfaces.size
    np.testing.assert_array_equal(local @ cone[12:15] > cone[15], behind)
    np.testing.assert_array_equal((towards @ cone[:12].reshape(4, 3).T).min(axis=1) >= 0.0, inside)


def test_what_is_seen_edge_on_hides_nothing() -> None:
    """A light on the line in which a wall's plane meets the floor sees nothing behind the wall."""
    wall = polygon("wall", [[0, 0, 0], [0, 1, 0], [0, 1, 1], [0, 0, 1]], material(0.5, two_sided=True))
    of = room(square("floor", WHITE, z=0.0, low=-1.0), wall)
    polygons = Polygons.of(of.surfaces)
    lights = lamps(np.array([[0.0, -0.5, 0.0]]), np.array([0.0, 0.0, 1.0]))
    sights = look_around(of.rays, polygons, shining_of(polygons, lights).frames, 16)
    np.testing.assert_array_equal(sights.cone[:, :15], 0.0)
    np.testing.assert_array_equal(sights.cone[:, 15], 1.0)


# --- parts ---


def test_parts_are_cut_and_joined() -> None:
    of = room_of(load_sample("cornell"))
    _, sights = sights_of(of, 16, 16)
    m = len(sights)
    cuts = [0, 1, 7, 7, m]
    parts = [sights.part(a, b) for a, b in pairwise(cuts)]
    assert [len(part) for part in parts] == [1, 6, 0, m - 7]
    assert_same(join_sights(parts), sights)
    assert_same(join_sights([sights.part(0, m)]), sights)
    # A light's first polygon, nothing, is in each part.
    assert sum(part.nbytes for part in parts) == sights.nbytes + 4 * (len(parts) - 1)


def test_maps_do_not_depend_on_what_else_is_looked_at() -> None:
    of = room_of(load_sample("office"))
    polygons = Polygons.of(of.surfaces)
    shining = shining_of(polygons, of.block(24))
    whole = look_around(of.rays, polygons, shining.frames, 20)
    parts = [look_around(of.rays, polygons, shining.part(k, k + 5).frames, 20) for k in range(0, 30, 5)]
    assert_same(join_sights(parts), whole.part(0, min(30, len(whole))))


def test_without_lights_or_surfaces_there_is_nothing_to_see() -> None:
    polygons, none = sights_of(room(square("floor", WHITE, z=0.0)), 4, 8)
    assert (len(none), len(none.polygon), len(none.start)) == (0, 0, 1)
    empty = room()
    polygons = Polygons.of(empty.surfaces)
    assert len(polygons) == 0
    lights = lamps(np.zeros((2, 3)), np.array([0.0, 0.0, 1.0]))
    sights = look_around(empty.rays, polygons, shining_of(polygons, lights).frames, 8)
    assert not sights.texels.any()
    np.testing.assert_array_equal(sights.polygon, 0)


@pytest.mark.parametrize("resolution", [0, 1, MOST_RESOLUTION + 1])
def test_resolutions_have_limits(resolution: int) -> None:
    polygons = Polygons.of(CEILING_LIGHT.surfaces)
    frames = shining_of(polygons, CEILING_LIGHT.block(1)).frames
    with pytest.raises(ValueError, match="2 to 255"):
        look_around(CEILING_LIGHT.rays, polygons, frames, resolution)
