"""Frames by virtual lights of scenes with mirrors and gloss: closed forms, and path-traced frames."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.ndimage import maximum_filter

from solver.engine.drawing import Drawing
from solver.engine.instant.frame import InstantFrame
from solver.engine.instant.frames import InstantFrames
from solver.engine.world import World
from solver.geometry.scene import Camera, Material, Mesh, Scene, SceneObject
from solver.illumination.settings import Compensation, LightSettings
from solver.pathtracing import PathTracer
from solver.types import LUMINANCE_WEIGHTS, FloatArray
from tests.illumination.particles.rooms import CUBE, INWARD, material, polygon, square

GREY = material(0.5)
BLACK = material(0.0, two_sided=True)


def scene_of(*objects: SceneObject) -> Scene:
    return Scene(objects={o.id: o for o in objects})


def looking(eye: list[float], target: list[float], size: int = 5, fov: float = 40.0) -> Camera:
    up = np.array([0.0, 1.0, 0.01]) if eye[:2] == target[:2] else np.array([0.0, 0.0, 1.0])
    return Camera(np.array(eye), np.array(target), up, fov, size, size)


def lit(
    drawing: Drawing, scene: Scene, camera: Camera, paths: int = 64, samples: int = 1, **settings: Any
) -> InstantFrame:
    """A frame with at least that many paths, all blocks of the ring among them."""
    frames = InstantFrames(World.of(scene), replace(LightSettings(), **settings), lambda: None)
    return work(frames.ask(camera, samples, 0.0, drawing).frame, paths)


def work(frame: InstantFrame, paths: int = 64) -> InstantFrame:
    while not frame.is_new or frame.paths < paths:
        frame.step()
    return frame


# --- what mirrors show ---


def test_a_lamp_in_a_mirror_has_its_radiance_times_the_reflectance(drawing: Drawing) -> None:
    scene = scene_of(
        square("mirror", material(0.0, specular=(0.8, 0.5, 0.2)), 0.0, low=-1.0),
        square(
            "lamp", material(0.0, (3.0, 2.0, 1.0), emission_exponent=6.0), 2.0, down=True, low=-3.0, high=3.0
        ),
    )
    camera = looking([0.0, 0.0, 1.9], [0.0, 0.0, 0.0])
    found = lit(drawing, scene, camera).radiance()[2, 2]
    np.testing.assert_allclose(found, np.array([0.8, 0.5, 0.2]) * [3.0, 2.0, 1.0] * 4.0 / math.pi, rtol=1e-4)


def turned(name: str, x: float, z: float, up: bool, specular: float) -> SceneObject:
    """A mirror at half a right angle, which turns +z into +x, or +x into +z."""
    corners = np.array([[0.3, -0.3, 0.3], [-0.3, -0.3, -0.3], [-0.3, 0.3, -0.3], [0.3, 0.3, 0.3]])
    way = corners[::-1] if up else corners
    return polygon(name, np.add(way, [x, 0.0, z]), material(0.0, specular=specular))


def test_a_periscope_shows_the_radiance_times_both_reflectances(drawing: Drawing) -> None:
    scene = scene_of(
        turned("first", 0.0, 1.0, False, 0.9),
        turned("second", 1.0, 1.0, True, 0.6),
        square("lamp", material(0.0, 1.0), 3.0, down=True, low=-2.0, high=4.0),
        polygon("lid", [[-1, -1, 1.5], [0.5, -1, 1.5], [0.5, 1, 1.5], [-1, 1, 1.5]], BLACK),
    )
    frame = lit(drawing, scene, looking([0.0, 0.0, 0.1], [0.0, 0.0, 1.0], 3, 10.0))
    np.testing.assert_allclose(frame.radiance()[1, 1], 0.9 * 0.6 / math.pi, rtol=1e-6)


def test_a_mirror_floor_is_a_second_lamp(drawing: Drawing) -> None:
    """A wall has the light of the lamp and of its image, as if that were a lamp itself."""
    wall = polygon("wall", [[0, 0, 0], [0, 4, 0], [0, 4, 3], [0, 0, 3]], GREY)

    def lamp(name: str, z: float, up: bool, emission: float) -> SceneObject:
        return SceneObject(
            name,
            Mesh(
                np.array([[1.0, 1.5, z], [1.0, 2.5, z], [2.0, 2.5, z], [2.0, 1.5, z]]),
                ((3, 2, 1, 0) if up else (0, 1, 2, 3),),
            ),
            material(0.0, emission),
        )

    floor = polygon("floor", [[0, -6, 0], [12, -6, 0], [12, 10, 0], [0, 10, 0]], material(0.0, specular=0.7))
    camera = looking([6.0, 2.0, 1.5], [0.0, 2.0, 1.5], 12, 25.0)
    with_mirror = lit(
        drawing, scene_of(wall, floor, lamp("lamp", 2.0, False, 5.0)), camera, 512, vpl_reach=0.0
    )
    twice = scene_of(wall, lamp("lamp", 2.0, False, 5.0), lamp("image", -2.0, True, 3.5))
    with_lamps = lit(drawing, twice, camera, 512, vpl_reach=0.0)
    assert with_mirror.irradiance().min() > 0.0
    np.testing.assert_allclose(with_mirror.irradiance(), with_lamps.irradiance(), rtol=0.02)
    alone = lit(drawing, scene_of(wall, lamp("lamp", 2.0, False, 5.0)), camera, 512, vpl_reach=0.0)
    assert with_mirror.irradiance().mean() > 1.3 * alone.irradiance().mean()


def test_layers_of_irradiance_show_what_falls_on_the_mirror_itself(drawing: Drawing) -> None:
    def of(floor: Material) -> FloatArray:
        scene = scene_of(
            square("floor", floor, 0.0, low=-1.0),
            square("lamp", material(0.0, 1.0), 2.0, down=True),
        )
        return lit(drawing, scene, looking([0.0, 0.0, 1.5], [0.0, 0.0, 0.0])).irradiance()

    matt = of(material(0.5))
    assert matt.min() > 0.0
    np.testing.assert_array_equal(of(material(0.5, specular=0.3)), matt)


def test_an_exponent_without_specular_reflectance_changes_no_bit(drawing: Drawing) -> None:
    def of(exponent: float) -> FloatArray:
        scene, camera = room(material(0.5, exponent=exponent), GREY)
        return lit(drawing, scene, camera, 100, 2).radiance()

    np.testing.assert_array_equal(of(20.0), of(math.inf))


# --- against paths ---


def room(floor: Material, wall: Material) -> tuple[Scene, Camera]:
    """A room with a lamp below its ceiling and a screen that throws a shadow."""
    walls = [floor, GREY, material((0.3, 0.6, 0.3)), wall, GREY, material((0.7, 0.3, 0.3))]
    scene = scene_of(
        *(SceneObject(f"face{k}", Mesh(CUBE, (INWARD[k],)), walls[k]) for k in range(6)),
        square("lamp", material(0.0, (12.0, 10.0, 8.0)), 0.98, down=True, low=0.3, high=0.7),
        polygon(
            "screen",
            [[0.5, 0.55, 0.0], [0.7, 0.75, 0.0], [0.7, 0.75, 0.6], [0.5, 0.55, 0.6]],
            material(0.6, two_sided=True),
        ),
    )
    eye = Camera(
        np.array([0.1, 0.08, 0.6]), np.array([0.9, 0.8, 0.35]), np.array([0.0, 0.0, 1.0]), 70.0, 20, 15
    )
    return scene, eye


def apart(drawing: Drawing, floor: Material, wall: Material, paths: int) -> tuple[float, float, float, float]:
    """How much of the light a frame has of that of one by paths; relative RMS difference; noise of
    the paths; what the frame tells of its error.

    Pixels that show the lamp, by a mirror or not, and those beside them are left out: they show where
    samples are.
    """
    scene, camera = room(floor, wall)
    world = World.of(scene)
    traced = PathTracer(world.surfaces, world.rays).frame(camera, 64, 32)
    traced.run()
    expected, noise = traced.radiance @ LUMINANCE_WEIGHTS, traced.standard_error @ LUMINANCE_WEIGHTS
    finer = replace(camera, width=2 * camera.width, height=2 * camera.height)
    frame = lit(drawing, scene, finer, paths, 16)
    fine = frame.radiance() @ LUMINANCE_WEIGHTS
    found = fine.reshape(camera.height, 2, camera.width, 2).mean(axis=(1, 3))
    matt = maximum_filter(expected, 3) < 1.0
    found, expected, noise = found[matt], expected[matt], noise[matt]
    scale = math.sqrt(float(np.mean(expected**2)))
    return (
        float(found.mean() / expected.mean()),
        math.sqrt(float(np.mean((found - expected) ** 2))) / scale,
        math.sqrt(float(np.mean(noise**2))) / scale,
        frame.error_estimate,
    )


MIRROR = material((0.1, 0.1, 0.2), specular=(0.8, 0.7, 0.6))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("floor", "wall"),
    [
        (GREY, MIRROR),
        (material(0.3, specular=0.4, exponent=20.0), GREY),
        (material(0.3, specular=0.4, exponent=20.0), MIRROR),
        (GREY, material(0.1, specular=0.7, exponent=300.0)),
    ],
    ids=["mirror", "broad", "both", "narrow"],
)
def test_frames_are_those_of_paths(drawing: Drawing, floor: Material, wall: Material) -> None:
    """In the mean within 1 %, pixel by pixel within what both tell of their errors."""
    ratio, difference, noise, told = apart(drawing, floor, wall, 2048)
    assert abs(ratio - 1.0) < 0.01
    assert difference < 1.5 * math.hypot(told, noise)


@pytest.mark.parametrize("settings", [{"vpl_reach": 0.0}, {"vpl_compensation": Compensation.RAYS}])
def test_light_between_mirrors_is_no_more_than_what_came_in(
    drawing: Drawing, settings: dict[str, Any]
) -> None:
    """A furnace: all walls emit, and reflect half, partly as mirrors: everywhere E / (1 - rho) at most.

    What is left out has met five mirrors in a row: rho_s^5 of the light at most.
    """
    walls = [material(0.3, 1.0, specular=0.2)] * 3 + [material(0.5, 1.0)] * 3
    scene = scene_of(*(SceneObject(f"face{k}", Mesh(CUBE, (INWARD[k],)), walls[k]) for k in range(6)))
    camera = looking([0.15, 0.2, 0.8], [0.9, 0.8, 0.3], 12, 80.0)
    found = lit(drawing, scene, camera, 384, **settings).radiance() * math.pi
    np.testing.assert_allclose(found.mean(), 2.0, rtol=0.01)


# --- edits ---


def test_a_floor_that_becomes_a_mirror_shows_itself_at_once(drawing: Drawing) -> None:
    """The room stays, the mirrored points are new, and in the end all is as in a frame of its own."""
    before, camera = room(GREY, GREY)
    after, _ = room(GREY, MIRROR)
    frames = InstantFrames(World.of(before), LightSettings(), lambda: None)
    work(frames.ask(camera, 2, 0.0, drawing).frame)
    frames.follow(World.of(after))
    frame = frames.ask(camera, 2, 0.0, drawing).frame
    fresh = lit(drawing, after, camera, 64, 2)
    while not frame.is_drawable:
        frame.step()
    assert np.all(np.isfinite(frame.radiance()))
    assert not frame.is_new and frame.point_count > fresh.point_count // 2
    work(frame)
    while fresh.paths < frame.paths:
        fresh.step()
    np.testing.assert_array_equal(frame.radiance(), fresh.radiance())


def test_gloss_stays_while_nothing_near_it_changes(drawing: Drawing) -> None:
    """An edit that changes no light leaves the old picture, lobes and all, until blocks replace it."""
    scene, camera = room(material(0.3, specular=0.4, exponent=20.0), MIRROR)
    frames = InstantFrames(World.of(scene), LightSettings(), lambda: None)
    old = work(frames.ask(camera, 1, 0.0, drawing).frame).radiance()
    frames.follow(World.of(scene))
    again = frames.ask(camera, 1, 0.0, drawing).frame
    np.testing.assert_allclose(again.radiance(), old, rtol=1e-5)
