"""One OpenGL context for all hard cases."""

from __future__ import annotations

import pytest

from solver.engine.drawing import Drawing


@pytest.fixture(scope="module")
def drawing() -> Drawing:
    made = Drawing()
    assert made.problem is None
    return made
