"""Frames of interpolants against the CPU, and against the functions that they stand for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from solver.document.samples import load_sample
from solver.errors import LimitExceededError
from solver.geometry.scene import Camera
from solver.geometry.surfaces import Surfaces, flatten
from solver.illumination.interpolation.mesh import InterpolantMesh
from solver.rendering.device import GlDevice
from solver.rendering.meshes import NotInMeshError
from solver.rendering.renderer import FrameRenderer, Layer, Shading, needs_interpolants
from solver.rendering.tessellation import Tessellator
from solver.types import LUMINANCE_WEIGHTS, FloatArray, Points
from tests.rendering.fields import (
    SQUARE,
    build_field,
    camera,
    constant,
    even,
    linear,
    polygons,
    surfaces_of,
    towards,
    uneven,
)
from tests.rendering.interpolant_meshes import (
    by_cpu,
    fitted,
    interpolants,
    is_lit,
    random_coefficients,
    random_mesh,
)
from tests.rendering.test_watertight_frames import look, placed

LOOK_DOWN = camera((0.4, 0.5, 1.5), (0.5, 0.5, 0.0), up=(0.0, 1.0, 0.0))
LOOK_UP = camera((0.4, 0.5, -1.5), (0.5, 0.5, 0.0), up=(0.0, 1.0, 0.0))

AGREE = 1e-5
"""By how much of a frame's brightest pixel OpenGL and the CPU may differ: float32, on slivers too."""


def bowl(points: Points) -> FloatArray:
    """A quadratic function of space, with channels of their own."""
    x, y, z = points.T
    values = [1.0 + 0.3 * x * x - 0.4 * x * y + 0.2 * z, 2.0 - y * y + 0.1 * x, 0.7 + 0.5 * z * z + x * z]
    return np.stack(values, axis=-1)


def assert_agree(renderer: FrameRenderer, mesh: InterpolantMesh, view: Camera) -> None:
    for layer in (Layer.IRRADIANCE, Layer.RADIANCE):
        frame = renderer.draw(mesh, view, Shading.INTERPOLANT, layer)
        assert frame.dtype == np.float32
        np.testing.assert_allclose(
            frame, by_cpu(renderer, mesh, view, layer), rtol=0.0, atol=AGREE * max(frame.max(), 1e-30)
        )


# --- against the CPU ---


@settings(deadline=None, max_examples=20)
@given(seed=st.integers(0, 2**32 - 1), fov=st.floats(1.0, 150.0))
def test_frames_agree_with_the_cpu_from_everywhere(renderer: FrameRenderer, seed: int, fov: float) -> None:
    random = np.random.default_rng(seed)
    mesh = random_mesh(placed(), uneven(seed, 4), seed)
    eye, target = random.uniform(-0.2, 1.2, (2, 3))
    assert_agree(renderer, mesh, look(eye, target, fov, (80, 60)))


@pytest.mark.parametrize("name", ["cornell", "office"])
def test_frames_of_samples_agree_with_the_cpu(name: str, renderer: FrameRenderer) -> None:
    scene = load_sample(name)
    mesh = random_mesh(flatten(scene), uneven(3, 4), 5)
    view = replace(next(iter(scene.cameras.values())), width=320, height=240)
    assert_agree(renderer, mesh, view)
    assert is_lit(renderer, mesh, view).mean() > 0.5


@pytest.mark.parametrize("height", [0.3, 1e-2, 1e-4, 1e-6, 1e-9])
def test_grazing_views_agree_with_the_cpu(height: float, renderer: FrameRenderer) -> None:
    """A floor seen more and more edge on, from within and from beside it, in small triangles and in two."""
    for depth in (0, 6):
        mesh = random_mesh(surfaces_of(polygons(SQUARE, emission=0.1)), even(depth), 7)
        for eye in ((0.41, 0.13, height), (-3.0, -2.0, height)):
            view = camera(eye, (0.8, 0.7, 0.0), fov=30.0)
            assert_agree(renderer, mesh, view)
            assert is_lit(renderer, mesh, view).any() or eye[0] < 0.0


@pytest.mark.parametrize("size", [1.0, 1e-2, 1e-4])
def test_tiny_triangles_beside_huge_ones_agree_with_the_cpu(size: float, renderer: FrameRenderer) -> None:
    """Triangles down to a few millionths of the scene, seen from as near as that."""
    random = np.random.default_rng(11)
    corners = np.array([0.3, -0.2, 0.4]) + size * random.uniform(-1.0, 1.0, (40, 3, 3))
    tiny = [[tuple(p) for p in triangle.tolist()] for triangle in corners]
    wall = [(-10.0, 2.0, -10.0), (10.0, 2.0, -10.0), (0.0, 2.0, 10.0)]
    mesh = random_mesh(surfaces_of(polygons(*tiny, two_sided=True), polygons(wall, name="wall")), even(0), 3)
    eye = np.array([0.3, -0.2, 0.4]) + size * np.array([0.2, -3.0, 0.5])
    view = look(eye, np.array([0.3, -0.2, 0.4]), 50.0)
    assert_agree(renderer, mesh, view)
    seen = renderer.draw(mesh, view, Shading.INTERPOLANT, Layer.OBJECT)
    assert len(np.unique(renderer.draw(mesh, view, Shading.INTERPOLANT, Layer.TRIANGLE)[seen == 0])) > 20


@pytest.mark.parametrize(("scale", "offset"), [(1e-3, 50.0), (1.0, 1e5), (1e4, -3e5)])
def test_rooms_of_any_size_anywhere_agree_with_the_cpu(
    scale: float, offset: float, renderer: FrameRenderer
) -> None:
    mesh = random_mesh(placed(scale, offset), uneven(2, 4), 1)
    for eye, target in np.random.default_rng(8).uniform(0.05, 0.95, (3, 2, 3)) * scale + offset:
        assert_agree(renderer, mesh, look(eye, target, 70.0))


# --- against what they stand for ---


def test_quadratic_fields_are_shown_as_they_are(renderer: FrameRenderer) -> None:
    """Whatever the triangles: pixels have the function's value at the point that they show."""
    surfaces = placed()
    mesh = fitted(random_mesh(surfaces, uneven(4, 4), 0), bowl)
    for eye, target in np.random.default_rng(3).uniform(0.05, 0.95, (8, 2, 3)):
        view = look(eye, target, 70.0)
        frame = renderer.draw(mesh, view, Shading.INTERPOLANT, Layer.IRRADIANCE)
        position = renderer.draw(mesh, view, Shading.INTERPOLANT, Layer.POSITION)
        # A pixel whose centre just misses its triangle shows the nearest point of it: within a 256th.
        np.testing.assert_allclose(frame, bowl(position.reshape(-1, 3)).reshape(frame.shape), atol=2e-3)
        assert np.median(np.abs(frame - bowl(position.reshape(-1, 3)).reshape(frame.shape))) < 1e-6


def test_barycentrics_weigh_corners_to_the_point_that_is_seen(renderer: FrameRenderer) -> None:
    mesh = random_mesh(placed(), uneven(6, 3), 0)
    for eye, target in np.random.default_rng(4).uniform(0.05, 0.95, (4, 2, 3)):
        view = look(eye, target, 60.0)
        shown = renderer.draw(mesh, view, Shading.INTERPOLANT, Layer.TRIANGLE)
        weights = renderer.draw(mesh, view, Shading.INTERPOLANT, Layer.BARYCENTRIC)
        position = renderer.draw(mesh, view, Shading.INTERPOLANT, Layer.POSITION)
        assert weights.dtype == np.float32
        assert weights.min() >= 0.0
        np.testing.assert_allclose(weights.sum(axis=-1), 1.0, rtol=1e-6)
        met = np.einsum("hwk,hwki->hwi", weights, mesh.position[mesh.triangles[shown]])
        apart = np.linalg.norm(met - position, axis=-1)
        assert np.median(apart) < 1e-6
        assert np.quantile(apart, 0.98) < 1e-6
        assert apart.max() < 0.01
        leaf = renderer.draw(mesh, view, Shading.INTERPOLANT, Layer.ELEMENT)
        np.testing.assert_array_equal(leaf, mesh.leaf[shown])


def test_irradiance_is_never_negative(renderer: FrameRenderer) -> None:
    surfaces = surfaces_of(polygons(SQUARE, emission=np.pi))
    mesh = random_mesh(surfaces, even(1), 0)
    mesh = fitted(mesh, lambda p: np.repeat(p[:, :1] - 0.5, 3, axis=1))
    for shading in (Shading.INTERPOLANT, Shading.GOURAUD):
        frame = renderer.draw(mesh, LOOK_DOWN, shading, Layer.IRRADIANCE)
        position = renderer.draw(mesh, LOOK_DOWN, shading, Layer.POSITION)
        seen = ~np.isnan(position[:, :, 0])
        expected = np.maximum(position[:, :, 0] - 0.5, 0.0)
        np.testing.assert_allclose(frame[seen][:, 0], expected[seen], atol=1e-5)
        assert (frame[seen] == 0.0).mean() > 0.3
        # What a surface emits is not what it lacks.
        radiance = renderer.draw(mesh, LOOK_DOWN, shading, Layer.RADIANCE)
        np.testing.assert_allclose(radiance[seen], 1.0 + 0.5 * frame[seen] / np.pi, rtol=1e-6)


def test_gouraud_frames_are_linear_between_the_corners_of_each_triangle(renderer: FrameRenderer) -> None:
    mesh = random_mesh(placed(), uneven(1, 3), 4)
    view = look(np.array([0.3, 0.6, 0.4]), np.array([0.9, 0.2, 0.3]), 80.0)
    a, _, c, d, e, f = np.moveaxis(mesh.coefficients.astype(np.float64), 1, 0)
    corners = np.maximum(np.stack([f, a + c + f, d + e + f], axis=1), 0.0)
    shown = renderer.draw(mesh, view, Shading.GOURAUD, Layer.TRIANGLE)
    weights = renderer.draw(mesh, view, Shading.GOURAUD, Layer.BARYCENTRIC)
    frame = renderer.draw(mesh, view, Shading.GOURAUD, Layer.IRRADIANCE)
    expected = np.einsum("hwk,hwkc->hwc", weights, corners[shown])
    np.testing.assert_allclose(frame, expected, atol=AGREE * frame.max())
    assert not np.allclose(frame, renderer.draw(mesh, view, Shading.INTERPOLANT, Layer.IRRADIANCE), atol=0.1)


def test_flat_frames_hold_the_means_of_leaves(renderer: FrameRenderer) -> None:
    surfaces = surfaces_of(polygons(SQUARE, reflectance=0.7, emission=0.3))
    mesh = Tessellator(surfaces).mesh(build_field(surfaces, uneven(2, 3), linear((0.5, 0.3, 0.0), 1.0)))
    drawn = interpolants(mesh, random_coefficients(0, len(mesh.triangles)))
    for layer in (Layer.RADIANCE, Layer.IRRADIANCE, Layer.ILLUMINANCE):
        expected = renderer.draw(mesh, LOOK_DOWN, Shading.FLAT, layer)
        assert expected.any()
        np.testing.assert_allclose(renderer.draw(drawn, LOOK_DOWN, Shading.FLAT, layer), expected, rtol=1e-6)


def test_the_error_is_that_of_the_triangle(renderer: FrameRenderer) -> None:
    lamp = [(-9.0, -9.0, 2.0), (-9.0, 9.0, 2.0), (9.0, 9.0, 2.0), (9.0, -9.0, 2.0)]
    mesh = random_mesh(surfaces_of(polygons(SQUARE), polygons(lamp, name="lamp")), even(2), 1)
    for view in (LOOK_DOWN, LOOK_UP):
        error = renderer.draw(mesh, view, Shading.INTERPOLANT, Layer.ERROR)
        shown = renderer.draw(mesh, view, Shading.INTERPOLANT, Layer.TRIANGLE)
        assert error.dtype == np.float32
        lit = is_lit(renderer, mesh, view)
        assert 0.1 < lit.mean() < 0.95
        np.testing.assert_array_equal(error, np.where(lit, mesh.error[shown], 0.0))


def test_false_colour_shows_illuminance(renderer: FrameRenderer) -> None:
    mesh = fitted(random_mesh(surfaces_of(polygons(SQUARE)), even(1), 0), linear((1.0, 0.0, 0.0), 0.1))
    view = replace(LOOK_DOWN, width=160, height=120)
    light = renderer.draw(mesh, view, Shading.INTERPOLANT, Layer.ILLUMINANCE)
    irradiance = renderer.draw(mesh, view, Shading.INTERPOLANT, Layer.IRRADIANCE)
    np.testing.assert_allclose(light, irradiance @ LUMINANCE_WEIGHTS, rtol=1e-6)
    colours = renderer.draw(mesh, view, Shading.INTERPOLANT, Layer.FALSE_COLOUR)
    assert colours.dtype == np.float32
    assert not colours[light == 0.0].any()
    # From dark violet to yellow, as the light rises from left to right.
    order = np.argsort(light[light > 0.0])
    assert np.all(np.diff(colours[light > 0.0][order][:, 1]) > -1e-6)
    np.testing.assert_allclose(colours[light > 0.0][order][-1], (0.993, 0.906, 0.144), atol=1e-6)


# --- what is seen ---


@pytest.mark.parametrize("shading", Shading)
def test_one_sided_backs_are_black_and_hide(shading: Shading, renderer: FrameRenderer) -> None:
    lamp = [(-9.0, -9.0, 2.0), (-9.0, 9.0, 2.0), (9.0, 9.0, 2.0), (9.0, -9.0, 2.0)]
    surfaces = surfaces_of(
        polygons(SQUARE, name="screen", emission=1.0), polygons(lamp, name="lamp", emission=5.0)
    )
    mesh = random_mesh(surfaces, even(2), 0)
    mesh = replace(
        mesh,
        coefficients=np.zeros_like(mesh.coefficients),
        leaf_irradiance=np.zeros_like(mesh.leaf_irradiance),
    )
    frame = renderer.draw(mesh, LOOK_UP, shading, Layer.RADIANCE)
    shown = renderer.draw(mesh, LOOK_UP, shading, Layer.OBJECT)
    assert set(np.unique(shown)) == {0, 1}
    np.testing.assert_array_equal(frame[shown == 0], 0.0)
    np.testing.assert_allclose(frame[shown == 1], 5.0 / np.pi, rtol=1e-6)


def test_two_sided_faces_show_the_side_that_is_looked_at(renderer: FrameRenderer) -> None:
    surfaces = surfaces_of(polygons(SQUARE, two_sided=True))
    mesh = random_mesh(surfaces, uneven(4, 4), 0)
    above = surfaces.side[mesh.patch[mesh.triangles[:, 0]]] == 0
    coefficients = np.zeros_like(mesh.coefficients)
    coefficients[:, 5] = np.where(above, 1.0, 3.0)[:, None]
    mesh = replace(mesh, coefficients=coefficients)
    for view, expected in ((LOOK_DOWN, 1.0), (LOOK_UP, 3.0)):
        frame = renderer.draw(mesh, view, Shading.INTERPOLANT, Layer.IRRADIANCE)
        seen = renderer.draw(mesh, view, Shading.INTERPOLANT, Layer.TRIANGLE) >= 0
        assert seen.sum() > 500
        np.testing.assert_array_equal(frame[seen], expected)


def constant_room() -> InterpolantMesh:
    """Coarse and fine leaves side by side, in one patch and across seams, lit evenly [H 3.6]."""
    mesh = random_mesh(placed(), towards((0.3, 0.0, 0.4), 6), 0)
    coefficients = np.zeros_like(mesh.coefficients)
    coefficients[:, 5] = 1.0
    return replace(mesh, coefficients=coefficients)


def test_meshes_of_two_resolutions_have_no_cracks(renderer: FrameRenderer) -> None:
    """A bright room around this one would show through any; no pixel is missing either."""
    mesh = constant_room()
    random = np.random.default_rng(5)
    fine = mesh.position[np.linalg.norm(mesh.position - (0.3, 0.0, 0.4), axis=1) < 0.1]
    for target in [*random.permutation(fine)[:10], *random.uniform(0.0, 1.0, (20, 3))]:
        view = look(random.uniform(0.1, 0.9, 3), target, float(random.choice([0.5, 8.0, 90.0])))
        assert np.all(renderer.draw(mesh, view, Shading.FLAT, Layer.OBJECT) == 0)
        frame = renderer.draw(mesh, view, Shading.INTERPOLANT, Layer.RADIANCE)
        np.testing.assert_allclose(frame, 0.5 / np.pi, rtol=1e-6)


def test_samples_do_not_move_the_picture_and_smooth_its_edges(renderer: FrameRenderer) -> None:
    mesh = fitted(random_mesh(surfaces_of(polygons(SQUARE)), even(2), 0), linear((0.5, 0.3, 0.0), 1.0))
    view = camera((0.5, 0.5, 0.5), (0.5, 0.5, 0.0), up=(0.0, 1.0, 0.0))
    once = renderer.draw(mesh, view, Shading.INTERPOLANT, Layer.IRRADIANCE)
    for samples in (2, 3, 7):
        often = renderer.draw(mesh, view, Shading.INTERPOLANT, Layer.IRRADIANCE, samples=samples)
        np.testing.assert_allclose(often[2:-2, 10:-10], once[2:-2, 10:-10], rtol=1e-5)
    apart = camera((0.53, 0.47, 1.7), (0.5, 0.52, 0.0), (40, 30), up=(0.1, 1.0, 0.0))
    smooth = renderer.draw(mesh, apart, Shading.INTERPOLANT, Layer.IRRADIANCE, samples=64)
    fine = replace(apart, width=40 * 16, height=30 * 16)
    dense = renderer.draw(mesh, fine, Shading.INTERPOLANT, Layer.IRRADIANCE)
    covered = dense.reshape(30, 16, 40, 16, 3).mean(axis=(1, 3))
    assert np.abs(smooth - covered).max() < 0.06 * dense.max()


# --- what stays on the device ---


def test_new_coefficients_are_all_that_is_uploaded_for_them(device: GlDevice) -> None:
    renderer = FrameRenderer(device)
    mesh = random_mesh(placed(), uneven(3, 3), 0)
    view = look(np.array([0.3, 0.6, 0.4]), np.array([0.9, 0.2, 0.3]), 80.0)
    assert_agree(renderer, mesh, view)
    for seed in range(1, 4):
        before = renderer.uploaded
        mesh = replace(mesh, coefficients=random_coefficients(seed, len(mesh.triangles)))
        assert_agree(renderer, mesh, view)
        # Six RGB triples a triangle, in whole texels of four float32.
        assert renderer.uploaded - before == 80 * len(mesh.triangles)
    before = renderer.uploaded
    assert_agree(renderer, mesh, view)
    assert renderer.uploaded == before
    renderer.release()


def test_more_triangles_than_the_device_takes_are_refused(
    renderer: FrameRenderer, device: GlDevice, monkeypatch: pytest.MonkeyPatch
) -> None:
    mesh = random_mesh(surfaces_of(polygons(SQUARE)), even(3), 0)
    with monkeypatch.context() as patched:
        patched.setattr(device.entry_points, "most_texels", 4 * len(mesh.triangles) - 1)
        with pytest.raises(LimitExceededError, match="texels of frames"):
            renderer.draw(mesh, LOOK_DOWN, Shading.INTERPOLANT, Layer.RADIANCE)
    assert_agree(renderer, mesh, LOOK_DOWN)


def test_frames_follow_the_mesh(renderer: FrameRenderer) -> None:
    """Whatever is kept on the device: other triangles, other materials, another kind of mesh."""
    rooms: list[Surfaces] = [placed(), placed(2.0, 0.1)]
    view = look(np.array([0.3, 0.6, 0.4]), np.array([0.9, 0.2, 0.3]), 80.0)
    meshes = [random_mesh(room, uneven(seed, 3), seed) for room in rooms for seed in range(2)]
    brighter = replace(rooms[0], reflectance=0.3 * rooms[0].reflectance, emission=rooms[0].emission + 1.0)
    meshes.append(replace(meshes[0], surfaces=brighter))
    plain = Tessellator(rooms[0]).mesh(build_field(rooms[0], even(2), constant(1.0)))
    expected = renderer.draw(plain, view, Shading.GOURAUD, Layer.RADIANCE)
    for index in (0, 1, 4, 2, 0, 3, 4, 1):
        for shading in (Shading.FLAT, Shading.GOURAUD):
            renderer.draw(meshes[index], view, shading, Layer.RADIANCE)
        assert_agree(renderer, meshes[index], view)
        np.testing.assert_array_equal(renderer.draw(plain, view, Shading.GOURAUD, Layer.RADIANCE), expected)


@pytest.mark.parametrize("layer", Layer)
@pytest.mark.parametrize("shading", Shading)
def test_what_needs_interpolants_says_so(shading: Shading, layer: Layer, renderer: FrameRenderer) -> None:
    surfaces = surfaces_of(polygons(SQUARE))
    mesh = Tessellator(surfaces).mesh(build_field(surfaces, even(1)))
    drawn = interpolants(mesh, random_coefficients(0, len(mesh.triangles)))
    assert renderer.draw(drawn, LOOK_DOWN, shading, layer).shape[:2] == (60, 80)
    assert needs_interpolants(shading, layer) == (shading == "interpolant" or layer == "error")
    if needs_interpolants(shading, layer):
        with pytest.raises(NotInMeshError) as refused:
            renderer.draw(mesh, LOOK_DOWN, shading, layer)
        assert refused.value.what in (shading, layer)
    else:
        assert renderer.draw(mesh, LOOK_DOWN, shading, layer).shape[:2] == (60, 80)


@pytest.mark.parametrize("layer", Layer)
def test_no_triangles_give_empty_frames(layer: Layer, renderer: FrameRenderer) -> None:
    mesh = random_mesh(surfaces_of(polygons(SQUARE)), even(0), 0)
    none = np.zeros(0, dtype=np.int64)
    empty = replace(
        mesh,
        triangles=mesh.triangles[none],
        leaf=mesh.leaf[none],
        coefficients=mesh.coefficients[none],
        error=mesh.error[none],
        is_fine=mesh.is_fine[none],
    )
    numbers = dict.fromkeys((Layer.OBJECT, Layer.ELEMENT, Layer.TRIANGLE), -1)
    nothing = {Layer.DEPTH: np.inf, Layer.POSITION: np.nan, **numbers}.get(layer, 0)
    for shading in Shading:
        frame = renderer.draw(empty, LOOK_DOWN, shading, layer)
        np.testing.assert_array_equal(frame, np.full_like(frame, nothing))
