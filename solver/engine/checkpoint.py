"""A solution that rests, as plain arrays and numbers: to be kept, and to go on from in another process.

All that is kept of it is what its scene and settings do not tell: elements, links, the light on them, and
what the solver knew of its errors. Whatever a later version adds to `TransportState` is kept too.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, Final

import numpy as np

from solver.arrays import GrowingArray
from solver.engine.sampled import SampledSolver
from solver.geometry.surfaces import Surfaces
from solver.redistribution.memory import name_of
from solver.transport.elements import ElementTree
from solver.transport.field import SolveOutcome
from solver.transport.links import LinkTable
from solver.transport.settings import SolverSettings
from solver.transport.solve import RadiositySolver
from solver.transport.state import TransportState
from solver.types import AnyArray
from solver.visibility.rays import RayScene

_KNOWN: Final[tuple[str, ...]] = ("error_estimate", "unshot_fraction", "progress")
"""What every solver knows of itself"""

_KNOWN_OF_LINKS: Final[tuple[str, ...]] = ("bound", "norm", "linked")
"""and one that links, besides"""

_KEPT: Final = tuple(field for field in fields(TransportState) if field.init)
"""Of a state; the rest of it is room to work in"""

Number = float | int | str


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """A solution at rest."""

    name: str
    """Of the scene and the settings that it is the solution of"""
    numbers: Mapping[str, Number]
    arrays: Mapping[str, AnyArray]
    """Views of what the solver holds: they are what they should be until the solver is used up"""

    @property
    def nbytes(self) -> int:
        """Bytes of the arrays."""
        return sum(array.nbytes for array in self.arrays.values())


def checkpoint_of(solver: RadiositySolver | SampledSolver) -> Checkpoint | None:
    """What is to be kept of a solver; None while it is not at rest."""
    if solver.outcome is SolveOutcome.RUNNING:
        return None
    numbers: dict[str, Number] = {name: getattr(solver, name) for name in _known(solver)}
    numbers["outcome"] = solver.outcome.name
    numbers["closed"] = int(bool(solver.statistics().closed))
    arrays: dict[str, AnyArray] = {}
    for field in _KEPT:
        match getattr(solver.state, field.name):
            case ElementTree() | LinkTable() as table:
                arrays |= {f"{field.name}.{name}": column.live for name, column in _columns(table).items()}
            case np.ndarray() as array:
                arrays[field.name] = array
            case bool() | int() | float() as number:
                numbers[f"state.{field.name}"] = number
            case Surfaces():
                pass
            case value:
                raise TypeError(f"{field.name} of a state cannot be kept: it is a {type(value).__name__}")
    return Checkpoint(name_of_solver(solver), numbers, arrays)


def solver_of(
    checkpoint: Checkpoint, surfaces: Surfaces, rays: RayScene, settings: SolverSettings
) -> RadiositySolver | SampledSolver | None:
    """The solver that was kept, at rest as it was; None where it is of another scene, or by other settings.

    It takes the checkpoint's arrays for its own.
    """
    if checkpoint.name != _name(surfaces, settings):
        return None
    numbers = checkpoint.numbers
    state = _state_of(checkpoint, surfaces)
    solver: RadiositySolver | SampledSolver
    if "linked" in numbers:
        solver = RadiositySolver(surfaces, rays, settings).again(surfaces, rays, state)
    else:
        solver = SampledSolver(surfaces, rays, settings)
        solver._state = state
    for name in _known(solver):
        setattr(solver, name, numbers[name])
    solver.outcome = SolveOutcome[str(numbers["outcome"])]
    solver._closed = bool(numbers["closed"])
    return solver


def name_of_solver(solver: RadiositySolver | SampledSolver) -> str:
    """What a checkpoint of it is named."""
    return _name(solver.surfaces, solver.settings)


def _known(solver: RadiositySolver | SampledSolver) -> tuple[str, ...]:
    return _KNOWN + (_KNOWN_OF_LINKS if isinstance(solver, RadiositySolver) else ())


def _name(surfaces: Surfaces, settings: SolverSettings) -> str:
    return name_of(surfaces, settings).hex()


def _columns(table: ElementTree | LinkTable) -> dict[str, GrowingArray[Any]]:
    """All of a table that grows; the rest of it follows from the surfaces."""
    return {name: value for name, value in vars(table).items() if isinstance(value, GrowingArray)}


def _state_of(checkpoint: Checkpoint, surfaces: Surfaces) -> TransportState:
    """The state that was kept. Raises KeyError where something of it is missing."""
    state = TransportState.of(surfaces)
    kept: dict[str, Any] = {}
    for field in _KEPT:
        match getattr(state, field.name):
            case ElementTree() | LinkTable() as table:
                for name, column in _columns(table).items():
                    column.truncate(0)
                    column.append(checkpoint.arrays[f"{field.name}.{name}"])
            case np.ndarray():
                kept[field.name] = checkpoint.arrays[field.name]
            case bool() | int() | float():
                kept[field.name] = checkpoint.numbers[f"state.{field.name}"]
    return replace(state, **kept)
