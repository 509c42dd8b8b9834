"""What the service answers, as frozen values."""

from __future__ import annotations

import io
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, Self

import httpx
import numpy as np
from numpy.typing import NDArray
from PIL import Image


@dataclass(frozen=True)
class _Told:
    @classmethod
    def of(cls, told: Mapping[str, Any]) -> Self:
        """From JSON; what a later service tells beyond this is left out."""
        return cls(**{field.name: told[field.name] for field in fields(cls)})


@dataclass(frozen=True)
class Status(_Told):
    """How a session stands."""

    id: str
    name: str
    revision: int
    state: str
    """solving, converged, paused or failed"""
    progress: float
    """0 to 1"""
    error_estimate: float
    unshot_fraction: float
    statistics: dict[str, float]
    warnings: list[str]
    settings: dict[str, Any]

    @property
    def rests(self) -> bool:
        """Whether nothing will become better by itself."""
        return self.state != "solving"


@dataclass(frozen=True)
class LogEntry(_Told):
    """A change, and how far the light has followed it."""

    entry: int
    revision: int
    op: str
    id: str
    state: str
    """pending, redistributing or settled"""
    energy_to_redistribute: float
    """W"""
    shots: int


@dataclass(frozen=True)
class Edited:
    """What a batch of edits did."""

    revision: int
    changes: tuple[LogEntry, ...]

    @classmethod
    def of(cls, told: Mapping[str, Any]) -> Edited:
        """From JSON."""
        return cls(told["revision"], tuple(map(LogEntry.of, told["changes"])))


@dataclass(frozen=True)
class Frame:
    """A frame as a file, and what it is worth."""

    content: bytes
    media_type: str
    revision: int
    error_estimate: float
    converged: bool
    etag: str

    @classmethod
    def of(cls, answer: httpx.Response) -> Frame:
        """From an answer."""
        told = answer.headers
        return cls(
            content=answer.content,
            media_type=told["content-type"],
            revision=int(told["x-revision"]),
            error_estimate=float(told["x-error-estimate"]),
            converged=told["x-converged"] == "true",
            etag=told["etag"],
        )

    @property
    def array(self) -> NDArray[Any]:
        """(height, width, 3) float32, radiance in W/(m2 sr), top row first, of `format="npy"`; of pictures,
        sRGB bytes."""
        if self.content.startswith(b"\x93NUMPY"):
            return np.asarray(np.load(io.BytesIO(self.content), allow_pickle=False))
        return np.asarray(self.image)

    @property
    def image(self) -> Image.Image:
        """The picture, of `format="png"`, `jpeg` or `webp`."""
        return Image.open(io.BytesIO(self.content))


@dataclass(frozen=True)
class Probed:
    """The light at n points."""

    revision: int
    irradiance: NDArray[np.float64]
    """(n, 3) W/m2"""
    illuminance: NDArray[np.float64]
    """(n,) lux"""
    error_estimate: NDArray[np.float64]
    """(n,) relative"""

    @classmethod
    def of(cls, told: Mapping[str, Any]) -> Probed:
        """From JSON."""
        return cls(
            told["revision"],
            np.array(told["irradiance"]).reshape(-1, 3),
            np.array(told["illuminance"]),
            np.array(told["error_estimate"]),
        )


@dataclass(frozen=True)
class Picked(_Told):
    """What a pixel shows; all but `revision` and `hit` are None where it shows nothing."""

    revision: int
    hit: bool
    object: str | None
    face: int | None
    point: list[float] | None
    """Metres"""
    normal: list[float] | None
    irradiance: list[float] | None
    """W/m2"""
    radiosity: list[float] | None
    """W/m2"""
