"""What a reader is given: a file, what lies beside it, and what the file itself does not say."""

from __future__ import annotations

import posixpath
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Final
from urllib.parse import unquote

from solver.document.limits import SceneLimits

DEFAULT_EFFICACY: Final = 179.0
"""lm/W, as in a scene document"""


class UpAxis(StrEnum):
    """Which axis is up: it decides how a scene without cameras is looked at, and nothing else."""

    Y = "y"
    Z = "z"


@dataclass(frozen=True)
class ReadOptions:
    """What files leave open."""

    scale: float = 1.0
    """Metres of one unit of the file"""
    up: UpAxis | None = None
    """None: as is usual for the format"""
    two_sided: bool | None = None
    """Of surfaces of OBJ and STL, which do not say; None: as is usual for the format"""
    luminous_efficacy: float | None = None
    """lm/W by which lumens, candelas and lux become watts; None: what the file says, or the default"""
    merge: bool = True
    """Whether triangles that lie in one plane side by side are made one polygon"""
    limits: SceneLimits = field(default_factory=SceneLimits)

    @property
    def efficacy(self) -> float:
        """lm/W where the file says nothing."""
        return DEFAULT_EFFICACY if self.luminous_efficacy is None else self.luminous_efficacy


@dataclass(frozen=True)
class SourceFile:
    """A file, and the files that it may name."""

    name: str
    content: bytes
    beside: Mapping[str, bytes] = field(default_factory=dict)
    """By paths from where the file itself lies"""

    def neighbour(self, uri: str) -> bytes | None:
        """What the file means by a relative `uri`, if it has come with it."""
        plain = unquote(uri).replace("\\", "/")
        return self.beside.get(posixpath.normpath(plain))
