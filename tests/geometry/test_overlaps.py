"""Faces in one place: each place keeps one face, and which one it is does not hang on where the scene is."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from solver.geometry.scene import Mesh, Scene, SceneObject
from solver.geometry.surfaces import Surfaces, flatten
from solver.types import FloatArray
from tests.pathtracing.worlds import material, square
from tests.transport.polygons import SEEDS, regular, rotation
from tests.transport.solving import box

FLOOR = square("floor", material(0.5), 0.0)


def sheet(
    name: str, height: float = 0.0, two_sided: bool = False, down: bool = False, low: float = 0.25
) -> SceneObject:
    """A square of a quarter of the floor, over its middle or aside of it."""
    return square(name, material(0.5, 0.0, two_sided), height, down, low, low + 0.5)


def flat(*objects: SceneObject) -> Surfaces:
    return flatten(Scene(objects={o.id: o for o in objects}))


def areas(surfaces: Surfaces) -> dict[str, float]:
    """m2 of each object's fronts."""
    fronts = surfaces.side == 0
    found = np.bincount(surfaces.object[fronts], surfaces.area[fronts], len(surfaces.object_ids))
    return dict(zip(surfaces.object_ids, found.tolist(), strict=True))


@pytest.mark.parametrize(
    ("one", "other", "floor", "rug"),
    [
        (FLOOR, sheet("rug"), 0.75, 0.25),
        (sheet("rug"), FLOOR, 1.0, 0.0),
        (sheet("rug", 1e-7), FLOOR, 0.75, 0.25),
        (FLOOR, sheet("rug", -1e-7), 1.0, 0.0),
        (FLOOR, sheet("rug", 1e-4), 1.0, 0.25),
        (FLOOR, sheet("rug", 0.0, two_sided=True, down=True), 0.75, 0.25),
        (FLOOR, sheet("rug", 0.0, down=True), 1.0, 0.25),
        (FLOOR, sheet("rug", 1e-7, down=True), 1.0, 0.25),
        (FLOOR, sheet("rug", 0.0, low=1.0), 1.0, 0.25),
        (FLOOR, sheet("rug", 0.0, low=0.75), 0.9375, 0.25),
    ],
    ids=[
        "on it", "under it", "just over it", "just under it", "over it", "two-sided, upside down",
        "back to back", "face to face", "beside it", "half on it",
    ],
)  # fmt: skip
def test_what_lies_beneath_is_cut(one: SceneObject, other: SceneObject, floor: float, rug: float) -> None:
    found = areas(flat(one, other))
    assert found["floor"] == pytest.approx(floor, rel=1e-9)
    assert found["rug"] == pytest.approx(rug, rel=1e-9)


def test_it_is_told() -> None:
    surfaces = flat(FLOOR, sheet("rug"))
    assert surfaces.warnings == ("object 'floor': 1 face cut to what no other face in the same place covers",)
    assert surfaces.face_count == 2
    assert not flat(FLOOR, sheet("rug", 1e-4)).warnings


def test_boxes_side_by_side_and_upon_each_other_stay_whole() -> None:
    boxes = [
        box(f"{x}{y}{z}", 0.5, 0.0, (x, y, z), (x + 1.0, y + 1.0, z + 1.0), inward=False)
        for x in (0, 1)
        for y in (0, 1)
        for z in (0, 1)
    ]
    surfaces = flat(*boxes)
    assert surfaces.patch_count == 48
    assert not surfaces.warnings


@pytest.mark.parametrize("two_sided", [False, True])
def test_of_equal_objects_the_last_is_left(two_sided: bool) -> None:
    objects = [SceneObject(f"{k}", FLOOR.mesh, material(0.5, 0.0, two_sided)) for k in range(5)]
    assert areas(flat(*objects)) == {"0": 0.0, "1": 0.0, "2": 0.0, "3": 0.0, "4": 1.0}
    assert flat(*objects).patch_count == (2 if two_sided else 1)


@settings(max_examples=60)
@given(
    seed=SEEDS,
    count=st.integers(2, 6),
    scale=st.sampled_from([1e-3, 1.0, 1e4]),
    away=st.sampled_from([0.0, 1e5]),
    two_sided=st.booleans(),
)
def test_a_place_is_covered_once(seed: int, count: int, scale: float, away: float, two_sided: bool) -> None:
    """The areas that are left sum up to that of the union; the last polygon is whole, all pieces convex."""
    random = np.random.default_rng(seed)
    polygons = []
    for _ in range(count):
        at = np.array([*random.uniform(-0.7, 0.7, 2), 0.0])
        polygons.append(at + regular(int(random.integers(3, 6)), random.uniform(0.2, 1.0)))
    turn, origin = rotation(seed), away * random.normal(size=3)
    objects = []
    for k, flat_one in enumerate(polygons):
        world = scale * (flat_one @ turn.T) + origin
        if two_sided and random.random() < 0.5:
            world = world[::-1]
        mesh = Mesh(np.ascontiguousarray(world), (tuple(range(len(world))),))
        objects.append(SceneObject(f"{k}", mesh, material(0.5, 0.0, two_sided)))
    surfaces = flat(*objects)
    outlines = [shapely.Polygon(p[:, :2]) for p in polygons]
    found = areas(surfaces)
    rounding = 3e-5 + 1e-10 * away / scale
    union = shapely.union_all(outlines).area
    assert sum(found.values()) == pytest.approx(scale**2 * union, rel=rounding)
    assert found[f"{count - 1}"] == pytest.approx(scale**2 * outlines[-1].area, rel=rounding)
    for k, outline in enumerate(outlines):
        own = outline.difference(shapely.union_all(outlines[k + 1 :])).area
        assert found[f"{k}"] == pytest.approx(scale**2 * own, abs=rounding * scale**2)
    assert np.all(turns(surfaces) >= 0.0)


def turns(surfaces: Surfaces) -> FloatArray:
    """Along the normal, at each corner of each patch."""
    edge = np.roll(surfaces.corners, -1, axis=1) - surfaces.corners
    turn = np.cross(edge, np.roll(edge, -1, axis=1))
    return np.asarray(np.einsum("pki,pi->pk", turn, surfaces.normal))


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_walls_of_many_tiles_are_left_alone(axis: int) -> None:
    """14,400 in one plane, which would be 10^8 pairs."""
    n = 120
    x, y = np.meshgrid(np.arange(n + 1.0), np.arange(n + 1.0), indexing="ij")
    vertices = np.insert(np.stack([x.ravel(), y.ravel()], axis=1), axis, 0.0, axis=1)
    corner = np.arange(n)[:, None] * (n + 1) + np.arange(n)
    faces = np.stack([corner, corner + n + 1, corner + n + 2, corner + 1], axis=-1).reshape(-1, 4)
    mesh = Mesh(vertices, tuple(tuple(face) for face in faces.tolist()))
    surfaces = flat(SceneObject("tiles", mesh, material(0.5)), sheet("far", 1.0))
    assert surfaces.patch_count == n * n + 1
    assert not surfaces.warnings
