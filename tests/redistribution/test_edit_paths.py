"""Whatever was edited, and whenever: the settled solution is that of the scene as it stands."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, precondition, rule

from solver.geometry.scene import Scene
from solver.redistribution.redistribution import Redistribution
from solver.transport.field import SolveOutcome
from solver.transport.links import take_ranges
from solver.transport.settings import SolverSettings
from solver.transport.solve import RadiositySolver
from tests.pathtracing.worlds import material
from tests.redistribution.rooms import crate, difference, edited, fresh, placed, room, settled

PLACES = st.tuples(st.floats(0.1, 3.2), st.floats(0.1, 2.2), st.floats(0.02, 1.5))
NAMES = st.sampled_from(["a", "b", "c"])


class Edits(RuleBasedStateMachine):
    """Furniture is added, moved, painted and removed, before or after the light has settled."""

    @initialize(open_room=st.booleans())
    def start(self, open_room: bool) -> None:
        scene = room()
        if open_room:
            walls = scene.object("walls")
            mesh = replace(walls.mesh, faces=walls.mesh.faces[1:])
            scene = scene.with_replaced(replace(walls, mesh=mesh))
        self.past: list[Scene] = []
        self.solver: RadiositySolver = fresh(scene)
        self.scene = scene
        self.number = 0
        self.dragged: str | None = None

    def take(self, scene: Scene, moved: str | None = None) -> None:
        self.past.append(self.scene)
        self.go(scene, moved)

    def go(self, scene: Scene, moved: str | None = None) -> None:
        self.number += 1
        drags = moved is not None and moved == self.dragged
        self.scene, self.dragged = scene, moved
        self.solver = edited(self.solver, scene, self.number, drags)

    @rule(name=NAMES, at=PLACES, size=st.floats(0.1, 0.7))
    def add(self, name: str, at: tuple[float, float, float], size: float) -> None:
        if name not in self.scene.objects:
            self.take(self.scene.with_object(crate(name, at, size)))

    @rule(name=NAMES, at=PLACES)
    def move(self, name: str, at: tuple[float, float, float]) -> None:
        if name in self.scene.objects:
            self.take(self.scene.with_replaced(replace(self.scene.object(name), transform=placed(at))), name)

    @rule(name=NAMES)
    def remove(self, name: str) -> None:
        if name in self.scene.objects:
            self.take(self.scene.without_object(name))

    @rule(
        name=st.sampled_from(["a", "b", "c", "walls"]),
        reflectance=st.sampled_from([0.0, 0.3, 0.8, (0.7, 0.4, 0.2)]),
        emission=st.sampled_from([0.0, 0.0, 2.0]),
    )
    def paint(self, name: str, reflectance: float, emission: float) -> None:
        if name in self.scene.objects:
            painted = replace(self.scene.object(name), material=material(reflectance, emission))
            self.take(self.scene.with_replaced(painted))

    @rule(name=NAMES)
    def reshape(self, name: str) -> None:
        if name in self.scene.objects:
            before = self.scene.object(name)
            mesh = replace(before.mesh, vertices=before.mesh.vertices * np.array([1.0, 1.2, 0.6]))
            self.take(self.scene.with_replaced(replace(before, mesh=mesh)))

    @precondition(lambda self: self.past)
    @rule()
    def undo(self) -> None:
        self.go(self.past.pop())

    @rule(slices=st.integers(1, 30))
    def work(self, slices: int) -> None:
        for _ in range(slices):
            self.solver.step(0.0)

    @rule()
    def settle(self) -> None:
        settled(self.solver)
        assert self.solver.outcome is SolveOutcome.CONVERGED
        if isinstance(self.solver, Redistribution):
            assert not self.solver.owes
            assert sum(self.solver.owed().values()) == 0.0
        expected = settled(fresh(self.scene))
        estimates = self.solver.error_estimate, expected.error_estimate
        if difference(self.solver, expected) > np.hypot(*estimates):
            # Estimates of coarse solves fall short of the error where a lamp is close to a bright ceiling.
            truth = settled(fresh(self.scene, SolverSettings(error_tolerance=0.01)))
            assert difference(self.solver, truth) <= 1.1 * difference(expected, truth)
        links = self.solver.state.links
        for name in ("p", "q"):
            assert getattr(links, name).max(initial=-1) < len(self.solver.state.tree)
        lists = take_ranges(links.pool, links.blocker_start, links.blocker_count)
        assert lists.min(initial=0) >= 0
        assert not links.debt.any()

    def teardown(self) -> None:
        if hasattr(self, "scene"):
            self.settle()


Edits.TestCase.settings = settings(
    max_examples=12, stateful_step_count=12, deadline=None, suppress_health_check=list(HealthCheck)
)
TestEdits = Edits.TestCase


@pytest.mark.slow
class TestManyEdits(Edits.TestCase):  # type: ignore[valid-type,misc]
    """The same, at length."""

    settings = settings(
        max_examples=150, stateful_step_count=30, deadline=None, suppress_health_check=list(HealthCheck)
    )
