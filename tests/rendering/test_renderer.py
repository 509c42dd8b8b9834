"""Frames against ray casting, and the rules of what is seen."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from solver.document.samples import load_sample, sample_names
from solver.errors import LimitExceededError, SceneError
from solver.geometry.scene import Camera, Scene
from solver.geometry.surfaces import Surfaces, flatten
from solver.rendering import passes
from solver.rendering.device import GlDevice
from solver.rendering.geometry_layers import rays
from solver.rendering.projection import pixel_pattern
from solver.rendering.renderer import FrameRenderer, Layer, Shading
from solver.rendering.tessellation import RenderMesh, Tessellator
from solver.transport.field import RadiosityField
from solver.types import LUMINANCE_WEIGHTS, FloatArray, IntArray
from solver.visibility.rays import RayScene
from tests.rendering.fields import (
    SQUARE,
    build_field,
    camera,
    constant,
    even,
    linear,
    polygons,
    surfaces_of,
    uneven,
)

LOOK_DOWN = camera((0.4, 0.5, 1.5), (0.5, 0.5, 0.0), up=(0.0, 1.0, 0.0))
LOOK_UP = camera((0.4, 0.5, -1.5), (0.5, 0.5, 0.0), up=(0.0, 1.0, 0.0))


def seen_patches(surfaces: Surfaces, scene: RayScene, view: Camera, offset: tuple[float, float]) -> IntArray:
    """Patch whose front or black back a ray through each pixel meets first, (h, w), or -1."""
    shifted = rays(view)
    across, down = shifted[:1, 1:2] - shifted[:1, :1], shifted[1:2, :1] - shifted[:1, :1]
    directions = (shifted + offset[0] * across + offset[1] * down).reshape(-1, 3)
    hit = scene.intersect(np.tile(view.eye, (len(directions), 1)), directions).triangle
    triangle = surfaces.triangles[hit]
    normal = np.cross(triangle[:, 1] - triangle[:, 0], triangle[:, 2] - triangle[:, 0])
    behind = np.einsum("ij,ij->i", normal, directions) > 0.0
    front, back = surfaces.triangle_patch[hit].T
    patch = np.where(behind & (back >= 0), back, front)
    return np.where(hit >= 0, patch, -1).reshape(view.height, view.width).astype(np.int32)


def sample(name: str) -> tuple[Surfaces, RenderMesh, Camera]:
    scene: Scene = load_sample(name)
    surfaces = flatten(scene)
    mesh = Tessellator(surfaces).mesh(build_field(surfaces, uneven(7, 2)))
    return surfaces, mesh, replace(next(iter(scene.cameras.values())), width=200, height=150)


@pytest.mark.parametrize("name", sample_names())
def test_layers_are_what_rays_meet(name: str, renderer: FrameRenderer) -> None:
    surfaces, mesh, view = sample(name)
    scene = RayScene(surfaces.triangles, surfaces.center, surfaces.size)
    element = renderer.draw(mesh, view, Shading.FLAT, Layer.ELEMENT)
    patch = np.where(element >= 0, mesh.field.patch[element], -1)
    expected = seen_patches(surfaces, scene, view, (0.0, 0.0))
    same = patch == expected
    # Where they differ, the ray has passed within a fiftieth of a pixel of what is drawn: a rasteriser rounds
    # vertices to a 256th, and Embree a scene's coordinates to float32.
    near = np.zeros_like(same)
    for offset in [(dx, dy) for dx in (-0.02, 0.0, 0.02) for dy in (-0.02, 0.0, 0.02)]:
        near |= seen_patches(surfaces, scene, view, offset) == patch
    directions = rays(view)
    flat = directions.reshape(-1, 3)
    distance = scene.intersect(np.tile(view.eye, (len(flat), 1)), flat).distance.reshape(same.shape)
    depth = renderer.draw(mesh, view, Shading.FLAT, Layer.DEPTH)
    # Or faces lie in one plane, one over the other.
    hit = (patch >= 0) & (expected >= 0)
    tie = np.isclose(depth, distance, rtol=0.0, atol=1e-6 * surfaces.size) & hit
    tie &= np.all(surfaces.normal[patch] == surfaces.normal[expected], axis=-1)
    assert np.all(near | tie)
    assert same.mean() > 0.995
    assert len(np.unique(patch)) > 5

    objects = renderer.draw(mesh, view, Shading.FLAT, Layer.OBJECT)
    assert objects.dtype == np.int32
    np.testing.assert_array_equal(objects, np.where(patch >= 0, surfaces.object[patch], -1))
    normal = renderer.draw(mesh, view, Shading.FLAT, Layer.NORMAL)
    seen = (patch >= 0)[:, :, None]
    np.testing.assert_allclose(normal, np.where(seen, surfaces.normal[patch], 0.0), atol=1e-6)

    assert depth.dtype == np.float32
    both = same & (patch >= 0)
    np.testing.assert_allclose(depth[both], distance[both], atol=5e-6 * surfaces.size, rtol=2e-5)
    assert np.all(np.isinf(depth) == (patch < 0))
    position = renderer.draw(mesh, view, Shading.FLAT, Layer.POSITION)
    met = view.eye + distance[:, :, None] * directions
    np.testing.assert_allclose(position[both], met[both], atol=2e-5 * surfaces.size)
    assert np.all(np.isnan(position).any(axis=-1) == (patch < 0))


@pytest.mark.parametrize("name", ["cornell", "office"])
def test_flat_frames_hold_the_means_of_leaves(name: str, renderer: FrameRenderer) -> None:
    _, mesh, view = sample(name)
    patch_of = mesh.field.patch
    element = renderer.draw(mesh, view, Shading.FLAT, Layer.ELEMENT)
    above = np.einsum("ij,ij->i", view.eye - mesh.surfaces.corners[:, 0], mesh.surfaces.normal)
    lit = (element >= 0) & (above[patch_of[element]] > 0.0)
    for layer, values in (
        (Layer.RADIANCE, mesh.leaf_radiance),
        (Layer.IRRADIANCE, mesh.leaf_irradiance),
    ):
        frame = renderer.draw(mesh, view, Shading.FLAT, layer)
        assert frame.dtype == np.float32
        np.testing.assert_array_equal(frame, np.where(lit[:, :, None], values[element], 0.0))
    illuminance = renderer.draw(mesh, view, Shading.FLAT, Layer.ILLUMINANCE)
    expected = renderer.draw(mesh, view, Shading.FLAT, Layer.IRRADIANCE) @ LUMINANCE_WEIGHTS
    np.testing.assert_allclose(illuminance, expected, rtol=1e-6)


def test_gouraud_frames_show_linear_fields_as_they_are(renderer: FrameRenderer) -> None:
    surfaces = surfaces_of(polygons(SQUARE))
    function = linear((0.7, -0.4, 0.0), 2.0)
    mesh = Tessellator(surfaces).mesh(build_field(surfaces, even(3), function))
    view = camera((-0.3, -0.2, 0.3), (0.6, 0.5, 0.0))
    frame = renderer.draw(mesh, view, Shading.GOURAUD, Layer.IRRADIANCE)
    position = renderer.draw(mesh, view, Shading.GOURAUD, Layer.POSITION)
    seen = ~np.isnan(position[:, :, 0])
    assert seen.sum() > 1000
    # Perspective-correct: along a steeply tilted square.
    np.testing.assert_allclose(frame[seen], function(position[seen]), rtol=1e-4)
    assert not frame[~seen].any()


def test_top_row_comes_first_and_left_is_left(renderer: FrameRenderer) -> None:
    surfaces = surfaces_of(
        polygons([(0.5, 0.5, 0.0), (1.0, 0.5, 0.0), (1.0, 1.0, 0.0), (0.5, 1.0, 0.0)], name="upper right"),
        polygons([(0.0, 0.0, 0.0), (0.5, 0.0, 0.0), (0.5, 0.5, 0.0), (0.0, 0.5, 0.0)], name="lower left"),
    )
    mesh = Tessellator(surfaces).mesh(build_field(surfaces, even(0)))
    view = camera((0.5, 0.5, 1.0), (0.5, 0.5, 0.0), up=(0.0, 1.0, 0.0))
    shown = renderer.draw(mesh, view, Shading.FLAT, Layer.OBJECT)
    assert shown[24, 46] == 0
    assert shown[36, 34] == 1
    assert shown[24, 34] == shown[36, 46] == -1


@pytest.mark.parametrize("shading", [Shading.FLAT, Shading.GOURAUD])
def test_one_sided_backs_are_black_and_hide(shading: Shading, renderer: FrameRenderer) -> None:
    lamp = [(-9.0, -9.0, 2.0), (-9.0, 9.0, 2.0), (9.0, 9.0, 2.0), (9.0, -9.0, 2.0)]
    surfaces = surfaces_of(
        polygons(SQUARE, name="screen", emission=1.0), polygons(lamp, name="lamp", emission=5.0)
    )
    mesh = Tessellator(surfaces).mesh(build_field(surfaces, even(2), constant(0.0)))
    frame = renderer.draw(mesh, LOOK_UP, shading, Layer.RADIANCE)
    shown = renderer.draw(mesh, LOOK_UP, shading, Layer.OBJECT)
    assert set(np.unique(shown)) == {0, 1}
    np.testing.assert_array_equal(frame[shown == 0], 0.0)
    np.testing.assert_allclose(frame[shown == 1], 5.0 / np.pi, rtol=1e-6)


@pytest.mark.parametrize("shading", [Shading.FLAT, Shading.GOURAUD])
def test_two_sided_faces_show_the_side_that_is_looked_at(shading: Shading, renderer: FrameRenderer) -> None:
    surfaces = surfaces_of(polygons(SQUARE, two_sided=True, reflectance=0.5))
    field = build_field(surfaces, uneven(4, 4))
    above = surfaces.side[field.patch] == 0
    irradiance = np.where(above[:, None], 1.0, 3.0) * np.ones(3)
    mesh = Tessellator(surfaces).mesh(
        replace(field, irradiance=irradiance, radiosity=surfaces.reflectance[field.patch] * irradiance)
    )
    for view, side, expected in ((LOOK_DOWN, 0, 0.5 / np.pi), (LOOK_UP, 1, 1.5 / np.pi)):
        frame = renderer.draw(mesh, view, shading, Layer.RADIANCE)
        element = renderer.draw(mesh, view, shading, Layer.ELEMENT)
        seen = element >= 0
        assert seen.sum() > 500
        np.testing.assert_allclose(frame[seen], expected, rtol=1e-6)
        assert np.all(surfaces.side[field.patch[element[seen]]] == side)


def test_samples_smooth_edges_to_what_they_cover(renderer: FrameRenderer) -> None:
    """The mean over a pixel at the rim is the part of it that is covered, as far as so many samples know."""
    surfaces = surfaces_of(polygons(SQUARE, emission=np.pi, reflectance=0.0))
    mesh = Tessellator(surfaces).mesh(build_field(surfaces, even(1)))
    view = camera((0.53, 0.47, 1.7), (0.5, 0.52, 0.0), (40, 30), up=(0.1, 1.0, 0.0))
    smooth = renderer.draw(mesh, view, Shading.GOURAUD, Layer.RADIANCE, samples=64)[:, :, 0]
    fine = replace(view, width=40 * 16, height=30 * 16)
    dense = renderer.draw(mesh, fine, Shading.GOURAUD, Layer.RADIANCE)[:, :, 0]
    covered = dense.reshape(30, 16, 40, 16).mean(axis=(1, 3))
    rim = (covered > 0.0) & (covered < 1.0)
    assert rim.sum() > 30
    assert np.abs(smooth - covered).max() < 0.06
    # One sample may find a corner that the grid of centres has missed.
    np.testing.assert_allclose(smooth[~rim], covered[~rim], atol=1.01 / 64)


def test_samples_do_not_move_the_picture(renderer: FrameRenderer) -> None:
    surfaces = surfaces_of(polygons(SQUARE))
    mesh = Tessellator(surfaces).mesh(build_field(surfaces, even(2), linear((0.5, 0.3, 0.0), 1.0)))
    view = camera((0.5, 0.5, 0.5), (0.5, 0.5, 0.0), up=(0.0, 1.0, 0.0))
    once = renderer.draw(mesh, view, Shading.GOURAUD, Layer.IRRADIANCE)
    for samples in (2, 3, 7):
        often = renderer.draw(mesh, view, Shading.GOURAUD, Layer.IRRADIANCE, samples=samples)
        np.testing.assert_allclose(often[2:-2, 10:-10], once[2:-2, 10:-10], rtol=1e-5)


@pytest.mark.parametrize("samples", [1, 2, 3, 16, 65, 200])
def test_pixel_patterns_are_centred_inside_the_pixel_and_even(samples: int) -> None:
    pattern = pixel_pattern(samples)
    assert pattern.shape == (samples, 2)
    np.testing.assert_allclose(pattern.mean(axis=0), 0.0, atol=1e-12)
    assert np.abs(pattern).max() < 0.5
    for axis in range(2):
        # One sample in each of `samples` strips, or for incomplete powers of two nearly so.
        gaps = np.diff(np.sort(pattern[:, axis]), append=1.0 + pattern[:, axis].min())
        assert gaps.max() < 2.01 / samples


def test_frames_follow_the_mesh_and_the_camera(renderer: FrameRenderer) -> None:
    """Whatever is kept on the device, each frame is that of its own mesh and camera."""
    surfaces = surfaces_of(polygons(SQUARE, two_sided=True))
    tessellator = Tessellator(surfaces)
    meshes = [tessellator.mesh(build_field(surfaces, even(1), constant(h))) for h in (1.0, 2.0)]
    values: list[float] = []
    for mesh in (*meshes, meshes[0]):
        for view in (LOOK_DOWN, LOOK_UP):
            frame: FloatArray = renderer.draw(mesh, view, Shading.GOURAUD, Layer.IRRADIANCE)
            values.append(float(frame[30, 40, 0]))
    np.testing.assert_allclose(values, [1.0, 1.0, 2.0, 2.0, 1.0, 1.0], rtol=1e-6)


@pytest.mark.parametrize("shading", [Shading.FLAT, Shading.GOURAUD])
@pytest.mark.parametrize("layer", [Layer.RADIANCE, Layer.TRIANGLE])
def test_frames_drawn_in_pieces_are_those_drawn_at_once(
    shading: Shading, layer: Layer, renderer: FrameRenderer, monkeypatch: pytest.MonkeyPatch
) -> None:
    surfaces = surfaces_of(polygons(SQUARE, two_sided=True))
    mesh = Tessellator(surfaces).mesh(build_field(surfaces, even(3), linear((0.5, 0.3, 0.0), 1.0)))
    at_once = renderer.draw(mesh, LOOK_DOWN, shading, layer)
    assert len(np.unique(at_once)) > 7
    for piece in (1, 7, len(mesh.triangles) - 1):
        monkeypatch.setattr(passes, "_PIECE", piece)
        np.testing.assert_array_equal(renderer.draw(mesh, LOOK_DOWN, shading, layer), at_once)


@pytest.mark.parametrize("layer", sorted(set(Layer) - {Layer.ERROR}))
def test_empty_scenes_give_empty_frames(layer: Layer, renderer: FrameRenderer) -> None:
    surfaces = flatten(Scene({}))
    mesh = Tessellator(surfaces).mesh(build_empty(surfaces))
    frame = renderer.draw(mesh, LOOK_DOWN, Shading.GOURAUD, layer)
    numbers = dict.fromkeys((Layer.OBJECT, Layer.ELEMENT, Layer.TRIANGLE), -1)
    nothing = {Layer.DEPTH: np.inf, Layer.POSITION: np.nan, **numbers}.get(layer, 0)
    assert frame.shape[:2] == (60, 80)
    np.testing.assert_array_equal(frame, np.full_like(frame, nothing))


def build_empty(surfaces: Surfaces) -> RadiosityField:
    return RadiosityField(
        corners=np.empty((0, 4, 3)),
        corner_count=np.empty(0, dtype=np.int32),
        patch=np.empty(0, dtype=np.int32),
        area=np.empty(0),
        radiosity=np.empty((0, 3)),
        irradiance=np.empty((0, 3)),
    )


def resized(view: Camera, field: str, length: int) -> Camera:
    return replace(view, width=length) if field == "width" else replace(view, height=length)


@pytest.mark.parametrize(("field", "value"), [("width", 20_000), ("height", 1 << 20)])
def test_frames_beyond_the_driver_name_the_field(
    field: str, value: int, renderer: FrameRenderer, device: GlDevice
) -> None:
    surfaces = surfaces_of(polygons(SQUARE))
    mesh = Tessellator(surfaces).mesh(build_field(surfaces, even(0)))
    limit = device.largest_frame[0 if field == "width" else 1]
    with pytest.raises(LimitExceededError, match=field) as caught:
        renderer.draw(mesh, resized(LOOK_DOWN, field, value), Shading.FLAT, Layer.RADIANCE)
    assert caught.value.limit == limit
    # It draws as before.
    assert renderer.draw(mesh, LOOK_DOWN, Shading.FLAT, Layer.RADIANCE).any()


@pytest.mark.parametrize(("field", "samples"), [("width", 1), ("height", 1), ("samples", 0)])
def test_frames_of_nothing_name_the_field(field: str, samples: int, renderer: FrameRenderer) -> None:
    surfaces = surfaces_of(polygons(SQUARE))
    mesh = Tessellator(surfaces).mesh(build_field(surfaces, even(0)))
    view = resized(LOOK_DOWN, field, 0) if samples else LOOK_DOWN
    with pytest.raises(SceneError) as caught:
        renderer.draw(mesh, view, Shading.FLAT, Layer.RADIANCE, samples)
    assert caught.value.location == (field,)
