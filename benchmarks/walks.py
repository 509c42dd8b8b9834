"""Walks of particles: milliseconds a block, and how little they depend on the number of lamps.

One hall, whose light comes from one lamp or from many, of the same area in all. Numbers of lamps are timed in
turns and compared turn by turn: what else the machine does in the meantime slows all of them alike.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Final

import numpy as np

from benchmarks.plan import Job, Options, Section
from benchmarks.tables import Row, Table, Target
from solver.geometry.scene import Material, Mesh, Scene, SceneObject
from solver.geometry.surfaces import flatten
from solver.illumination.particles.walk import ParticleWalk
from solver.visibility.rays import RayScene

GRIDS: Final = ((1, 1), (4, 2), (31, 8))
"""Lamps along and across; 248 in all are those of [K fig. 12]"""
PATHS: Final = (128, 1024)
"""Of a block; 128 are those of [K figs. 10 to 12]"""
MOST_RATIO: Final = 1.15
"""Target: time with most lamps over that with one."""

_SIZE: Final = np.array([12.0, 6.0, 3.0])
_LIT: Final = 0.2
"""Share of the ceiling, along and across"""

_CORNERS: Final = np.array([[x, y, z] for z in (0.0, 1.0) for y in (0.0, 1.0) for x in (0.0, 1.0)])
_INWARD: Final = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 2, 6, 4), (1, 5, 7, 3), (0, 4, 5, 1), (2, 3, 7, 6))


@dataclass(frozen=True)
class HallFigures:
    """Blocks in one hall."""

    lamps: int
    lights: int
    """Of a block, in the mean"""
    seconds: float
    """Of the best block"""
    of_one_lamp: float
    """Time over that with one lamp, in the median of the turns"""


@dataclass(frozen=True)
class WalkFigures:
    """Blocks of one size in all halls."""

    paths: int
    halls: tuple[HallFigures, ...]


def hall(along: int, across: int) -> Scene:
    """A hall with along x across lamps under its ceiling, and blocks that stand in it."""
    grey, white = Material(np.full(3, 0.6), np.zeros(3)), Material(np.full(3, 0.8), np.zeros(3))
    lamp = Material(np.zeros(3), np.full(3, 50.0))
    objects = [SceneObject("hall", Mesh(_CORNERS * _SIZE, _INWARD), grey)]
    for k, place in enumerate(([2.0, 1.0, 0.0], [5.0, 4.0, 0.0], [9.0, 2.0, 0.0])):
        block = place + _CORNERS * [1.0, 0.8, 0.7 + 0.4 * k]
        objects.append(SceneObject(f"block{k}", Mesh(block, tuple(face[::-1] for face in _INWARD)), white))
    step = _SIZE[:2] / [along, across]
    for i in range(along):
        for j in range(across):
            low = (np.array([i, j]) + 0.5 * (1.0 - _LIT)) * step
            square = low + _CORNERS[[0, 2, 3, 1], :2] * _LIT * step
            corners = np.column_stack([square, np.full(4, 0.99 * _SIZE[2])])
            objects.append(SceneObject(f"lamp{i}.{j}", Mesh(corners, ((0, 1, 2, 3),)), lamp))
    return Scene(objects={o.id: o for o in objects})


def measure_walks(paths: int, turns: int) -> WalkFigures:
    """One block after the other in all halls, `turns` times."""
    walks = []
    for along, across in GRIDS:
        surfaces = flatten(hall(along, across))
        walks.append(ParticleWalk(surfaces, RayScene(surfaces.triangles, surfaces.center, surfaces.size)))
        walks[-1].block(0, paths)
    seconds, lights = np.empty((turns, len(walks))), np.empty((turns, len(walks)))
    for turn in range(turns):
        for k, walk in enumerate(walks):
            start = time.perf_counter()
            block = walk.block(turn * paths, paths)
            seconds[turn, k], lights[turn, k] = time.perf_counter() - start, len(block)
    ratios = np.median(seconds / seconds[:, :1], axis=0)
    return WalkFigures(
        paths,
        tuple(
            HallFigures(along * across, round(count), best, ratio)
            for (along, across), count, best, ratio in zip(
                GRIDS,
                lights.mean(axis=0).tolist(),
                seconds.min(axis=0).tolist(),
                ratios.tolist(),
                strict=True,
            )
        ),
    )


def section(options: Options) -> Section:
    """Small and large blocks."""
    turns = 50 if options.quick else 300
    jobs = (Job(f"{paths} paths", measure_walks, (paths, turns)) for paths in PATHS)
    return Section("walks", tuple(jobs), tabulate)


def tabulate(found: list[WalkFigures]) -> Table:
    """One row a size of block and a number of lamps."""
    return Table(
        "Walks of particles",
        ("paths", "lamps", "lights", "ms", "us a light", "of one lamp"),
        tuple(
            Row(
                (
                    f"{figures.paths:,}",
                    f"{hall.lamps:,}",
                    f"{hall.lights:,}",
                    f"{1e3 * hall.seconds:.2f}",
                    f"{1e6 * hall.seconds / hall.lights:.2f}",
                    f"{hall.of_one_lamp:.2f}",
                ),
                (Target("of one lamp", hall.of_one_lamp, MOST_RATIO),) if hall is figures.halls[-1] else (),
            )
            for figures in found
            for hall in figures.halls
        ),
        "One hall, lit by lamps of the same area in all. Times are those of the best block; ratios are "
        "medians over blocks in turns.",
    )
