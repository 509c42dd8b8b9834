"""Settled solutions that are remembered: a scene that is as it was before has the light that it had.

What is added and removed again, moved there and back, switched on and off, or undone, leads to a scene that
was solved. Redistribution would come back to its light within the tolerance only, by another mesh.
"""

from __future__ import annotations

import hashlib
from collections import OrderedDict
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final

from solver.geometry.surfaces import Surfaces
from solver.transport.field import SolveOutcome
from solver.transport.settings import SolverSettings
from solver.transport.solve import RadiositySolver
from solver.transport.state import TransportState
from solver.visibility.rays import RayScene

BYTES: Final = 384 << 20
"""Most that the remembered solutions of a session hold: two of a large scene, before and after an edit."""

COUNT: Final = 8
"""Solutions that are remembered at most."""


@dataclass(frozen=True, eq=False)
class _Kept:
    solver: RadiositySolver
    state: TransportState

    @property
    def nbytes(self) -> int:
        return self.state.nbytes


class Memory:
    """The last settled solutions, as many as there is room for."""

    def __init__(self, most: int = BYTES) -> None:
        """Hold up to `most` bytes."""
        self._most = most
        self._kept: OrderedDict[bytes, _Kept] = OrderedDict()

    @property
    def nbytes(self) -> int:
        """Bytes held."""
        return sum(kept.nbytes for kept in self._kept.values())

    def remember(self, solver: RadiositySolver) -> Iterator[None]:
        """Keep a copy of a settled solution, if there is room; yields every few milliseconds."""
        key = name_of(solver.surfaces, solver.settings)
        if key in self._kept:
            self._kept.move_to_end(key)
            return
        state = solver.state
        if solver.outcome is not SolveOutcome.CONVERGED or state.nbytes > self._most:
            return
        links = yield from state.links.copy_in_steps()
        while self._kept and (self.nbytes + state.nbytes > self._most or len(self._kept) >= COUNT):
            self._kept.popitem(last=False)
        self._kept[key] = _Kept(solver, replace(state, links=links))

    def recall(self, surfaces: Surfaces, rays: RayScene, settings: SolverSettings) -> RadiositySolver | None:
        """The solution of a scene that was settled by the same settings; it is no longer kept then."""
        kept = self._kept.pop(name_of(surfaces, settings), None)
        if kept is None:
            return None
        return kept.solver.again(surfaces, rays, kept.state)


def name_of(surfaces: Surfaces, settings: SolverSettings) -> bytes:
    """What tells scenes and settings apart that have different solutions."""
    told = hashlib.blake2b(repr((surfaces.object_ids, settings)).encode())
    for array in (
        surfaces.corners, surfaces.corner_count, surfaces.object, surfaces.side, surfaces.reflectance,
        surfaces.emission, surfaces.specular, surfaces.exponent, surfaces.emission_exponent,
    ):  # fmt: skip
        told.update(array.tobytes())
    return told.digest()
