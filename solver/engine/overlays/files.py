"""Overlays as files: JSON for programs, binary glTF for eyes."""

from __future__ import annotations

from enum import StrEnum
from typing import Final

import numpy as np
import orjson

from solver.engine.overlays.base import Column, Shown
from solver.engine.overlays.glb import glb_of

_UNITS: Final = {"length": "m", "axes": "those of the scene", "colour": "linear RGB"}


class OverlayFormat(StrEnum):
    """The files that an overlay can be had as."""

    JSON = "json"
    GLB = "glb"


def encode_overlay(shown: Shown, chosen: OverlayFormat) -> bytes:
    """The file of an overlay.

    JSON holds its facts, and a list for each column; numbers that are not finite are null. glTF holds
    its shapes, and as the scene's `extras` those of its facts that are not tables.
    """
    first = next(iter(shown.columns.values()), ())
    head = {"overlay": shown.name, "revision": shown.revision, "total": shown.total, "count": len(first)}
    if chosen is OverlayFormat.GLB:
        facts = {name: fact for name, fact in shown.facts.items() if not isinstance(fact, np.ndarray)}
        return glb_of(shown.shapes, shown.name, {**head, **facts, "units": _UNITS})
    columns = {name: _plain(column) for name, column in shown.columns.items()}
    return orjson.dumps({**head, **shown.facts, **columns}, option=orjson.OPT_SERIALIZE_NUMPY)


def _plain(column: Column) -> Column:
    """What the encoder can read."""
    return np.ascontiguousarray(column) if isinstance(column, np.ndarray) else column
