"""Frames a second of interpolants at 640x480, against gouraud shading of the same triangles.

The meshes are grids over a sample scene's patches, cut so that no cracks are left, with made-up quadratics:
what a frame costs depends on the triangles that are in view and on the pixels that they cover, not on the
light. The camera moves from frame to frame; all frames are read back as float32 radiance.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from benchmarks.frames import HEIGHT, LEAST_FRAMES, WIDTH, moved
from benchmarks.plan import Job, Options, Section
from benchmarks.tables import Row, Table, Target
from benchmarks.timing import calls_per_second
from solver.document.samples import load_sample
from solver.engine.requests import CameraChoice
from solver.geometry.surfaces import Surfaces, flatten
from solver.illumination.interpolation.mesh import InterpolantMesh
from solver.rendering.device import GlDevice
from solver.rendering.meshes import DrawnMesh
from solver.rendering.renderer import FrameRenderer, Layer, Shading
from solver.rendering.tessellation import RenderMesh, Tessellator
from solver.transport.field import RadiosityField
from solver.types import AnyArray, Corners, Float32Array

SCENES: Final = ("cornell", "office")
TRIANGLES: Final = (6_500, 50_000, 200_000)
"""About so many: [H]'s office has 6,576"""

_ATTEMPTS: Final = 4
"""Seams add triangles to a grid: its cells are made larger until the number is about right."""


@dataclass(frozen=True)
class InterpolantFigures:
    """What is drawn a second of one mesh."""

    scene: str
    triangles: int
    interpolant: float
    """Frames a second"""
    new_light: float
    """The same, with other coefficients in every frame"""
    four_samples: float
    """With 4 samples of a pixel"""
    gouraud: float
    """Of values at vertices, on the same triangles"""
    identity: float
    """Of triangles' numbers alone"""


def measure_interpolant_frames(scene: str, triangles: int, seconds: float) -> InterpolantFigures:
    """Draw about `triangles` triangles over a sample scene, each way for about `seconds`."""
    document = load_sample(scene)
    plain = grid_mesh(flatten(document), triangles)
    count = len(plain.triangles)
    first = _with_coefficients(plain, _made_up_coefficients(count, 0))
    fine = (first, replace(first, coefficients=_made_up_coefficients(count, 1)))
    renderer = FrameRenderer(GlDevice())
    camera = CameraChoice(width=WIDTH, height=HEIGHT).resolve(document)

    def draw(mesh: DrawnMesh, number: int, shading: Shading, layer: Layer, samples: int = 1) -> AnyArray:
        return renderer.draw(mesh, moved(camera, number), shading, layer, samples)

    quadratic, radiance = Shading.INTERPOLANT, Layer.RADIANCE
    ways: dict[str, Callable[[int], AnyArray]] = {
        "interpolant": lambda k: draw(fine[0], k, quadratic, radiance),
        "new_light": lambda k: draw(fine[k % 2], k, quadratic, radiance),
        "four_samples": lambda k: draw(fine[0], k, quadratic, radiance, 4),
        "identity": lambda k: draw(fine[0], k, quadratic, Layer.TRIANGLE),
        "gouraud": lambda k: draw(plain, k, Shading.GOURAUD, radiance),
    }
    for way in ways.values():
        way(0)
    rates = {name: calls_per_second(way, seconds) for name, way in ways.items()}
    renderer.release()
    return InterpolantFigures(scene, count, **rates)


def grid_mesh(surfaces: Surfaces, triangles: int) -> RenderMesh:
    """About so many triangles over `surfaces`, of about equal size, evenly lit."""
    tessellator = Tessellator(surfaces)
    leaves = 0.5 * triangles
    for _ in range(_ATTEMPTS):
        mesh = tessellator.mesh(_grid_field(surfaces, leaves))
        leaves *= triangles / len(mesh.triangles)
    return mesh


def _grid_field(surfaces: Surfaces, leaves: float) -> RadiosityField:
    """About so many leaves: squares where a patch is one, triangles where a patch is one."""
    side = np.sqrt(surfaces.area.sum() / leaves)
    parts = [
        _grid(surfaces.corners[p], int(surfaces.corner_count[p]), max(1, round(float(np.sqrt(a)) / side)))
        for p, a in enumerate(surfaces.area)
    ]
    corners = np.concatenate(parts)
    patch = np.repeat(np.arange(surfaces.patch_count, dtype=np.int32), [len(part) for part in parts])
    share = surfaces.area / [len(part) for part in parts]
    light = np.ones((len(corners), 3))
    return RadiosityField(
        corners=corners,
        corner_count=surfaces.corner_count[patch],
        patch=patch,
        area=share[patch],
        radiosity=surfaces.emission[patch] + surfaces.reflectance[patch] * light,
        irradiance=light,
    )


def _grid(corners: Corners, count: int, pieces: int) -> Corners:
    """The leaves (n, 4, 3) of one patch, of which each side is cut into so many pieces."""
    i, j = np.indices((pieces + 1, pieces + 1))[:, :, :, None] / pieces
    if count == 4:
        a, b, c, d = corners
        grid = (1.0 - i) * ((1.0 - j) * a + j * d) + i * ((1.0 - j) * b + j * c)
        whole = np.stack([grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]], axis=2)
        return whole.reshape(-1, 4, 3)
    a, b, c = corners[:3]
    grid = (1.0 - i - j) * a + i * b + j * c
    row, column = np.indices((pieces, pieces))
    towards = np.stack([grid[:-1, :-1], grid[1:, :-1], grid[:-1, 1:], grid[:-1, 1:]], axis=2)
    away = np.stack([grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:], grid[:-1, 1:]], axis=2)
    return np.concatenate([towards[row + column < pieces], away[row + column < pieces - 1]])


def _made_up_coefficients(count: int, seed: int) -> Float32Array:
    made = np.random.default_rng(seed).uniform(-0.1, 0.1, (count, 6, 3)).astype(np.float32)
    made[:, 5] += 1.0
    return made


def _with_coefficients(mesh: RenderMesh, coefficients: Float32Array) -> InterpolantMesh:
    count = len(mesh.triangles)
    return InterpolantMesh(
        surfaces=mesh.surfaces,
        position=mesh.surfaces.center + mesh.surfaces.size * mesh.position.astype(np.float64),
        patch=mesh.patch,
        triangles=mesh.triangles,
        leaf=mesh.leaf,
        coefficients=coefficients,
        error=np.zeros(count, dtype=np.float32),
        is_fine=np.ones(count, dtype=np.bool_),
        leaf_irradiance=mesh.field.irradiance,
    )


def section(options: Options) -> Section:
    """The small scenes at three sizes; without the largest, if it is to be quick."""
    seconds = 0.3 if options.quick else 1.5
    sizes = TRIANGLES[:-1] if options.quick else TRIANGLES
    jobs = tuple(
        Job(f"{name}, {size:,} triangles", measure_interpolant_frames, (name, size, seconds))
        for name in options.scenes
        if name in SCENES
        for size in sizes
    )
    return Section("interpolants", jobs, tabulate)


def tabulate(found: list[InterpolantFigures]) -> Table:
    """One row a mesh."""
    return Table(
        f"Frames of interpolants a second at {WIDTH}x{HEIGHT}",
        ("scene", "triangles", "interpolants", "ms", "new light", "4 samples", "gouraud", "numbers alone"),
        tuple(_row(figures) for figures in found),
        "Frames are read back as float32 radiance, or as the numbers of triangles alone; new light: all "
        "coefficients are others in every frame.",
    )


def _row(figures: InterpolantFigures) -> Row:
    is_target = figures.triangles <= 1.1 * TRIANGLES[0]
    rate = Target("frames", figures.interpolant, LEAST_FRAMES, "/s", at_most=False)
    rates = (figures.new_light, figures.four_samples, figures.gouraud, figures.identity)
    return Row(
        (
            figures.scene,
            f"{figures.triangles:,}",
            f"{figures.interpolant:.1f}",
            f"{1e3 / figures.interpolant:.1f}",
            *(f"{value:.1f}" for value in rates),
        ),
        (rate,) if is_target else (),
    )
