"""A scene flattened: patches for light, triangles for rays, and what is told of faces that were dropped."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from solver.geometry.scene import Material, Mesh, Scene, SceneObject
from solver.geometry.surfaces import Surfaces, flatten
from solver.geometry.transform import Transform

SQUARE = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
CONCAVE = [[0, 0, 1], [2, 0, 1], [2, 1, 1], [1, 1, 1], [1, 2, 1], [0, 2, 1]]
"""Elsewhere, so that neither hides the other."""
LINE = [[0, 0, 0], [1, 0, 0], [2, 0, 0]]
ABOVE = Transform.from_parts(np.array([0.0, 0.0, 2.0]), np.array([0.0, 0.0, 0.0, 1.0]), np.ones(3))


def thing(
    name: str,
    *faces: list[list[float]] | list[list[int]],
    two_sided: bool = False,
    reflectance: tuple[float, float, float] = (0.5, 0.5, 0.5),
    emission: tuple[float, float, float] = (0.0, 0.0, 0.0),
    transform: Transform | None = None,
) -> SceneObject:
    vertices = np.array([corner for face in faces for corner in face], dtype=float).reshape(-1, 3)
    starts = np.cumsum([0] + [len(face) for face in faces]).tolist()
    indices = tuple(tuple(range(a, b)) for a, b in pairwise(starts))
    material = Material(np.array(reflectance), np.array(emission), two_sided)
    return SceneObject(name, Mesh(vertices, indices), material, transform or Transform.identity())


def flattened(*objects: SceneObject) -> Surfaces:
    return flatten(Scene(objects={o.id: o for o in objects}))


def triangle_area(s: Surfaces) -> float:
    edges = s.triangles[:, 1:] - s.triangles[:, :1]
    return float(0.5 * np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1).sum())


def test_one_sided_faces() -> None:
    s = flattened(thing("a", SQUARE, CONCAVE, reflectance=(0.1, 0.2, 0.3), emission=(4, 5, 6)))
    assert s.patch_count == 1 + 4 and s.face_count == 2
    assert s.face.tolist() == [0, 1, 1, 1, 1]
    assert s.corner_count.tolist() == [4, 3, 3, 3, 3]
    assert s.area.sum() == pytest.approx(4.0) and triangle_area(s) == pytest.approx(4.0)
    np.testing.assert_allclose(s.normal, np.tile([0.0, 0.0, 1.0], (5, 1)))
    np.testing.assert_array_equal(s.reflectance, np.tile([0.1, 0.2, 0.3], (5, 1)))
    np.testing.assert_array_equal(s.emission, np.tile([4.0, 5.0, 6.0], (5, 1)))
    assert not s.side.any()
    assert np.all(s.triangle_patch[:, 1] == -1), "backs are black"
    assert s.warnings == ()


def test_patches_have_the_lobes_of_their_material() -> None:
    plain = flattened(thing("a", SQUARE, CONCAVE))
    assert not plain.specular.any() and not plain.emission_exponent.any()
    assert not plain.has_specular and not plain.has_directional_emission
    gloss = Material(
        np.zeros(3),
        np.zeros(3),
        two_sided=True,
        specular=np.array([0.1, 0.2, 0.3]),
        exponent=20.0,
        emission_exponent=4.0,
    )
    s = flattened(thing("a", SQUARE), replace(thing("b", CONCAVE), material=gloss))
    np.testing.assert_array_equal(s.specular[1:], np.tile([0.1, 0.2, 0.3], (8, 1)))
    assert s.exponent.tolist() == [np.inf] + [20.0] * 8
    assert s.emission_exponent.tolist() == [0.0] + [4.0] * 8
    assert s.has_specular and not s.has_directional_emission, "nothing emits"
    lit = flattened(replace(thing("b", SQUARE), material=replace(gloss, emission=np.array([0.0, 1.0, 0.0]))))
    assert lit.has_directional_emission


def test_two_sided_faces_come_twice_and_block_once() -> None:
    one, two = flattened(thing("a", SQUARE, CONCAVE)), flattened(thing("a", SQUARE, CONCAVE, two_sided=True))
    n = one.patch_count
    assert two.patch_count == 2 * n and two.face_count == 2
    np.testing.assert_array_equal(two.triangles, one.triangles)
    np.testing.assert_array_equal(two.triangle_patch[:, 0], one.triangle_patch[:, 0])
    np.testing.assert_array_equal(two.triangle_patch[:, 1], one.triangle_patch[:, 0] + n)
    np.testing.assert_array_equal(two.side, np.repeat([0, 1], n))
    np.testing.assert_array_equal(two.normal[n:], -two.normal[:n])
    np.testing.assert_array_equal(two.area[n:], two.area[:n])
    for front, back, count in zip(two.corners[:n], two.corners[n:], two.corner_count[:n], strict=True):
        np.testing.assert_array_equal(back[:count], front[:count][::-1])
        if count == 3:
            np.testing.assert_array_equal(back[3], back[2])


def test_triangles_belong_to_the_patch_whose_front_they_show() -> None:
    s = flattened(
        thing("a", SQUARE, two_sided=True),
        thing("b", CONCAVE),
        thing("c", SQUARE, two_sided=True, transform=ABOVE),
    )
    edges = s.triangles[:, 1:] - s.triangles[:, :1]
    normal = np.cross(edges[:, 0], edges[:, 1])
    for column, sign in ((0, 1.0), (1, -1.0)):
        patch = s.triangle_patch[:, column]
        known = patch >= 0
        assert np.all(sign * np.einsum("nk,nk->n", normal, s.normal[patch])[known] > 0.0)
        # Every corner of a triangle is one of its patch.
        same = s.triangles[known][:, :, None] == s.corners[patch[known]][:, None]
        assert np.all(same.all(axis=3).any(axis=2))
    assert sorted(set(s.triangle_patch[s.triangle_patch >= 0].tolist())) == list(range(s.patch_count))
    assert [s.object_ids[k] for k in s.object] == ["a"] * 2 + ["b"] * 4 + ["c"] * 2


def test_a_mirroring_transform_keeps_the_front_the_front() -> None:
    """Outside of a box stays outside when the box is mirrored."""
    corners = np.array([[x, y, z] for z in (0.0, 1.0) for y in (0.0, 1.0) for x in (0.0, 1.0)]) - 0.5
    faces = ((0, 2, 3, 1), (4, 5, 7, 6), (0, 4, 6, 2), (1, 3, 7, 5), (0, 1, 5, 4), (2, 6, 7, 3))
    for scale in ([1.0, 1.0, 1.0], [-2.0, 1.0, 3.0], [-1.0, -1.0, -1.0], [-1.0, 1.0, -1.0]):
        placed = Transform.from_parts(
            np.array([5.0, 6.0, 7.0]), np.array([0.1, 0.2, 0.3, 0.4]), np.array(scale)
        )
        material = Material(np.zeros(3), np.zeros(3))
        s = flattened(SceneObject("box", Mesh(corners, faces), material, placed))
        outward = s.corners.mean(axis=1) - [5.0, 6.0, 7.0]
        assert np.all(np.einsum("nk,nk->n", outward, s.normal) > 0.0)
        assert s.area.sum() == pytest.approx(2.0 * sum(abs(scale[k] * scale[k - 1]) for k in range(3)))


@given(st.floats(-3, 3), st.integers(0, 2**32 - 1))
def test_patches_are_what_their_corners_say(power: float, seed: int) -> None:
    random = np.random.default_rng(seed)
    q = random.normal(size=4)
    placed = Transform.from_parts(random.normal(size=3), q, np.full(3, 10.0**power))
    s = flattened(thing("a", SQUARE, CONCAVE, two_sided=True, transform=placed))
    assert s.area.sum() == pytest.approx(2 * 4.0 * 100.0**power)
    assert s.size == pytest.approx(float(np.linalg.norm(np.ptp(s.corners.reshape(-1, 3), axis=0))))
    np.testing.assert_allclose(np.linalg.norm(s.normal, axis=1), 1.0)
    doubled = np.cross(s.corners[:, 2] - s.corners[:, 0], s.corners[:, 3] - s.corners[:, 1])
    np.testing.assert_allclose(0.5 * doubled, s.area[:, None] * s.normal, atol=1e-9 * s.size**2)


# --- what is told ---


@pytest.mark.parametrize(("lines", "told"), [(1, "1 face of zero area"), (3, "3 faces of zero area")])
def test_dropped_faces_are_counted(lines: int, told: str) -> None:
    s = flattened(thing("good", SQUARE), thing("bad", SQUARE, *[LINE] * lines, transform=ABOVE))
    assert s.face_count == 2 and s.patch_count == 2
    assert s.warnings == (f"object 'bad': {told} dropped (first: 1)",)


def test_faces_that_cross_themselves_are_counted() -> None:
    s = flattened(thing("knot", [[0, 0, 0], [3, 0, 0], [0, 1, 0], [1, 2, 0]]))
    assert s.warnings == ("object 'knot': 1 face crossing itself, triangulated approximately (first: 0)",)


def test_warnings_come_object_by_object() -> None:
    s = flattened(thing("a", LINE), thing("b", SQUARE), thing("c", LINE, LINE))
    assert [warning.split(":")[0] for warning in s.warnings] == ["object 'a'", "object 'c'"]


# --- the scene as a whole ---


def test_an_empty_scene_and_one_of_empty_objects() -> None:
    for s in (flattened(), flattened(thing("a")), flattened(thing("a", LINE))):
        assert s.patch_count == s.face_count == 0
        assert s.corners.shape == (0, 4, 3) and s.triangles.shape == (0, 3, 3)
        assert s.triangle_patch.shape == (0, 2) and s.normal.shape == s.reflectance.shape == (0, 3)
        assert s.size > 0.0


def test_bounds_are_those_of_the_vertices_in_use() -> None:
    spare = Mesh(np.array([*SQUARE, [99.0, 99.0, 99.0]]), ((0, 1, 2, 3),))
    s = flattened(SceneObject("a", spare, Material(np.zeros(3), np.zeros(3))))
    np.testing.assert_array_equal(s.center, [0.5, 0.5, 0.0])
    assert s.size == pytest.approx(np.sqrt(2.0))


@pytest.mark.parametrize(
    ("reflectance", "emission", "grey"),
    [
        ((0.5, 0.5, 0.5), (1.0, 1.0, 1.0), True),
        ((0.5, 0.5, 0.4), (1.0, 1.0, 1.0), False),
        ((0.5, 0.5, 0.5), (1.0, 0.9, 1.0), False),
    ],
)
def test_a_scene_is_grey_if_all_of_it_is(
    reflectance: tuple[float, float, float], emission: tuple[float, float, float], grey: bool
) -> None:
    s = flattened(thing("a", SQUARE), thing("b", SQUARE, reflectance=reflectance, emission=emission))
    assert s.is_grey == grey


def test_specular_colours_count_where_a_scene_is_grey() -> None:
    tinted = Material(np.zeros(3), np.zeros(3), specular=np.array([0.1, 0.1, 0.2]))
    assert not flattened(replace(thing("a", SQUARE), material=tinted)).is_grey
