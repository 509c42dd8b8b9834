"""What tests do to an engine."""

from __future__ import annotations

from typing import Any

from pydantic import TypeAdapter

from solver.document.edits import Edit
from solver.engine.engine import Engine
from solver.illumination.settings import LightSettings

EDITS: TypeAdapter[list[Edit]] = TypeAdapter(list[Edit])
LOOSE = LightSettings(error_tolerance=0.05)


def settle(engine: Engine) -> None:
    while engine.step(0.1):
        pass


def edits(*given: dict[str, Any]) -> list[Edit]:
    return EDITS.validate_python(list(given))
