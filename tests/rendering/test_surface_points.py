"""The points that pixels show, as a list."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from solver.document.samples import load_sample
from solver.geometry.scene import Camera
from solver.geometry.surfaces import Surfaces, flatten
from solver.rendering.projection import Projection, half_extents
from solver.rendering.renderer import FrameRenderer, Layer, Shading
from solver.rendering.surface_points import TILE, SurfacePoints, surface_points
from solver.rendering.tessellation import RenderMesh, Tessellator
from solver.types import FloatArray, Points
from tests.rendering.fields import build_field, camera, polygons, surfaces_of, uneven


def mesh_and_view(name: str, width: int, height: int) -> tuple[RenderMesh, Camera]:
    scene = load_sample(name)
    surfaces = flatten(scene)
    mesh = Tessellator(surfaces).mesh(build_field(surfaces, uneven(7, 3)))
    return mesh, replace(next(iter(scene.cameras.values())), width=width, height=height)


def spread_out(points: SurfacePoints, values: FloatArray) -> FloatArray:
    """An image (h, w, ...) of values (n, ...); NaN where there is no point."""
    width, height = points.size
    image = np.full((height * width, *values.shape[1:]), np.nan)
    image[points.pixel] = values
    return image.reshape(height, width, *values.shape[1:])


def project(position: Points, view: Camera) -> FloatArray:
    """Where in a frame points (n, 3) are: columns and rows (n, 2), whole numbers at middles of pixels."""
    right, up, forward = view.basis()
    across, upwards = half_extents(view)
    apart = position - view.eye
    depth = apart @ forward
    x, y = apart @ right / depth / across, apart @ up / depth / upwards
    return np.stack([0.5 * view.width * (1.0 + x) - 0.5, 0.5 * view.height * (1.0 - y) - 0.5], axis=1)


@pytest.mark.parametrize("name", ["cornell", "office", "robot_cell"])
def test_points_are_those_of_the_position_layer(name: str, renderer: FrameRenderer) -> None:
    mesh, view = mesh_and_view(name, 90, 70)
    surfaces = mesh.surfaces
    points = renderer.surface_points(mesh, view)
    triangle = renderer.draw(mesh, view, Shading.FLAT, Layer.TRIANGLE)
    shown = np.where(triangle >= 0, mesh.patch[mesh.triangles[:, 0]][triangle], -1)
    front = np.einsum("pa,pa->p", view.eye - surfaces.corners[:, 0], surfaces.normal) > 0.0
    patch = spread_out(points, points.patch.astype(float))
    np.testing.assert_array_equal(np.isfinite(patch), (shown >= 0) & front[shown])
    np.testing.assert_array_equal(patch[np.isfinite(patch)], shown[np.isfinite(patch)])
    position = renderer.draw(mesh, view, Shading.FLAT, Layer.POSITION)
    found = spread_out(points, points.position)
    there = np.isfinite(patch)
    np.testing.assert_allclose(found[there], position[there], atol=1e-6 * surfaces.size)
    assert there.mean() > 0.5


@pytest.mark.parametrize("offset", [(0.0, 0.0), (0.4, -0.3), (-0.5, 0.5), (0.0, 0.25)])
def test_offsets_move_the_point_in_its_pixel(offset: tuple[float, float], renderer: FrameRenderer) -> None:
    """Right and down, by parts of a pixel; whatever they then show is what lies there."""
    mesh, view = mesh_and_view("cornell", 61, 40)
    points = renderer.surface_points(mesh, view, offset)
    row, column = np.divmod(points.pixel, view.width)
    expected = np.stack([column + offset[0], row + offset[1]], axis=1)
    np.testing.assert_allclose(project(points.position, view), expected, atol=1e-7)
    s = mesh.surfaces
    above = np.einsum("na,na->n", points.position - s.corners[points.patch, 0], s.normal[points.patch])
    np.testing.assert_allclose(above, 0.0, atol=1e-12 * s.size)
    inside = depth_in(points, s)
    assert np.mean(inside > -1e-6 * s.size) > 0.999


def depth_in(points: SurfacePoints, s: Surfaces) -> FloatArray:
    """How far within the edges of their patches points are; below 0 for those without, metres."""
    corners, normal = s.corners[points.patch], s.normal[points.patch]
    edges = np.roll(corners, -1, axis=1) - corners
    length = np.linalg.norm(edges, axis=2)
    left = np.cross(normal[:, None], edges) / np.maximum(length, 1e-30)[:, :, None]
    height = np.einsum("nka,nka->nk", points.position[:, None] - corners, left)
    return np.asarray(np.where(length > 0.0, height, np.inf).min(axis=1))


@pytest.mark.parametrize("size", [(TILE, TILE), (3 * TILE + 5, 2 * TILE + 7), (7, 40), (1, 1)])
def test_pixels_come_tile_by_tile(size: tuple[int, int], renderer: FrameRenderer) -> None:
    mesh, view = mesh_and_view("cube_room", *size)
    points = renderer.surface_points(mesh, view)
    assert points.size == size
    assert len(points) == size[0] * size[1], "a closed room"
    np.testing.assert_array_equal(np.sort(points.pixel), np.arange(len(points)))
    row, column = np.divmod(points.pixel, size[0])
    tile = row // TILE * -(-size[0] // TILE) + column // TILE
    assert np.all(np.diff(tile) >= 0), "each tile whole before the next"
    within = np.flatnonzero(np.diff(tile) == 0)
    assert np.all(np.diff(points.pixel)[within] > 0), "row by row in a tile"


def test_backs_and_nothing_have_no_points(renderer: FrameRenderer) -> None:
    """Of one-sided faces, seen from below."""
    triangle = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)]
    surfaces = surfaces_of(polygons(triangle))
    mesh = Tessellator(surfaces).mesh(build_field(surfaces, uneven(1, 2)))
    above, below = (camera((0.3, 0.3, z), (0.3, 0.3, 0.0), up=(0.0, 1.0, 0.0)) for z in (2.0, -2.0))
    seen = renderer.surface_points(mesh, above)
    assert 0 < len(seen) < above.width * above.height
    assert len(renderer.surface_points(mesh, below)) == 0


def test_a_patch_seen_edge_on_is_seen_in_its_middle() -> None:
    """Its plane is missed, or met far away: by a patch's own size at most are points off its middle."""
    surfaces = flatten(load_sample("cornell"))
    floor = int(np.argmax((surfaces.normal[:, 1] > 0.9) & (surfaces.corners[:, :, 1].max(axis=1) == 0.0)))
    view = replace(load_sample("cornell").cameras["main"], width=5, height=5)
    level = replace(view, eye=np.array([0.3, 1e-9, -0.8]), target=np.array([0.3, 1e-9, 0.0]))
    projection = Projection.of(level, surfaces)
    rays = projection.rays((5, 5))
    shown = np.full((5, 5), floor, dtype=np.int32)
    points = surface_points(shown, surfaces, projection.eye, rays)
    middle = surfaces.corners[floor].mean(axis=0)
    above = points.pixel // 5 <= 2
    np.testing.assert_allclose(points.position[above], np.tile(middle, (15, 1)), atol=1e-12)
    radius = np.linalg.norm(surfaces.corners[floor] - middle, axis=1).max()
    assert np.linalg.norm(points.position - middle, axis=1).max() <= 2.0 * radius * (1.0 + 1e-9)
    assert np.isfinite(points.position).all()
    none = surface_points(np.full((4, 3), -1, dtype=np.int32), surfaces, projection.eye, rays)
    assert (len(none), none.position.shape) == (0, (0, 3))
