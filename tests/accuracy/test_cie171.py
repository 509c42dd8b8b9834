"""Cases of CIE 171:2006, checked against what their formulas give exactly; the tables are rounded.

A point source is a lamp much smaller than all distances, of the same power. All values are photometric:
W stands for lm.
"""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from solver.engine.world import World
from solver.geometry.scene import Mesh, SceneObject
from solver.transport.solve import RadiositySolver
from solver.types import FloatArray
from tests.pathtracing.worlds import material, polygon, world
from tests.transport.solving import box, irradiance_at, solved

REFERENCE = Path(__file__).parents[1] / "data" / "reference"
CASES: dict[str, Any] = json.loads((REFERENCE / "cie171.json").read_text())
CUBE: dict[str, Any] = json.loads((REFERENCE / "cube.json").read_text())[
    "cube_with_isotropic_point_source_at_centre"
]

ROUNDED = 2.5e-3
"""Of the published tables, which do not quite follow their own formulas."""

FLUX = 10_000.0
"""lm, of the isotropic sources"""


def rectangle(x: tuple[float, float], y: tuple[float, float], z: float, down: bool = False) -> FloatArray:
    corners = np.array([[x[0], y[0], z], [x[1], y[0], z], [x[1], y[1], z], [x[0], y[1], z]])
    return corners[::-1] if down else corners


def bulb(center: tuple[float, float, float], radius: float, flux: float, splits: int = 2) -> SceneObject:
    """A black ball of 20 x 4^splits triangles that emits evenly; all but isotropic."""
    golden = 0.5 * (1.0 + 5.0**0.5)
    faces = np.array(
        [
            (one, two, three)
            for one in range(12)
            for two in range(12)
            for three in range(12)
            if one < two and one < three and two != three
        ]
    )
    signs = np.array([[a, b] for a in (-1.0, 1.0) for b in (-golden, golden)])
    corners = np.concatenate([np.roll(np.pad(signs, ((0, 0), (1, 0))), k, axis=1) for k in range(3)])
    sides = np.stack([corners[faces[:, k]] - corners[faces[:, k - 1]] for k in range(3)], axis=1)
    outward = np.cross(sides[:, 1], sides[:, 2])
    regular = np.all(np.abs(np.linalg.norm(sides, axis=2) - 2.0) < 1e-9, axis=1)
    triangles = corners[faces[regular & (np.einsum("ij,ij->i", outward, corners[faces[:, 0]]) > 0.0)]]
    for _ in range(splits):
        a, b, c = triangles.swapaxes(0, 1)
        ab, bc, ca = 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)
        triangles = np.concatenate(
            [np.stack(t, axis=1) for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
        )
    triangles = radius * triangles / np.linalg.norm(triangles, axis=2, keepdims=True)
    area = (
        0.5
        * np.linalg.norm(
            np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1
        ).sum()
    )
    mesh = Mesh(
        np.array(center) + triangles.reshape(-1, 3),
        tuple((k, k + 1, k + 2) for k in range(0, 3 * len(triangles), 3)),
    )
    return SceneObject("bulb", mesh, material(0.0, flux / area))


def at_points(
    of: World, case: str, published: str, recomputed: str
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """What is found at a case's points, the exact values, and the published ones."""
    entry = CASES[case]
    names = list(entry[recomputed])
    points = [entry["points"][name] for name in names]
    positions = np.array([p["p"] if isinstance(p, dict) else p for p in points], dtype=float)
    normals = np.array([p["n"] if isinstance(p, dict) else (0, 0, 1) for p in points], dtype=float)
    found = irradiance_at(solved(of), positions, normals)
    exact = np.array([entry[recomputed][name] for name in names])
    return found[:, 0], exact, np.array([entry[published][name] for name in names])


def test_5_2_point_source() -> None:
    side = 1e-3
    lamp = polygon("lamp", rectangle((-side / 2, side / 2), (-side / 2, side / 2), 3.0, down=True),
                   material(0.0, 1000.0 * np.pi / side**2))  # fmt: skip
    floor = polygon("floor", rectangle((-2, 2), (-2, 2), 0.0), material(0.0))
    found, exact, table = at_points(world(lamp, floor), "5.2", "published_E_lux_table11", "recomputed_E_lux")
    np.testing.assert_allclose(found, exact, rtol=1e-6)
    np.testing.assert_allclose(found, table, rtol=ROUNDED)


def test_5_3_area_source() -> None:
    room = box("room", 0.0, 0.0, high=(4.0, 4.0, 3.0))
    lamp = polygon(
        "lamp", rectangle((1.5, 2.5), (1.5, 2.5), 3.0 - 1e-9, down=True), material(0.0, 1000.0 * np.pi)
    )
    found, exact, table = at_points(world(room, lamp), "5.3", "published_E_lux_table12", "recomputed_E_lux")
    np.testing.assert_allclose(found, exact, rtol=1e-7)
    np.testing.assert_allclose(found, table, rtol=3e-3)


def wall_points(size: tuple[float, float, float], n: int = 24) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Gauss points over the walls of a room, their normals and their areas."""
    nodes, weights = np.polynomial.legendre.leggauss(n)
    grid = np.stack(np.meshgrid(nodes, nodes, indexing="ij"), axis=-1).reshape(-1, 2)
    weight = np.outer(weights, weights).ravel()
    positions, normals, areas = [], [], []
    for axis in range(3):
        others = [k for k in range(3) if k != axis]
        for side in (-1.0, 1.0):
            place, normal = np.full((n * n, 3), side), np.zeros((n * n, 3))
            place[:, others], normal[:, axis] = grid, -side
            positions.append(0.5 * (place + 1.0) * size)
            normals.append(normal)
            areas.append(0.25 * weight * size[others[0]] * size[others[1]])
    return np.concatenate(positions), np.concatenate(normals), np.concatenate(areas)


PLACES = [(2.0, 2.0, 1.5), (1.2, 3.1, 2.2)]


@pytest.mark.parametrize("where", PLACES)
def test_5_4_flux_is_conserved_at_points(where: tuple[float, float, float]) -> None:
    """The illuminance of a black room, integrated over its walls, is all that is emitted."""
    solver = solved(world(box("room", 0.0, 0.0, high=(4.0, 4.0, 3.0)), bulb(where, 0.02, FLUX)))
    positions, normals, areas = wall_points((4.0, 4.0, 3.0))
    found = irradiance_at(solver, positions, normals)
    assert areas.sum() == pytest.approx(80.0)
    assert float(areas @ found[:, 0]) == pytest.approx(FLUX, rel=1e-3)


@pytest.mark.parametrize("where", PLACES)
def test_5_4_flux_is_conserved_by_elements(where: tuple[float, float, float]) -> None:
    """The same of the elements; nearly black walls, since the solver does not look at black ones."""
    solver = solved(world(box("room", 0.01, 0.0, high=(4.0, 4.0, 3.0)), bulb(where, 0.02, FLUX)))
    field = solver.field()
    walls = field.patch < 6
    arrived = float(field.irradiance[walls, 0] @ field.area[walls])
    # The walls send 1 % on.
    assert arrived * 0.99 == pytest.approx(FLUX, rel=0.01)


@pytest.mark.parametrize(
    ("floor", "recomputed"),
    [
        ((0.0, 4.0), "recomputed_pct"),
        ((1.75, 2.25), "scenario1_S2_0.5x0.5_recomputed_pct"),
        ((-248.0, 252.0), "scenario3_S2_500x500_recomputed_pct"),
    ],
    ids=["4 m", "50 cm", "500 m"],
)
def test_5_6_reflection(floor: tuple[float, float], recomputed: str) -> None:
    """A floor that reflects evenly what it gets: per cent of that which arrives at black surfaces.

    These only hold the points; the formula knows no shadow of theirs.
    """
    lit = polygon("floor", rectangle(floor, floor, 0.0), material(0.3, 100.0))
    found, exact, table = at_points(world(lit), "5.6", "published_pct_table17", recomputed)
    np.testing.assert_allclose(found, exact, rtol=1e-8)
    if recomputed == "recomputed_pct":
        np.testing.assert_allclose(found, table, rtol=ROUNDED)


@cache
def room_5_8(reflectance: float, tolerance: float = 0.02) -> RadiositySolver:
    low, high = (0.0, 0.0, 0.0), (4.0, 4.0, 4.0)
    return solved(
        world(box("room", reflectance, 0.0, low, high), bulb((2.0, 2.0, 2.0), 0.01, FLUX)), tolerance
    )


REFLECTANCES = [0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95]


@pytest.mark.parametrize(
    "reflectance",
    [pytest.param(r, marks=[] if r in (0.3, 0.8, 0.95) else pytest.mark.slow) for r in REFLECTANCES],
)
def test_5_8_mean_indirect_light(reflectance: float) -> None:
    """Exact by conservation of energy: the direct part is known."""
    entry = CASES["5.8"]
    field = room_5_8(reflectance).field()
    walls = field.patch < 6
    total = float(field.irradiance[walls, 0] @ field.area[walls]) / 96.0
    indirect = total - entry["E_direct_average_lux"]
    # What the direct light errs by is no more than half a per cent, of all of it.
    exact = entry["recomputed_E_indirect_lux"][f"{reflectance:g}"]
    assert total == pytest.approx(exact + entry["E_direct_average_lux"], rel=5e-3)
    assert indirect == pytest.approx(exact, rel=5e-3, abs=0.5)


@pytest.mark.parametrize(
    "reflectance",
    [pytest.param(0.5, marks=pytest.mark.slow), 0.8, pytest.param(0.95, marks=pytest.mark.slow)],
)
def test_5_8_light_at_points(reflectance: float) -> None:
    """Direct and indirect light by their own tables, at a face's middle, and near an edge and a corner."""
    points = np.array([[2.0, 2.0, 0.0], [1.0, 1.0, 0.0], [0.08, 2.0, 0.0], [0.08, 0.08, 0.0]])
    found = irradiance_at(room_5_8(reflectance, 0.01), points, np.tile([0.0, 0.0, 1.0], (4, 1)))
    r = points - [2.0, 2.0, 2.0]
    distance = np.linalg.norm(r, axis=1)
    direct = FLUX / (4.0 * np.pi) * 2.0 / distance**3
    indirect = np.array(list(CUBE["cases"][f"{reflectance:g}"]["point_indirect"].values())) * FLUX / 16.0
    np.testing.assert_allclose(found[:, 0], direct + indirect, rtol=0.01)
