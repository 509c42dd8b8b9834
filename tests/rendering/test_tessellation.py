"""Laws of meshes: watertight inside a patch and along seams, the area of the field, no T-vertices."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from solver.geometry.scene import SceneObject
from solver.geometry.surfaces import Surfaces
from solver.illumination.meshing.topology import connect
from solver.rendering.tessellation import RenderMesh, Tessellator
from solver.types import FloatArray, IntArray
from tests.rendering.fields import (
    SQUARE,
    Split,
    build_field,
    constant,
    even,
    linear,
    polygons,
    surfaces_of,
    towards,
    uneven,
)

TRIANGLE = [(0.0, 0.0, 0.0), (1.3, 0.1, 0.0), (0.2, 0.9, 0.0)]
SKEW = [(0.0, 0.0, 0.0), (1.0, 0.1, 0.0), (1.4, 1.1, 0.0), (-0.2, 0.7, 0.0)]
SHAPES = {"square": SQUARE, "triangle": TRIANGLE, "skew": SKEW}

# One long face beside two short ones, across a fold: their corners lie inside its edge [H 3.6, case C].
CASE_C = polygons(
    [(0.0, 0.0, 0.0), (2.0, 0.0, 0.0), (2.0, 1.0, 0.0), (0.0, 1.0, 0.0)],
    [(0.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.7, 0.0, 1.0), (0.7, 0.0, 0.0)],
    [(0.7, 0.0, 0.0), (0.7, 0.0, 1.0), (2.0, 0.0, 0.0)],
)


def shape(name: str) -> Surfaces:
    return surfaces_of(polygons(SHAPES[name]))


def tessellate(surfaces: Surfaces, split: Split) -> RenderMesh:
    return Tessellator(surfaces).mesh(build_field(surfaces, split))


def areas_by_leaf(mesh: RenderMesh) -> FloatArray:
    """Signed by the patch's normal: what is turned over counts against."""
    corners = mesh.position.astype(np.float64)[mesh.triangles] * mesh.surfaces.size
    doubled = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal = mesh.surfaces.normal[mesh.field.patch[mesh.leaf]]
    signed = 0.5 * np.einsum("ij,ij->i", doubled, normal)
    total = np.zeros(len(mesh.field.patch))
    np.add.at(total, mesh.leaf, signed)
    return total


def edges(triangles: IntArray) -> IntArray:
    """Directed edges (3 t, 2)."""
    return np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])


def t_vertices(mesh: RenderMesh) -> int:
    """How many pairs of a vertex and an edge there are, of any patches, of which one lies on the other."""
    used = edges(mesh.triangles)
    start, end = (mesh.position[used[:, k]].astype(np.float64) for k in (0, 1))
    along = end - start
    length = np.linalg.norm(along, axis=1)
    found = 0
    for vertex in np.unique(mesh.position.astype(np.float64), axis=0):
        t = np.einsum("ij,ij->i", vertex - start, along) / length**2
        off = np.linalg.norm(vertex - start - t[:, None] * along, axis=1)
        inside = (t * length > 1e-5) & ((1.0 - t) * length > 1e-5)
        found += int(np.count_nonzero(inside & (off < 1e-6)))
    return found


@given(name=st.sampled_from(sorted(SHAPES)), seed=st.integers(0, 10_000), depth=st.integers(1, 5))
@settings(max_examples=40)
def test_patch_is_watertight(name: str, seed: int, depth: int) -> None:
    """Inside a patch every edge is shared by exactly two triangles, one each way; the rest is outline."""
    surfaces = shape(name)
    mesh = tessellate(surfaces, uneven(seed, depth))
    used = edges(mesh.triangles)
    directed, count = np.unique(used, axis=0, return_counts=True)
    assert np.all(count == 1), "no edge is used twice in one direction"
    there = {(a, b) for a, b in directed.tolist()}
    lonely = np.array([edge for edge in there if edge[::-1] not in there])
    # The lonely edges make up the patch's outline.
    ends = mesh.position.astype(np.float64)[lonely] * surfaces.size
    total = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum()
    outline = surfaces.corners[0, : surfaces.corner_count[0]]
    assert total == pytest.approx(np.linalg.norm(np.roll(outline, -1, axis=0) - outline, axis=1).sum(), 1e-5)


@given(name=st.sampled_from(sorted(SHAPES)), seed=st.integers(0, 10_000), depth=st.integers(0, 5))
@settings(max_examples=40)
def test_triangles_have_the_area_of_their_leaf(name: str, seed: int, depth: int) -> None:
    mesh = tessellate(shape(name), uneven(seed, depth))
    np.testing.assert_allclose(areas_by_leaf(mesh), mesh.field.area, rtol=1e-4)


@given(name=st.sampled_from(sorted(SHAPES)), seed=st.integers(0, 10_000), depth=st.integers(1, 4))
@settings(max_examples=15)
def test_patch_has_no_t_vertices(name: str, seed: int, depth: int) -> None:
    assert t_vertices(tessellate(shape(name), uneven(seed, depth))) == 0


@given(seed=st.integers(0, 10_000), depth=st.integers(1, 3))
@settings(max_examples=15)
def test_seams_between_patches_have_no_t_vertices(seed: int, depth: int) -> None:
    mesh = tessellate(surfaces_of(CASE_C), uneven(seed, depth))
    assert t_vertices(mesh) == 0
    np.testing.assert_allclose(areas_by_leaf(mesh), mesh.field.area, rtol=1e-4)


def test_neighbours_of_many_levels_have_no_t_vertices() -> None:
    surfaces = shape("square")
    mesh = tessellate(surfaces, towards((0.5, 0.5, 0.0), 9))
    assert t_vertices(mesh) == 0
    np.testing.assert_allclose(areas_by_leaf(mesh), mesh.field.area, rtol=1e-3)


def test_t_vertices_are_found_where_they_are() -> None:
    """The check above can fail: it finds the ones of a mesh made without looking at neighbours."""
    surfaces = shape("square")
    field = build_field(surfaces, towards((0.0, 0.0, 0.0), 3))
    topology = connect(field)
    assert len(topology.inside) > 0
    good = Tessellator(surfaces).mesh(field)
    plain = np.concatenate([topology.vertex[:, [0, 1, 2]], topology.vertex[:, [0, 2, 3]]])
    naive = RenderMesh(**{**vars(good), "triangles": plain})
    assert t_vertices(naive) > 0


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e4])
@pytest.mark.parametrize("offset", [0.0, 1e5])
def test_scenes_of_any_size_anywhere_give_the_same_mesh(scale: float, offset: float) -> None:
    if scale == 1e-3 and offset > 0.0:
        offset = 100.0  # float64 holds eight digits of the scene there
    at_home = tessellate(surfaces_of(CASE_C), uneven(3, 4))
    moved = SceneObject(
        "moved", type(CASE_C.mesh)(CASE_C.mesh.vertices * scale + offset, CASE_C.mesh.faces), CASE_C.material
    )
    mesh = tessellate(surfaces_of(moved), uneven(3, 4))
    np.testing.assert_array_equal(mesh.triangles, at_home.triangles)
    np.testing.assert_allclose(mesh.position, at_home.position, atol=1e-6)


def test_mesh_of_the_same_leaves_reuses_outlines_and_takes_new_values() -> None:
    surfaces = shape("skew")
    tessellator = Tessellator(surfaces)
    first = tessellator.mesh(build_field(surfaces, even(3), constant(1.0)))
    second = tessellator.mesh(build_field(surfaces, even(3), linear((1.0, 2.0, 0.0), 3.0)))
    assert second.position is first.position
    fresh = Tessellator(surfaces).mesh(second.field)
    np.testing.assert_array_equal(second.irradiance, fresh.irradiance)
    np.testing.assert_array_equal(second.triangles, fresh.triangles)


def test_radiance_is_emission_and_reflected_irradiance_over_pi() -> None:
    surfaces = surfaces_of(polygons(SQUARE, reflectance=0.3, emission=7.0))
    mesh = Tessellator(surfaces).mesh(build_field(surfaces, even(2), constant(2.0)))
    np.testing.assert_allclose(mesh.radiance, (7.0 + 0.3 * 2.0) / np.pi, rtol=1e-6)
    np.testing.assert_allclose(mesh.leaf_radiance, (7.0 + 0.3 * 2.0) / np.pi, rtol=1e-6)
