"""Closed rooms seen from within, from anywhere, at any scale: nothing shows through cracks."""

from __future__ import annotations

import numpy as np
import pytest

from solver.geometry.scene import Camera, Mesh, SceneObject
from solver.geometry.surfaces import Surfaces
from solver.illumination.meshing.topology import connect
from solver.rendering.geometry_layers import rays
from solver.rendering.renderer import FrameRenderer, Layer, Shading
from solver.rendering.tessellation import RenderMesh, Tessellator
from solver.types import FloatArray, Points, Vector
from tests.rendering.fields import Split, build_field, constant, polygons, surfaces_of, towards, uneven

Face = list[tuple[float, float, float]]

# A unit cube, seen from within. Two walls are made of several faces, one of them a triangle pair, so that
# corners of one lie inside edges of another [H 3.6, case C].
ROOM: list[Face] = [
    [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)],
    [(0, 0, 1), (0, 1, 1), (1, 1, 1), (1, 0, 1)],
    [(0, 0, 0), (0, 0, 1), (0.3, 0, 1), (0.3, 0, 0)],
    [(0.3, 0, 0), (0.3, 0, 1), (1, 0, 1)],
    [(0.3, 0, 0), (1, 0, 1), (1, 0, 0)],
    [(0, 1, 0), (1, 1, 0), (1, 1, 0.6), (0, 1, 0.6)],
    [(0, 1, 0.6), (1, 1, 0.6), (1, 1, 1), (0, 1, 1)],
    [(0, 0, 0), (0, 1, 0), (0, 1, 1), (0, 0, 1)],
    [(1, 0, 0), (1, 0, 1), (1, 1, 1), (1, 1, 0)],
]  # fmt: skip
OUTSIDE: list[Face] = [[tuple(3.0 * c - 1.0 for c in p) for p in face] for face in ROOM]  # type: ignore[misc]


def placed(scale: float = 1.0, offset: float = 0.0) -> Surfaces:
    """The room, and a bright one around it that only a crack would show."""
    room = polygons(*ROOM, name="room")
    outside = polygons(*OUTSIDE, name="outside", emission=1e4)

    def move(thing: SceneObject) -> SceneObject:
        moved = thing.mesh.vertices * scale + offset
        return SceneObject(thing.id, Mesh(moved, thing.mesh.faces), thing.material)

    return surfaces_of(move(room), move(outside))


def tessellate(surfaces: Surfaces, split: Split) -> RenderMesh:
    """Constant irradiance of 1 in a room of reflectance 0.5."""
    return Tessellator(surfaces).mesh(build_field(surfaces, split, constant(1.0)))


def look(eye: Vector, target: Vector, fov: float, size: tuple[int, int] = (160, 120)) -> Camera:
    up = np.array([0.02, 0.05, 1.0]) if abs((target - eye)[2]) < 0.9 * np.linalg.norm(target - eye) else None
    return Camera(eye, target, np.array([0.3, 1.0, 0.0]) if up is None else up, fov, *size)


def assert_closed(renderer: FrameRenderer, mesh: RenderMesh, view: Camera, rounding: float = 1e-5) -> None:
    """Every pixel shows the room, lit, but for what the rasteriser's interpolation rounds."""
    assert np.all(renderer.draw(mesh, view, Shading.FLAT, Layer.OBJECT) == 0)
    frame = renderer.draw(mesh, view, Shading.GOURAUD, Layer.RADIANCE)
    np.testing.assert_allclose(frame, 0.5 / np.pi, rtol=rounding)


@pytest.mark.parametrize("seed", range(3))
def test_rooms_are_closed_from_everywhere(seed: int, renderer: FrameRenderer) -> None:
    random = np.random.default_rng(seed)
    mesh = tessellate(placed(), uneven(seed, 5))
    for _ in range(25):
        eye, target = random.uniform(0.02, 0.98, (2, 3))
        assert_closed(renderer, mesh, look(eye, target, float(random.uniform(20.0, 120.0))))


def test_rooms_are_closed_where_t_vertices_are(renderer: FrameRenderer) -> None:
    surfaces = placed()
    split = towards((0.3, 0.0, 0.4), 7)
    mesh = tessellate(surfaces, split)
    topology = connect(build_field(surfaces, split))
    hanging: Points = topology.position[topology.inside]
    corners = np.array([(0.3, 0, 0), (0.3, 0, 1), (0, 1, 0.6), (1, 1, 0.6)], dtype=np.float64)
    hanging = hanging[np.all((hanging >= 0.0) & (hanging <= 1.0), axis=1)]
    assert len(hanging) > 10
    random = np.random.default_rng(5)
    for target in [*corners, *random.permutation(hanging)[:30]]:
        eye = random.uniform(0.2, 0.8, 3)
        assert_closed(renderer, mesh, look(eye, target, 0.5))
        assert_closed(renderer, mesh, look(eye, target, 8.0))


@pytest.mark.parametrize(
    ("scale", "offset"), [(1e-3, 0.0), (1e-3, 50.0), (1.0, 1e5), (1e4, 0.0), (1e4, 1e5), (1e4, -3e5)]
)
def test_rooms_of_any_size_anywhere(scale: float, offset: float, renderer: FrameRenderer) -> None:
    mesh = tessellate(placed(scale, offset), uneven(2, 4))
    random = np.random.default_rng(8)
    for _ in range(6):
        eye, target = random.uniform(0.05, 0.95, (2, 3)) * scale + offset
        view = look(eye, target, 70.0)
        assert_closed(renderer, mesh, view)
        depth = renderer.draw(mesh, view, Shading.FLAT, Layer.DEPTH)
        np.testing.assert_allclose(
            depth, cast(view, scale, offset), rtol=1e-6 * (1 + abs(offset) / scale / 1e4)
        )


def cast(view: Camera, scale: float, offset: float) -> FloatArray:
    """Depth of the room's walls, by slabs: the nearest exit of each ray from the cube."""
    directions = rays(view)
    eye = (view.eye - offset) / scale
    with np.errstate(divide="ignore"):
        exits = np.where(directions > 0.0, (1.0 - eye) / directions, -eye / directions)
    return np.asarray(scale * exits.min(axis=-1))


@pytest.mark.parametrize("away", [1e-3, 1e-5, 1e-6])
def test_cameras_close_to_a_wall(away: float, renderer: FrameRenderer) -> None:
    """Facing it, with the back to it, along it, and in a corner."""
    mesh = tessellate(placed(), uneven(2, 4))
    for eye, target in (
        ((0.4, 0.45, away), (0.4, 0.45, 0.0)),
        ((0.4, 0.45, away), (0.5, 0.5, 1.0)),
        ((0.4, 0.45, away), (0.9, 0.5, away)),
        ((0.4, 0.45, away), (0.9, 0.5, 0.0)),
        ((away, away, away), (0.9, 0.8, 0.7)),
        ((away, away, away), (0.9, 0.8, 0.0)),
    ):
        view = look(np.array(eye), np.array(target), 70.0)
        # Along a wall that is seen edge on, llvmpipe interpolates a constant to 0.3 %.
        assert_closed(renderer, mesh, view, rounding=0.01)
        depth = renderer.draw(mesh, view, Shading.FLAT, Layer.DEPTH)
        # In a corner, the rasteriser's 256th of a pixel decides which wall it is: 5e-5 of the depth.
        # Seen edge on, a wall is as deep as its leaf that a rounded vertex has moved into the pixel.
        clear = np.abs(rays(view)).min(axis=-1) > 0.02
        np.testing.assert_allclose(depth[clear], cast(view, 1.0, 0.0)[clear], rtol=5e-5)


def test_small_gaps_are_ordered_right(renderer: FrameRenderer) -> None:
    """A lamp half a millimetre under a ceiling ten metres away, the eye a millimetre from a wall."""
    ceiling = [(-5.0, -5.0, 3.0), (-5.0, 5.0, 3.0), (5.0, 5.0, 3.0), (5.0, -5.0, 3.0)]
    lamp = [(2.0, -2.0, 2.9995), (2.0, 2.0, 2.9995), (4.9, 2.0, 2.9995), (4.9, -2.0, 2.9995)]
    wall = [(-5.0, -5.0, 0.0), (-5.0, 5.0, 0.0), (-5.0, 5.0, 3.0), (-5.0, -5.0, 3.0)]
    surfaces = surfaces_of(
        polygons(ceiling, name="ceiling"), polygons(lamp, name="lamp"), polygons(wall, name="wall")
    )
    mesh = Tessellator(surfaces).mesh(build_field(surfaces, uneven(1, 4)))
    view = look(np.array([-4.999, 0.1, 1.0]), np.array([4.0, 0.0, 2.9]), 60.0, (320, 240))
    shown = renderer.draw(mesh, view, Shading.FLAT, Layer.OBJECT)
    directions = rays(view)
    with np.errstate(divide="ignore"):
        t = (2.9995 - view.eye[2]) / directions[:, :, 2]
    met = view.eye + t[:, :, None] * directions
    inside = (t > 0) & (met[:, :, 0] > 2.01) & (met[:, :, 0] < 4.89) & (np.abs(met[:, :, 1]) < 1.99)
    assert inside.sum() > 500
    assert np.all(shown[inside] == 1)
