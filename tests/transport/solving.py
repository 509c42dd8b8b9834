"""Solves and their states, ready to be looked into."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from solver.engine.world import World
from solver.geometry.scene import Mesh, Scene, SceneObject
from solver.illumination.interpolation.correction import corrected
from solver.illumination.points.point_irradiance import PointIrradiance
from solver.transport.settings import SolverSettings
from solver.transport.solve import RadiositySolver
from solver.transport.state import TransportState
from solver.types import BoolArray, FloatArray, Points
from tests.pathtracing.worlds import CUBE, INWARD, OUTWARD, material, world

Rgb = float | Sequence[float]

DEFAULT: Final = SolverSettings()


def solver_of(of: World, settings: SolverSettings = DEFAULT) -> RadiositySolver:
    """A solver that has done nothing yet."""
    return RadiositySolver(of.surfaces, of.rays, settings)


def finish(solver: RadiositySolver) -> RadiositySolver:
    """The solver, when it has done all it can."""
    while solver.step(10.0):
        pass
    return solver


def solved(
    of: World, tolerance: float = DEFAULT.error_tolerance, settings: SolverSettings = DEFAULT
) -> RadiositySolver:
    """A finished solve."""
    return finish(solver_of(of, replace(settings, error_tolerance=tolerance)))


def state_of(solver: RadiositySolver) -> TransportState:
    """What the solver works on."""
    return solver._state


def box(
    name: str,
    reflectance: Rgb,
    emission: Rgb = 0.0,
    low: Sequence[float] = (0.0, 0.0, 0.0),
    high: Sequence[float] = (1.0, 1.0, 1.0),
    inward: bool = True,
) -> SceneObject:
    """A box seen from inside, or from outside, of one material."""
    corners = np.asarray(low) + CUBE * (np.asarray(high) - np.asarray(low))
    return SceneObject(name, Mesh(corners, INWARD if inward else OUTWARD), material(reflectance, emission))


def lit_cube(reflectance: Rgb = 0.5, emission: Rgb = 1.0) -> World:
    """The unit cube seen from inside, with one material on all faces and a ceiling that emits."""
    return world(
        *(
            SceneObject(f"face{k}", Mesh(CUBE, (face,)), material(reflectance, emission if k == 1 else 0.0))
            for k, face in enumerate(INWARD)
        )
    )


def furnace(reflectance: float, emission: float = 1.0, shift: float = 0.0) -> World:
    """A closed box with a block that floats in it, all of one material, moved by `shift` metres along x.

    Rays depend on where elements are: that is another draw of them.
    """
    low, high = (0.3 + shift, 0.25, 0.35), (0.6 + shift, 0.7, 0.65)
    return world(
        box("room", reflectance, emission, (shift, 0.0, 0.0), (1.0 + shift, 1.0, 1.0)),
        box("block", reflectance, emission, low, high, inward=False),
    )


def shelf(two_sided: bool = False) -> World:
    """The lit cube with a board in it that casts shadows."""
    cube = lit_cube()
    board = np.array([[0.2, 0.2, 0.5], [0.8, 0.2, 0.5], [0.8, 0.8, 0.6], [0.2, 0.8, 0.6]])
    return World.of(
        cube.scene.with_object(
            SceneObject("board", Mesh(board, ((0, 1, 2, 3),)), material(0.6, 0.0, two_sided))
        )
    )


def irradiance_at(solver: RadiositySolver, positions: Points, normals: FloatArray) -> FloatArray:
    """(n, 3) irradiance at points anywhere, by the solution as it stands, W/m2."""
    point = PointIrradiance.of(solver.state, solver.hierarchy, 1e-4)
    return np.asarray(np.broadcast_to(point.anywhere(positions, normals), (len(positions), 3)))


def corrected_irradiance_at(solver: RadiositySolver, positions: Points, normals: FloatArray) -> FloatArray:
    """As `irradiance_at`, with what the links missed put back."""
    work = corrected(solver.state, PointIrradiance.of(solver.state, solver.hierarchy))
    while True:
        try:
            next(work)
        except StopIteration as end:
            point = PointIrradiance.of(end.value, solver.hierarchy)
            return np.asarray(np.broadcast_to(point.anywhere(positions, normals), (len(positions), 3)))


def leaves_of(state: TransportState) -> BoolArray:
    """(n,) which elements are leaves."""
    return np.asarray(state.tree.child < 0)


def random_functions(state: TransportState, seed: int) -> FloatArray:
    """Functions (n, 3, channels) on the leaves; their gradients change them by about their mean."""
    random = np.random.default_rng(seed)
    functions = random.normal(size=(len(state.tree), 3, state.channels))
    functions[:, 1:] /= np.sqrt(state.tree.area)[:, None, None]
    functions[~leaves_of(state)] = 0.0
    return functions


def inner(state: TransportState, a: FloatArray, b: FloatArray) -> float:
    """The integral over all leaves of the product of two functions (n, 3, channels), W2/m2."""
    leaf = leaves_of(state)
    moment = state.tree.moment[leaf][:, :, None]
    a, b = a[leaf], b[leaf]
    density = (
        a[:, 0] * b[:, 0]
        + moment[:, 0] * a[:, 1] * b[:, 1]
        + moment[:, 1] * (a[:, 1] * b[:, 2] + a[:, 2] * b[:, 1])
        + moment[:, 2] * a[:, 2] * b[:, 2]
    )
    return float((state.tree.area[leaf, None] * density).sum())


def raw_rows(solver: RadiositySolver) -> FloatArray:
    """(leaves,) sums of the form factors as the links have them, before they are balanced."""
    state = state_of(solver)
    one = np.zeros((len(state.tree), 3, 1))
    one[:, 0] = 1.0
    closure, remainder = state.closure, state.remainder
    state.closure, state.remainder = np.ones_like(closure), np.zeros_like(remainder)
    rows = state.gather(one)[leaves_of(state), 0, 0]
    state.closure, state.remainder = closure, remainder
    return np.asarray(rows)


def turned(of: Scene, turn: FloatArray, shift: Points, scale: float) -> World:
    """The scene rotated, scaled and moved, in its vertices."""
    return World.of(
        Scene(
            objects={
                o.id: SceneObject(
                    o.id, Mesh(scale * (o.world_vertices @ turn.T) + shift, o.mesh.faces), o.material
                )
                for o in of
            }
        )
    )
