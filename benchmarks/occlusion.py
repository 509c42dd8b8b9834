"""Rays a second: shadow rays through `RayScene`, beside embreex called with nothing around it.

The baseline has its rays ready in Embree's float32 and deals them to as many threads in as large chunks;
`RayScene.occluded` takes points of the world in float64. All are timed in turns in one process, and compared
turn by turn: what else the machine does in the meantime slows all of them alike.
"""

from __future__ import annotations

from collections.abc import Callable
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

_TURNS: Final = 9


@dataclass(frozen=True)
class Way:
    """A way of asking for shadow rays."""

    name: str
    threads: int
    rate: float
    """Rays a second in the best turn"""
    of_embreex: float
    """Rate over that of embreex alone in as many threads as there are cores, in the median of the turns"""
    of_one_thread: float
    """The same over embreex alone in one thread"""


@dataclass(frozen=True)
class RayFigures:
    """Shadow rays a second."""

    rays: int
    triangles: int
    blocked: float
    """Share of the rays"""
    ways: tuple[Way, ...]


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
    cores = core_count()
    ways: tuple[tuple[str, int, Callable[[], object]], ...] = (
        ("RayScene.occluded, points of the world", cores, lambda: rays.occluded(origins, targets)),
        ("RayScene.occluded_local, as the solver asks", cores, lambda: rays.occluded_local(start, along)),
        ("embreex alone", cores, alone.in_threads),
        ("embreex alone", 1, alone.in_one_thread),
    )
    seconds = np.array([[best_of(way, 1) for _, _, way in ways] for _ in range(_TURNS)])
    share = np.median(seconds[:, 2:, None] / seconds[:, None, :], axis=0)
    blocked = rays.occluded_local(start, along)
    return RayFigures(
        rays=count,
        triangles=TRIANGLES,
        blocked=float(blocked.mean()),
        ways=tuple(
            Way(name, threads, count / float(seconds[:, k].min()), float(share[0, k]), float(share[1, k]))
            for k, (name, threads, _) in enumerate(ways)
        ),
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
    return Section("rays", (Job("rays", measure_rays, (2**17 if options.quick else 2**20,)),), tabulate)


def tabulate(found: list[RayFigures]) -> Table:
    """One row a way of asking."""
    (figures,) = found
    first = figures.ways[0]
    target = Target("of embreex alone", first.of_embreex, LEAST_RATIO, at_most=False)
    return Table(
        "Shadow rays a second",
        ("way", "threads", "million rays / s", "of embreex alone", "of one thread"),
        tuple(
            Row(
                (
                    way.name,
                    str(way.threads),
                    f"{way.rate / 1e6:.1f}",
                    f"{way.of_embreex:.2f}",
                    f"{way.of_one_thread:.2f}",
                ),
                (target,) if way is first else (),
            )
            for way in figures.ways
        ),
        f"{figures.rays:,} incoherent rays among {figures.triangles:,} triangles of rings at random, "
        f"{100.0 * figures.blocked:.0f} % of them blocked. Rates: the best of {_TURNS} turns; ratios: within "
        "a turn, their median.",
    )
