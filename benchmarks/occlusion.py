"""Rays a second: shadow rays through `RayScene`, beside embreex called with nothing around it.

The baseline has its rays ready in Embree's float32 and deals them to as many threads in as large chunks;
`RayScene.occluded` takes points of the world in float64. Both are timed in turns, in the same process.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Final

import numpy as np
from embreex import rtcore, rtcore_scene
from embreex.mesh_construction import TriangleMesh

from benchmarks.plan import Job, Options, Section
from benchmarks.tables import Row, Table, Target
from benchmarks.timing import best_of
from solver.parallel import core_count
from solver.types import Float32Array, FloatArray
from solver.visibility.rays import CHUNK, RayScene

_RINGS: Final = 50
_AROUND: Final = 20
_ACROSS: Final = 10
TRIANGLES: Final = 2 * _RINGS * _AROUND * _ACROSS
LEAST_RATIO: Final = 0.75
"""Target: share of what embreex alone does in as many threads."""

_TURNS: Final = 5


@dataclass(frozen=True)
class RayFigures:
    """Shadow rays a second."""

    rays: int
    triangles: int
    threads: int
    blocked: float
    """Share of the rays"""
    points: float
    """By `RayScene.occluded`, between points of the world"""
    local: float
    """By `RayScene.occluded_local`, which the solver calls"""
    embreex: float
    """By embreex alone, in as many threads"""
    embreex_one_thread: float


def random_rings(rng: np.random.Generator) -> FloatArray:
    """Rings strewn over the unit cube, any way up, (TRIANGLES, 3, 3): surfaces, as scenes have them."""
    around, across = 2.0 * np.pi * np.arange(_AROUND) / _AROUND, 2.0 * np.pi * np.arange(_ACROSS) / _ACROSS
    out = 1.0 + 0.4 * np.cos(across)
    ring = np.stack(
        [
            np.outer(np.cos(around), out),
            np.outer(np.sin(around), out),
            np.broadcast_to(0.4 * np.sin(across), (_AROUND, _ACROSS)),
        ],
        axis=-1,
    )
    a, b = ring, np.roll(ring, -1, axis=0)
    c, d = np.roll(b, -1, axis=1), np.roll(a, -1, axis=1)
    triangles = np.concatenate([np.stack([a, b, c], axis=2), np.stack([a, c, d], axis=2)]).reshape(-1, 3)
    turns = np.linalg.qr(rng.standard_normal((_RINGS, 3, 3)))[0]
    sizes = rng.uniform(0.03, 0.1, (_RINGS, 1, 1))
    placed = rng.random((_RINGS, 1, 3)) + sizes * (triangles @ turns)
    return np.asarray(placed.reshape(-1, 3, 3))


def measure_rays(count: int) -> RayFigures:
    """Shadow rays between random points of the cube: neighbours in the array have nothing in common."""
    rng = np.random.default_rng(1)
    triangles = random_rings(rng)
    origins, targets = rng.random((2, count, 3))
    size = float(np.linalg.norm(np.ptp(triangles.reshape(-1, 3), axis=0)))
    rays = RayScene(triangles, np.full(3, 0.5), size)
    start = rays.to_local(origins)
    along = rays.to_local(targets) - start
    alone = _Alone(rays.to_local(triangles), start, along)
    ways = {
        "points": lambda: rays.occluded(origins, targets),
        "local": lambda: rays.occluded_local(start, along),
        "embreex": alone.in_threads,
        "embreex_one_thread": alone.in_one_thread,
    }
    best = dict.fromkeys(ways, float("inf"))
    for _ in range(_TURNS):
        for name, way in ways.items():
            best[name] = min(best[name], best_of(way, 1))
    blocked = rays.occluded_local(start, along)
    return RayFigures(
        rays=count,
        triangles=TRIANGLES,
        threads=core_count(),
        blocked=float(blocked.mean()),
        **{name: count / seconds for name, seconds in best.items()},
    )


class _Alone:
    """embreex with nothing around it."""

    def __init__(self, triangles: Float32Array, origins: Float32Array, directions: Float32Array) -> None:
        self._device = rtcore.EmbreeDevice()
        self._scene = rtcore_scene.EmbreeScene(self._device)
        TriangleMesh(self._scene, triangles)
        self._origins, self._directions = origins, directions
        self._lengths = np.ones(len(origins), dtype=np.float32)
        self._query(0)
        self._threads = ThreadPoolExecutor(core_count())

    def in_threads(self) -> None:
        """All rays, in as many threads as there are cores."""
        for _ in self._threads.map(self._query, range(0, len(self._origins), CHUNK)):
            pass

    def in_one_thread(self) -> None:
        """All rays, in the calling thread."""
        for start in range(0, len(self._origins), CHUNK):
            self._query(start)

    def _query(self, start: int) -> None:
        part = slice(start, start + CHUNK)
        self._scene.run(
            self._origins[part], self._directions[part], dists=self._lengths[part], query="OCCLUDED"
        )


def section(options: Options) -> Section:
    """One random scene."""
    return Section("rays", (Job("rays", measure_rays, (2**18 if options.quick else 2**21,)),), tabulate)


def tabulate(found: list[RayFigures]) -> Table:
    """One row a way of asking."""
    (figures,) = found
    threads = f"{figures.threads} threads"
    ratio = figures.points / figures.embreex
    target = Target("of embreex alone", ratio, LEAST_RATIO, at_most=False)
    rows = (
        ("RayScene.occluded, points of the world", threads, figures.points, (target,)),
        ("RayScene.occluded_local, as the solver asks", threads, figures.local, ()),
        ("embreex alone", threads, figures.embreex, ()),
        ("embreex alone", "1 thread", figures.embreex_one_thread, ()),
    )
    return Table(
        "Shadow rays a second",
        ("way", "threads", "million rays / s", "of embreex alone", "of one thread"),
        tuple(
            Row(
                (
                    name,
                    used,
                    f"{rate / 1e6:.1f}",
                    f"{rate / figures.embreex:.2f}",
                    f"{rate / figures.embreex_one_thread:.2f}",
                ),
                targets,
            )
            for name, used, rate, targets in rows
        ),
        f"{figures.rays:,} incoherent rays among {figures.triangles:,} triangles of rings at random, "
        f"{100.0 * figures.blocked:.0f} % of them blocked; the best of {_TURNS} turns.",
        names=2,
    )
