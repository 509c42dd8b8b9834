"""Layouts of lightmaps: where charts go, which places texels stand for, and what fills the rest."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from solver.document.samples import load_sample
from solver.errors import SceneError
from solver.geometry.scene import Material, Mesh, Scene, SceneObject
from solver.geometry.surfaces import Surfaces, flatten
from solver.illumination.lightmaps.atlas import Atlas, lay_out
from solver.illumination.lightmaps.charts import charts_of
from solver.illumination.lightmaps.filling import buried, fill
from solver.illumination.lightmaps.packing import PADDING
from solver.illumination.lightmaps.texels import texels_of
from solver.types import FloatArray, IntArray
from solver.visibility.rays import RayScene
from tests.transport.polygons import SEEDS, convex_polygons

MANY = 2**22
ANY = settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.too_slow])


def atlas_of(surfaces: Surfaces, density: float | None, most: int = MANY) -> Atlas:
    work = lay_out(surfaces, density, most)
    while True:
        try:
            next(work)
        except StopIteration as end:
            atlas: Atlas = end.value
            return atlas


def surfaces_of(*polygons: FloatArray, two_sided: bool = False) -> Surfaces:
    material = Material(np.full(3, 0.5), np.zeros(3), two_sided)
    objects = [
        SceneObject(str(k), Mesh(polygon, (tuple(range(len(polygon))),)), material)
        for k, polygon in enumerate(polygons)
    ]
    return flatten(Scene({o.id: o for o in objects}))


def on_patches(surfaces: Surfaces, count: int, seed: int = 0) -> tuple[FloatArray, IntArray]:
    """Points (n, 1, 3) on all patches in turn, corners among them."""
    random = np.random.default_rng(seed)
    patch = np.arange(count * surfaces.patch_count, dtype=np.int32) % surfaces.patch_count
    weight = random.dirichlet(np.full(4, 0.3), len(patch))
    return np.einsum("nk,nka->na", weight, surfaces.corners[patch])[:, None], patch


def check_laws(surfaces: Surfaces, atlas: Atlas) -> None:
    """What holds of every atlas."""
    density = atlas.density
    # Density: never less than asked, nor more than a whole number of texels needs.
    assert np.all(atlas.scale >= density * (1.0 - 1e-5))
    longer = np.maximum(np.ceil(atlas.charts.extent * density), 1.0) / atlas.charts.extent
    np.testing.assert_array_less(atlas.scale, longer * (1.0 + 1e-6))
    # Inside of the picture, and back again.
    points, patch = on_patches(surfaces, 20)
    uv = atlas.coordinates(points, patch)
    assert np.all((uv > 0.0) & (uv < 1.0))
    texels = atlas.texels_at(points, patch)[:, 0]
    back = atlas.points_at(texels, patch)
    np.testing.assert_allclose(back, points[:, 0], atol=1e-9 * surfaces.size)
    # Every place is interpolated from texels of its own chart, which all have a point.
    found = texels_of(atlas, surfaces)
    assert len(np.unique(found.pixel)) == len(found)
    low = np.floor(texels + 1e-6).astype(int)
    share = texels - low
    for right in (0, 1):
        for down in (0, 1):
            weighs = (share[:, 0] if right else 1 - share[:, 0]) * (share[:, 1] if down else 1 - share[:, 1])
            column, row = low[:, 0] + right, low[:, 1] + down
            seen = weighs > 1e-4
            chart = found.chart[row[seen], column[seen]]
            np.testing.assert_array_equal(chart, atlas.charts.of_patch[patch[seen]])
    # Points lie on their patches, a texel and a half from where their texels are at most.
    assert set(found.patch.tolist()) <= set(range(surfaces.patch_count))
    assert set(atlas.charts.of_patch[found.patch].tolist()) == set(range(len(atlas.charts)))
    away = found.position - surfaces.corners[found.patch, 0]
    height = np.abs(np.einsum("na,na->n", away, surfaces.normal[found.patch]))
    assert height.max() <= 1e-5 * surfaces.size
    row, column = np.divmod(found.pixel, atlas.width)
    meant = atlas.texels_at(found.position[:, None], found.patch)[:, 0]
    assert np.abs(meant - np.stack([column, row], axis=1)).max() <= 1.5
    # Charts do not touch.
    for shift in range(1, PADDING):
        for a, b in (
            (found.chart[:, shift:], found.chart[:, :-shift]),
            (found.chart[shift:], found.chart[:-shift]),
        ):
            assert not np.any((a >= 0) & (b >= 0) & (a != b))


@pytest.mark.parametrize("sample", ["cornell", "office", "cube_room"])
def test_laws_hold_of_samples(sample: str) -> None:
    surfaces = flatten(load_sample(sample))
    for density in (None, 0.7, 25.0 / surfaces.size):
        check_laws(surfaces, atlas_of(surfaces, density))


@ANY
@given(
    polygons=st.lists(convex_polygons(), min_size=1, max_size=6),
    density=st.floats(0.01, 60.0),
    two_sided=st.booleans(),
)
def test_laws_hold_of_any_polygons(polygons: list[FloatArray], density: float, two_sided: bool) -> None:
    surfaces = surfaces_of(*polygons, two_sided=two_sided)
    check_laws(surfaces, atlas_of(surfaces, density))


def test_equal_scenes_have_equal_layouts() -> None:
    surfaces = flatten(load_sample("office"))
    first, second = atlas_of(surfaces, 20.0), atlas_of(surfaces, 20.0)
    assert (first.width, first.height) == (second.width, second.height)
    np.testing.assert_array_equal(first.place, second.place)


def test_edges_of_rectangles_run_through_middles_of_texels() -> None:
    surfaces = surfaces_of(np.array([[0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0]], dtype=float))
    atlas = atlas_of(surfaces, 8.0)
    np.testing.assert_allclose(atlas.scale, 8.0)
    assert np.ptp(atlas.texels_at(surfaces.corners, np.zeros(1, dtype=np.int32))[0], axis=0).tolist() == [
        16,
        8,
    ]
    assert len(texels_of(atlas, surfaces)) == 17 * 9


def test_a_concave_face_is_one_chart_and_a_bent_one_is_several() -> None:
    flat = np.array([[0, 0, 0], [2, 0, 0], [2, 1, 0], [1, 1, 0], [1, 2, 0], [0, 2, 0]], dtype=float)
    surfaces = surfaces_of(flat)
    assert surfaces.patch_count > 1
    assert len(charts_of(surfaces)) == 1
    np.testing.assert_allclose(np.sort(charts_of(surfaces).extent[0]), [2.0, 2.0])
    check_laws(surfaces, atlas_of(surfaces, 10.0))
    bent = flat[[0, 1, 2, 5]] + np.array([[0, 0, 0], [0, 0, 0], [0, 0, 1.0], [0, 0, 0]])
    assert len(charts_of(surfaces_of(bent))) == 2


def test_fronts_and_backs_have_charts_of_their_own() -> None:
    quad = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=float)
    surfaces = surfaces_of(quad, two_sided=True)
    charts = charts_of(surfaces)
    assert len(charts) == 2
    # Both are seen from their fronts: right, then down, then into the surface.
    into = np.cross(charts.axes[:, 0], charts.axes[:, 1])
    np.testing.assert_allclose(into[charts.of_patch], -surfaces.normal, atol=1e-12)


def test_charts_of_many_pages_do_not_meet() -> None:
    random = np.random.default_rng(0)
    low = random.uniform(-1, 1, (5000, 1, 3))
    quads = low + np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]) * random.uniform(
        0.01, 0.1, (5000, 1, 1)
    )
    faces = tuple(tuple(range(4 * k, 4 * k + 4)) for k in range(5000))
    grey = Material(np.full(3, 0.5), np.zeros(3))
    surfaces = flatten(Scene({"a": SceneObject("a", Mesh(quads.reshape(-1, 3), faces), grey)}))
    check_laws(surfaces, atlas_of(surfaces, 40.0))


def test_a_scene_without_surfaces_has_an_atlas() -> None:
    surfaces = flatten(Scene({}))
    atlas = atlas_of(surfaces, None)
    assert len(texels_of(atlas, surfaces)) == 0


@pytest.mark.parametrize("density", [1e9, 3e3, 300.0])
def test_too_many_texels_are_refused_by_name(density: float) -> None:
    surfaces = flatten(load_sample("office"))
    with pytest.raises(SceneError) as refused:
        atlas_of(surfaces, density, 2**20)
    assert refused.value.location == ("density",)


# --- filling ---


def test_rings_are_filled_from_their_own_chart_first() -> None:
    chart = np.full((7, 9), -1, dtype=np.int32)
    chart[2:5, 1:4], chart[2:5, 5:8] = 0, 1
    image, known = np.zeros((7, 9, 3), dtype=np.float32), chart >= 0
    image[chart == 0], image[chart == 1] = 1.0, 3.0
    known[3, 3] = False
    image[3, 3] = 0.0
    fill(image, known, chart, 1)
    assert np.all(image[3, 3] == 1.0), "what is hidden takes its own chart's light"
    assert np.all(image[3, 0] == 1.0) and np.all(image[3, 8] == 3.0)
    assert np.all((image[3, 4] > 1.0) & (image[3, 4] < 3.0)), "between charts: of both"
    assert np.all(image[0] == 0.0), "one ring alone"


@ANY
@given(seed=SEEDS)
def test_filling_keeps_what_is_known_and_within_its_range(seed: int) -> None:
    random = np.random.default_rng(seed)
    image = random.uniform(1.0, 2.0, (12, 15, 3)).astype(np.float32)
    known = random.random((12, 15)) < 0.1
    image[~known] = 0.0
    before, had = image.copy(), known.copy()
    fill(image, known, np.full((12, 15), -1, dtype=np.int32))
    np.testing.assert_array_equal(image[had], before[had])
    assert np.all((image[known] >= 0.999) & (image[known] <= 2.001))


def test_what_stands_in_a_closed_box_is_buried() -> None:
    """The floor below the blocks of the Cornell box, and nothing else of it."""
    surfaces = flatten(load_sample("cornell"))
    rays = RayScene(surfaces.triangles, surfaces.center, surfaces.size)
    found = texels_of(atlas_of(surfaces, 60.0 / surfaces.size), surfaces)
    hidden = buried(found.position, found.patch, surfaces, rays)
    names = np.array(surfaces.object_ids)[surfaces.object]
    tops = [
        surfaces.corners[p][:, [0, 2]]
        for p in range(surfaces.patch_count)
        if "block" in names[p] and surfaces.normal[p, 1] > 0.99
    ]
    assert len(tops) == 2
    # How deep the texels of the floor lie below a block: least distance to its sides, negative beside it.
    floor = np.flatnonzero(names[found.patch] == "floor")
    deep = np.full(len(floor), -np.inf)
    for top in tops:
        edge = np.roll(top, -1, axis=0) - top
        away = found.position[floor][:, None, [0, 2]] - top
        side = (edge[:, 0] * away[..., 1] - edge[:, 1] * away[..., 0]) / np.linalg.norm(edge, axis=1)
        turn = np.sign(np.sum(edge[:, 0] * np.roll(edge[:, 1], -1) - edge[:, 1] * np.roll(edge[:, 0], -1)))
        deep = np.maximum(deep, (turn * side).min(axis=1))
    clear = np.abs(deep) > 1e-3 * surfaces.size
    np.testing.assert_array_equal(hidden[floor][clear], deep[clear] > 0.0)
    assert np.any(deep > 0.0)
