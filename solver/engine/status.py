"""What an engine tells of itself: frozen snapshots."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from solver.illumination.settings import LightSettings
from solver.transport.solve import SolverStatistics
from solver.types import FloatArray


class SessionState(StrEnum):
    """How a session stands."""

    SOLVING = "solving"
    """The solution is being worked on."""
    CONVERGED = "converged"
    """The estimated error is within the tolerance and nothing is left to redistribute."""
    PAUSED = "paused"
    """A limit in the settings was reached before the tolerance; a warning says which. Changing the
    settings or the scene starts the work again."""
    FAILED = "failed"
    """The solve met an error that it cannot go on from; a warning says which. An edit starts anew."""


class ChangeState(StrEnum):
    """How far the light has followed a change."""

    PENDING = "pending"
    REDISTRIBUTING = "redistributing"
    SETTLED = "settled"


@dataclass(frozen=True)
class FineStatistics:
    """Counts of what has been built on the solution; 0 until somebody looks."""

    discontinuities: int = 0
    """Found"""
    discontinuities_active: int = 0
    """Meshed"""
    discontinuities_weak: int = 0
    """Left out since they hardly show"""
    discontinuities_crowded: int = 0
    """Left out since a leaf on their way has all that it may have"""
    triangles: int = 0
    interpolants: int = 0
    """Triangles whose samples are point irradiances"""
    taken_over: int = 0
    """Samples that edits left as they were, but for what the solution tells"""
    point_irradiances: int = 0
    """Computed so far"""


@dataclass(frozen=True)
class Spared:
    """What one saving has left out so far."""

    saving: str
    spared: int
    """Of whatever it leaves out: channels, links without rays, rays, discontinuities, triangles; links that
    are not subdivided"""
    of: int
    """Of how many"""
    error_estimate: float
    """Relative error that it may cause"""


@dataclass(frozen=True)
class EngineStatus:
    """One moment of an engine."""

    name: str
    revision: int
    """Counts the edit batches: 1 for the scene as it was given."""
    state: SessionState
    progress: float
    """0 to 1"""
    error_estimate: float
    """Estimated relative error of the radiosity field against the exact solution of the scene."""
    unshot_fraction: float
    """Share of the radiosity that has been received and not yet passed on."""
    statistics: SolverStatistics
    fine: FineStatistics
    savings: tuple[Spared, ...]
    warnings: tuple[str, ...]
    settings: LightSettings


@dataclass(frozen=True)
class Change:
    """One entry of the change log."""

    entry: int
    """Number of the entry in the session, from 1."""
    revision: int
    """The revision that the change made."""
    op: str
    id: str
    """The object that changed."""
    state: ChangeState
    energy_to_redistribute: float
    """W of luminance at stake: of links that have not been looked at since the change, were they open, and
    its share of what is received but not propagated yet. Before anything is known: what left the object, or
    what an object that is added emits."""
    shots: int
    """Links over which the change has been shot so far."""


@dataclass(frozen=True, eq=False)
class ProbeResult:
    """The light at n points."""

    revision: int
    irradiance: FloatArray
    """(n, 3) W/m2"""
    illuminance: FloatArray
    """(n,) lux"""
    error_estimate: FloatArray
    """(n,) relative"""
