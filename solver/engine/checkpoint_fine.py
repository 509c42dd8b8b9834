"""Interpolants that were built, kept with the solution that they were built on.

Kept are the cells and the samples. The discontinuities, the triangulation and the places of the samples
follow from them and from the solution, to the last bit, and take little; to compute the samples takes
seconds.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Final

import numpy as np

from solver.engine.checkpoint import Checkpoint, Number, name_of_solver
from solver.illumination.interpolation.interpolants import Interpolants
from solver.illumination.meshing.cells import Cells
from solver.illumination.settings import LightSettings
from solver.transport.solve import RadiositySolver
from solver.types import AnyArray

_FINE: Final = "fine."
"""Before the names of all that is kept of interpolants"""

_SAMPLED: Final = ("values", "exact", "strayed", "checked", "check")

_BY: Final = f"{_FINE}settings"
_EXACT: Final = f"{_FINE}exact"


def with_interpolants(
    checkpoint: Checkpoint, interpolants: Interpolants, settings: LightSettings
) -> Checkpoint:
    """A checkpoint that has the interpolants too: a copy of them, since they may be worked on."""
    arrays = {f"cells.{field.name}": getattr(interpolants.cells, field.name) for field in fields(Cells)}
    arrays |= {name: getattr(interpolants, f"_{name}").copy() for name in _SAMPLED}
    numbers: dict[str, Number] = {_BY: _digest(settings), _EXACT: int(interpolants.sample_points()[2].sum())}
    return replace(
        checkpoint,
        numbers={**checkpoint.numbers, **numbers},
        arrays={**checkpoint.arrays, **{f"{_FINE}{name}": array for name, array in arrays.items()}},
    )


def without_interpolants(checkpoint: Checkpoint) -> Checkpoint:
    """A checkpoint of the solution alone."""
    numbers = {name: of for name, of in checkpoint.numbers.items() if not name.startswith(_FINE)}
    arrays = {name: of for name, of in checkpoint.arrays.items() if not name.startswith(_FINE)}
    return replace(checkpoint, numbers=numbers, arrays=arrays)


def interpolants_alone(checkpoint: Checkpoint) -> Checkpoint:
    """A checkpoint without the arrays of the solution."""
    return replace(
        checkpoint, arrays={name: of for name, of in checkpoint.arrays.items() if name.startswith(_FINE)}
    )


def sample_count(checkpoint: Checkpoint) -> int:
    """Samples of interpolants that have been computed."""
    return int(checkpoint.numbers.get(_EXACT, 0))


class KeptInterpolants:
    """What is to be taken up."""

    def __init__(self, arrays: Mapping[str, AnyArray]) -> None:
        self._arrays = arrays

    @staticmethod
    def of(
        checkpoint: Checkpoint | None, solver: RadiositySolver, settings: LightSettings
    ) -> KeptInterpolants | None:
        """Those of a checkpoint, if it is that of this solution, and they were made by these settings."""
        if checkpoint is None or checkpoint.numbers.get(_BY) != _digest(settings):
            return None
        if checkpoint.name != name_of_solver(solver):
            return None
        kept = {
            name.removeprefix(_FINE): of for name, of in checkpoint.arrays.items() if name.startswith(_FINE)
        }
        return KeptInterpolants(kept)

    def cells(self) -> Cells:
        """What they lie over."""
        return Cells(*(self._arrays[f"cells.{field.name}"] for field in fields(Cells)))

    def restore(self, interpolants: Interpolants) -> None:
        """Give the samples to the interpolants over those cells, if they are of the same places."""
        if any(self._arrays[name].shape != getattr(interpolants, f"_{name}").shape for name in _SAMPLED):
            return
        for name in _SAMPLED:
            getattr(interpolants, f"_{name}")[...] = self._arrays[name]
        interpolants._measure(np.arange(len(interpolants._error), dtype=np.int32))
        interpolants._changed(0)


def _digest(settings: LightSettings) -> str:
    return hashlib.blake2b(repr(settings).encode(), digest_size=16).hexdigest()
