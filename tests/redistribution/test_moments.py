"""Moments that are handed on with a solution are those of its light, whenever an edit interrupts."""

from __future__ import annotations

import numpy as np
import pytest

from solver.redistribution.carrying import moments_of
from tests.redistribution.rooms import crate, edited, fresh, room, settled


@pytest.mark.parametrize("places", [((0.5, 0.5, 0.0), (0.9, 0.6, 0.0)), ((0.5, 0.5, 0.0), (0.5, 0.5, 0.3))])
def test_at_every_pause(places: tuple[tuple[float, float, float], ...]) -> None:
    solver = settled(fresh(room().with_object(crate("crate", (2.5, 1.0, 0.0)))))
    known = 0
    for number, place in enumerate(places, 1):
        moved = edited(solver, room().with_object(crate("crate", place)), number, drags=number > 1)
        while moved.step(0.0):
            if moved.moments is not None:
                known += 1
                found = moments_of(moved.state)
                assert moved.moments.shape == found.shape
                np.testing.assert_allclose(moved.moments, found, rtol=1e-9, atol=1e-9)
        solver = moved
    assert known > 0


@pytest.mark.parametrize("pauses", range(0, 60, 4))
def test_an_interrupted_solution_is_gone_on_from(pauses: int) -> None:
    """By an edit at any of the first pauses; light that is nobody's would be bright."""
    solver = settled(fresh(room().with_object(crate("crate", (2.5, 1.0, 0.0)))))
    moved = edited(solver, room().with_object(crate("crate", (0.5, 0.5, 0.0))))
    for _ in range(pauses):
        moved.step(0.0)
    again = edited(moved, room().with_object(crate("crate", (0.9, 0.6, 0.0))), 2, drags=True)
    assert np.isfinite(again.state.received).all()
    bright = solver.state.received[:, 0].max()
    assert np.abs(again.state.received[:, 0]).max() < 3.0 * bright
