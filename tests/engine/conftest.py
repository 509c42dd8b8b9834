"""Engines on the box."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from solver.engine.drawing import Drawing
from solver.engine.engine import Engine
from solver.engine.status import SessionState
from tests.engine.acting import LOOSE, settle
from tests.engine.scenes import box


@pytest.fixture(scope="module")
def drawing() -> Drawing:
    made = Drawing()
    assert made.problem is None
    return made


@pytest.fixture
def engine(drawing: Drawing) -> Engine:
    return Engine(box(), LOOSE, drawing=drawing)


@pytest.fixture(scope="module")
def settled(drawing: Drawing) -> Iterator[Engine]:
    """Converged; not to be edited."""
    made = Engine(box(), LOOSE, drawing=drawing)
    settle(made)
    assert made.status().state is SessionState.CONVERGED
    yield made
    assert made.revision == 1
