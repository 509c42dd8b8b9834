"""What frames by virtual lights cost: walks, what lights see, what they light, what is put back.

A hall furnished with six times the office's furniture: 402 quadrilaterals, as many as [K fig. 10] has, and
its lamps: one, or the 248 of [K fig. 12], of the same area in all. The frame has 720x576 pixels, as there.
"""

from __future__ import annotations

import time
from collections.abc import Generator
from dataclasses import dataclass
from typing import Final

import numpy as np

from benchmarks.plan import Job, Options, Section
from benchmarks.tables import Row, Table, Target
from benchmarks.walks import GRIDS, hall
from solver.document.samples import load_sample
from solver.engine.instant.blocks import LightBlock, LightBlocks
from solver.engine.instant.frame import InstantFrame, InstantSettings
from solver.engine.world import World
from solver.geometry.scene import Camera, Mesh, Scene, SceneObject
from solver.illumination.particles.light_lobes import Gloss
from solver.illumination.particles.receivers import Receivers
from solver.illumination.particles.sights import Sights
from solver.illumination.settings import LightSettings
from solver.rendering.device import GlDevice
from solver.rendering.renderer import FrameRenderer
from solver.rendering.tessellation import Tessellator
from solver.transport.settings import SolverSettings
from solver.transport.solve import RadiositySolver
from solver.types import Float32Array

WIDTH: Final = 720
HEIGHT: Final = 576
PATHS: Final = 128
SECONDS: Final = 2.0
"""Target: a twelfth of what [K fig. 10] took"""
MOST_RATIO: Final = 1.15
"""Target: time with most lamps over that with one"""

_FURNITURE: Final = ("desk", "monitor", "stand", "books", "seat", "back_rest", "cabinet")


@dataclass(frozen=True)
class CostFigures:
    """One frame of `PATHS` paths."""

    lamps: int
    quadrilaterals: int
    """Lamps not counted"""
    points: int
    lights: int
    seconds: float
    points_found: float
    """Seconds, as all that follow, which are parts of `seconds`"""
    walked: float
    looked: float
    lit: float
    compensated: float


def furnished_hall(along: int, across: int) -> Scene:
    """The hall of `walks` with along x across lamps, and furniture in the place of its blocks."""
    objects = [o for o in hall(along, across) if not o.id.startswith("block")]
    for name in _FURNITURE:
        piece = load_sample("office").object(name)
        for k, (x, y) in enumerate(np.ndindex(3, 2)):
            vertices = piece.world_vertices + np.array([4.0 * x, 3.0 * y - 0.6, 0.0])
            objects.append(SceneObject(f"{name}{k}", Mesh(vertices, piece.mesh.faces), piece.material))
    return Scene(objects={o.id: o for o in objects})


def view() -> Camera:
    """From a corner, over all of the furniture."""
    eye, target = np.array([11.5, 0.3, 2.4]), np.array([4.0, 3.5, 0.6])
    return Camera(eye, target, np.array([0.0, 0.0, 1.0]), 60.0, WIDTH, HEIGHT)


class _Timed(LightBlocks):
    """Blocks that tell how long they have been at what."""

    def __init__(self, world: World, resolution: int) -> None:
        super().__init__(world, resolution)
        self.walked = self.looked = self.lit = 0.0
        self.pixels: list[Receivers] = []

    def block_in_steps(self, number: int) -> Generator[None, None, LightBlock]:
        work = super().block_in_steps(number)
        while True:
            start = time.perf_counter()
            try:
                next(work)
            except StopIteration as end:
                found: LightBlock = end.value
                return found
            finally:
                self.walked += time.perf_counter() - start
            yield

    def sights(self, block: LightBlock, batch: int) -> Sights:
        start = time.perf_counter()
        found = super().sights(block, batch)
        self.looked += time.perf_counter() - start
        return found

    def shine(
        self,
        light: Float32Array,
        receivers: Receivers,
        block: LightBlock,
        batch: int,
        bound: float,
        factor: float | Float32Array = 1.0,
        gloss: Gloss | None = None,
    ) -> None:
        start = time.perf_counter()
        super().shine(light, receivers, block, batch, bound, factor, gloss)
        # Where rays to what is near end, light is part of what is put back.
        if any(receivers is lit for lit in self.pixels):
            self.lit += time.perf_counter() - start


def measure_costs(along: int, across: int, turns: int) -> CostFigures:
    """The best of some frames."""
    scene = furnished_hall(along, across)
    renderer = FrameRenderer(GlDevice())
    # The first one loads kernels.
    measured = [_measure(World.of(scene), renderer, along * across) for _ in range(turns + 1)]
    renderer.release()
    return min(measured, key=lambda figures: figures.seconds)


def _measure(world: World, renderer: FrameRenderer, lamps: int) -> CostFigures:
    dark = RadiositySolver(world.surfaces, world.rays, SolverSettings()).field()
    settings = LightSettings()
    start = time.perf_counter()
    points = renderer.surface_points(Tessellator(world.surfaces).mesh(dark), view())
    blocks = _Timed(world, settings.vpl_resolution)
    instant = InstantSettings(1.0 / settings.vpl_reach**2, compensates=True)
    frame = InstantFrame(blocks, instant, view(), [points], lambda: None)
    blocks.pixels = frame._receivers
    found = time.perf_counter()
    while frame.paths < PATHS:
        frame.step()
    end = time.perf_counter()
    parts = blocks.walked + blocks.looked + blocks.lit
    return CostFigures(
        lamps=lamps,
        quadrilaterals=world.surfaces.face_count - lamps,
        points=len(points),
        lights=blocks.light_count,
        seconds=end - start,
        points_found=found - start,
        walked=blocks.walked,
        looked=blocks.looked,
        lit=blocks.lit,
        compensated=end - found - parts,
    )


def section(options: Options) -> Section:
    """One lamp and many."""
    turns = 1 if options.quick else 3
    chosen = (GRIDS[0], GRIDS[-1])
    return Section(
        "lights",
        tuple(Job(f"{a * b} lamps", measure_costs, (a, b, turns)) for a, b in chosen),
        tabulate,
    )


def tabulate(found: list[CostFigures]) -> Table:
    """One row a number of lamps, and one for each light of it."""
    return Table(
        f"{PATHS} paths at {WIDTH}x{HEIGHT}: milliseconds",
        ("lamps", "quadrilaterals", "of", "count", "all", "points", "walk", "sights", "lighting", "put back"),
        tuple(row for figures in found for row in _rows(figures, found[0])),
        "A furnished hall, one sample a pixel. Put back: what the bound takes away, found by rays and lights "
        "where they end.",
        names=3,
    )


def _rows(figures: CostFigures, first: CostFigures) -> tuple[Row, Row]:
    targets = [Target("time", figures.seconds, SECONDS, "s")]
    if figures is not first:
        targets.append(Target("of one lamp", figures.seconds / first.seconds, MOST_RATIO))
    parts = (
        figures.seconds, figures.points_found, figures.walked, figures.looked, figures.lit,
        figures.compensated,
    )  # fmt: skip
    begin = (f"{figures.lamps:,}", f"{figures.quadrilaterals:,}")
    whole = tuple(f"{1e3 * part:.0f}" for part in parts)
    each = tuple(f"{1e3 * part / figures.lights:.3f}" for part in parts)
    return (
        Row((*begin, "the frame", f"{figures.points:,} points", *whole), tuple(targets)),
        Row((*begin, "a light", f"{figures.lights:,} lights", *each)),
    )
