"""Laws that a solution obeys: energy, linearity, and that nobody's frame or order of objects is special."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from solver.engine.world import World
from solver.geometry.scene import Scene, SceneObject
from solver.transport.field import RadiosityField
from solver.transport.solve import RadiositySolver
from solver.types import FloatArray
from tests.pathtracing.worlds import material, world
from tests.transport.polygons import SEEDS, rotation
from tests.transport.solving import box, lit_cube, shelf, solved, turned

TOLERANCE = 0.03


def means(solver: RadiositySolver) -> FloatArray:
    """(p, 3) mean radiosity of every patch."""
    field = solver.field()
    flux = np.zeros((solver.surfaces.patch_count, 3))
    np.add.at(flux, field.patch, field.radiosity * field.area[:, None])
    return np.asarray(flux / solver.surfaces.area[:, None])


def difference(a: RadiositySolver, b: RadiositySolver, scale: float = 1.0) -> float:
    """Relative RMS difference of the patches' mean radiosities; b's times `scale`."""
    one, other, area = means(a), scale * means(b), b.surfaces.area[:, None]
    return float(np.sqrt((area * (one - other) ** 2).sum() / (area * other**2).sum()))


def power(solver: RadiositySolver, field: RadiosityField) -> tuple[FloatArray, FloatArray]:
    """Emitted and absorbed, (3,) W."""
    s = solver.surfaces
    emitted = s.area @ s.emission
    absorbed = field.area @ ((1.0 - s.reflectance[field.patch]) * field.irradiance)
    return np.asarray(emitted), np.asarray(absorbed)


@pytest.mark.parametrize("reflectance", [0.1, 0.5, 0.9, 0.99, (0.9, 0.5, 0.1)])
def test_closed_scenes_absorb_what_is_emitted(reflectance: float | tuple[float, float, float]) -> None:
    lamp = box("lamp", 0.2, (3.0, 2.0, 1.0), (0.4, 0.4, 0.7), (0.6, 0.6, 0.8), inward=False)
    block = box("block", reflectance, 0.0, (0.1, 0.2, 0.05), (0.4, 0.5, 0.35), inward=False)
    solver = solved(world(box("room", reflectance), lamp, block), TOLERANCE)
    assert solver.statistics().closed
    emitted, absorbed = power(solver, solver.field())
    np.testing.assert_allclose(absorbed, emitted, rtol=5e-3)


def test_open_scenes_absorb_less_than_is_emitted() -> None:
    open_box = World.of(lit_cube().scene.without_object("face0"))
    solver = solved(open_box, TOLERANCE)
    field = solver.field()
    emitted, absorbed = power(solver, field)
    # What leaves through the hole is what a black face there would absorb.
    closed = lit_cube().scene
    hole = closed.object("face0")
    black = solved(World.of(closed.with_replaced(SceneObject(hole.id, hole.mesh, material(0.0)))), TOLERANCE)
    lid = black.field().patch == 0
    escaped = black.field().area[lid] @ black.field().irradiance[lid]
    np.testing.assert_allclose(absorbed + escaped, emitted, rtol=0.01)
    assert escaped[0] > 0.1


@pytest.mark.parametrize("factor", [1e-6, 1e3, 1e9])
def test_light_is_linear(factor: float) -> None:
    """A thousand times the emission is a thousand times the radiosity, by the same elements."""
    one, other = solved(lit_cube(0.5, 1.0), TOLERANCE), solved(lit_cube(0.5, factor), TOLERANCE)
    a, b = one.field(), other.field()
    assert len(a.area) == pytest.approx(len(b.area), rel=0.3)
    assert difference(other, one, factor) < 2e-3


def test_two_lamps_are_their_sum() -> None:
    cube = lit_cube(0.6, 1.0).scene

    def lit(*names: str) -> RadiositySolver:
        faces = [SceneObject(o.id, o.mesh, material(0.6, 1.0 if o.id in names else 0.0)) for o in cube]
        return solved(world(*faces), TOLERANCE)

    both, apart = means(lit("face1", "face2")), means(lit("face1")) + means(lit("face2"))
    np.testing.assert_allclose(both, apart, rtol=0.02)


@settings(max_examples=6)
@given(seed=SEEDS, scale=st.sampled_from([1e-3, 1.0, 1e3]), shift=st.sampled_from([0.0, 5.0, 1000.0]))
def test_rotation_scale_and_place_change_nothing(seed: int, scale: float, shift: float) -> None:
    scene = shelf().scene
    turn = rotation(seed)
    moved = turned(scene, turn, scale * shift * turn[1], scale)
    before, after = solved(World.of(scene), TOLERANCE), solved(moved, TOLERANCE)
    np.testing.assert_allclose(after.surfaces.area, scale**2 * before.surfaces.area, rtol=1e-6)
    assert difference(after, before) < TOLERANCE
    assert after.error_estimate <= TOLERANCE


@settings(max_examples=6)
@given(order=st.permutations(range(7)))
def test_order_of_objects_changes_nothing(order: list[int]) -> None:
    scene = shelf().scene
    objects = list(scene)
    shuffled = Scene(objects={objects[k].id: objects[k] for k in order})
    before, after = solved(World.of(scene), TOLERANCE), solved(World.of(shuffled), TOLERANCE)
    light = dict(zip(after.surfaces.object_ids, means(after)[:, 0], strict=True))
    found = np.array([light[key] for key in before.surfaces.object_ids])
    np.testing.assert_allclose(found, means(before)[:, 0], rtol=TOLERANCE)


def test_grey_is_three_equal_channels() -> None:
    """One channel in a grey scene; three in the same scene with a speck of colour that nothing sees."""
    grey = shelf()
    speck = box("speck", (0.5, 0.4, 0.3), 0.0, (2.0, 2.0, 2.0), (2.01, 2.01, 2.01), inward=False)
    coloured = world(*grey.scene, speck)
    one, three = solved(grey, TOLERANCE), solved(coloured, TOLERANCE)
    assert one.statistics().channels == 1
    assert three.statistics().channels == 3
    seen = three.field().patch < grey.surfaces.patch_count
    assert np.ptp(three.field().radiosity[seen], axis=1).max() < 1e-9
    area = grey.surfaces.area[:, None]
    a, b = means(one), means(three)[: grey.surfaces.patch_count]
    assert np.sqrt((area * (a - b) ** 2).sum() / (area * a**2).sum()) < 5e-3


def test_channels_do_not_mix() -> None:
    """Each channel of a coloured scene is the grey scene of its reflectance and emission."""
    coloured = solved(lit_cube((0.8, 0.5, 0.1), (1.0, 2.0, 3.0)), 0.02)
    for channel, (reflectance, emission) in enumerate(((0.8, 1.0), (0.5, 2.0), (0.1, 3.0))):
        grey = solved(lit_cube(reflectance, emission), 0.02)
        np.testing.assert_allclose(means(coloured)[:, channel], means(grey)[:, 0], rtol=0.01)


def test_radiosity_is_emission_and_what_is_reflected() -> None:
    solver = solved(shelf(), TOLERANCE)
    field, s = solver.field(), solver.surfaces
    expected = s.emission[field.patch] + s.reflectance[field.patch] * field.irradiance
    np.testing.assert_allclose(field.radiosity, expected, rtol=1e-12)
    assert field.irradiance.min() >= 0.0
