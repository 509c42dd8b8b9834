"""Settling: the same as a dense solve, and as far as asked."""

from __future__ import annotations

import numpy as np
import pytest

from solver.transport.settings import SolverSettings
from solver.transport.settle import settle
from solver.transport.state import TransportState
from solver.types import FloatArray
from tests.pathtracing.worlds import world
from tests.transport.solving import (
    box,
    finish,
    furnace,
    inner,
    leaves_of,
    lit_cube,
    shelf,
    solver_of,
    state_of,
)


def small(name: str) -> TransportState:
    """A state of few elements whose light is anything but settled."""
    made = {
        "open": shelf(),
        "coloured": lit_cube((0.7, 0.5, 0.0), (3.0, 2.0, 1.0)),
        "furnace": furnace(0.99),
    }[name]
    state = state_of(finish(solver_of(made, SolverSettings(error_tolerance=0.03, max_elements=120))))
    random = np.random.default_rng(2)
    state.radiosity = random.normal(size=state.radiosity.shape)
    state.received = random.normal(size=state.received.shape)
    return state


def terms(state: TransportState) -> tuple[FloatArray, FloatArray]:
    """Reflectance and emission functions (n, 3, channels) over the leaves, 0 elsewhere."""
    leaf = leaves_of(state)
    emission = np.zeros_like(state.radiosity)
    emission[leaf, 0] = state.emission[state.tree.patch[leaf]]
    return np.where(leaf[:, None], state.reflectance[state.tree.patch], 0.0)[:, None], emission


def unshot(state: TransportState) -> float:
    """RMS of what one more gather would add, relative to the radiosity."""
    reflectance, emission = terms(state)
    leaf = leaves_of(state)
    held = np.where(leaf[:, None, None], state.radiosity, 0.0)
    left = emission + reflectance * state.gather(held) - held
    return float(np.sqrt(inner(state, left, left) / inner(state, held, held)))


@pytest.mark.parametrize("name", ["open", "coloured", "furnace"])
def test_settled_light_is_that_of_a_dense_solve(name: str) -> None:
    state = small(name)
    for _ in settle(state, 1e-12):
        pass
    leaf = np.flatnonzero(leaves_of(state))
    reflectance, emission = terms(state)
    unknowns = 3 * len(leaf)
    matrix = np.empty((state.channels, unknowns, unknowns))
    for column in range(unknowns):
        unit = np.zeros_like(state.radiosity)
        unit[leaf[column // 3], column % 3] = 1.0
        arrived = reflectance * state.gather(unit)
        matrix[:, :, column] = (unit - arrived)[leaf].reshape(unknowns, state.channels).T
    for channel in range(state.channels):
        exact = np.linalg.solve(matrix[channel], emission[leaf][:, :, channel].ravel())
        found = state.radiosity[leaf][:, :, channel].ravel()
        np.testing.assert_allclose(found, exact, atol=1e-9 * np.abs(exact).max())


@pytest.mark.parametrize("name", ["open", "coloured", "furnace"])
@pytest.mark.parametrize("target", [1e-1, 1e-3, 1e-6])
def test_unshot_goes_below_the_target(name: str, target: float) -> None:
    state = small(name)
    assert unshot(state) > target
    shares = [share for share in settle(state, target) if share is not None]
    assert unshot(state) <= 1.01 * target
    assert shares[-1] <= 10.0 * target, "the share told is by amount, the target by RMS"
    assert len(shares) < 60


@pytest.mark.parametrize("reflectance", [0.9, 0.99, 0.999])
def test_light_that_lasts_is_settled_further(reflectance: float) -> None:
    """What is absorbed is what is emitted, however many reflections that takes."""
    lamp = box("lamp", reflectance, 10.0, (0.4, 0.4, 0.7), (0.6, 0.6, 0.8), inward=False)
    scene = world(box("room", reflectance), lamp)
    state = state_of(finish(solver_of(scene, SolverSettings(error_tolerance=0.1))))
    leaf = leaves_of(state)
    absorbed = (1.0 - reflectance) * float(state.tree.area[leaf] @ state.received[leaf, 0, 0])
    assert absorbed == pytest.approx(float(scene.surfaces.area @ scene.surfaces.emission[:, 0]), rel=5e-3)


def test_settled_light_takes_no_step() -> None:
    state = small("open")
    for _ in settle(state, 1e-8):
        pass
    before = state.radiosity.copy()
    assert len(list(settle(state, 1e-6))) == 1
    np.testing.assert_array_equal(state.radiosity, before)


def test_irradiance_and_radiosity_agree() -> None:
    state = small("open")
    for _ in settle(state, 1e-9):
        pass
    leaf = leaves_of(state)
    np.testing.assert_allclose(
        state.received[leaf], state.gather(state.radiosity)[leaf], atol=1e-12 * state.received[leaf].max()
    )


def test_what_reflects_nothing_keeps_its_emission() -> None:
    state = small("coloured")
    for _ in settle(state, 1e-6):
        pass
    leaf = leaves_of(state)
    blue = state.radiosity[leaf][:, :, 2]
    np.testing.assert_array_equal(blue[:, 0], state.emission[state.tree.patch[leaf], 2])
    assert not blue[:, 1:].any()


def test_no_light_settles_at_once() -> None:
    state = state_of(finish(solver_of(lit_cube(0.5, 0.0))))
    assert len(list(settle(state, 1e-3))) == 1
    assert not state.radiosity.any()
