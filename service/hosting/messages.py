"""What the web process and a worker say to each other.

Each request is a frozen dataclass whose type parameter is what it is answered with. They travel as
pickles over a socket pair that only the two processes hold.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Any, Generic, TypeAlias, TypeVar

from service.hosting.light_keeping import LightPlace
from service.hosting.pictures import Presentation
from solver.document.edits import Edit
from solver.document.fields import Location
from solver.document.limits import SceneLimits
from solver.document.settings import SettingsDocument
from solver.engine.exports.files import Export, ExportRequest
from solver.engine.grids import GridRequest
from solver.engine.lightmaps.bake import LightmapRequest
from solver.engine.lightmaps.files import LightmapFormat
from solver.engine.overlays.base import OverlayRequest
from solver.engine.overlays.files import OverlayFormat
from solver.engine.past import Past
from solver.engine.picking import PickResult
from solver.engine.requests import CameraChoice, Encoding, FrameLimits, FrameRequest, Wait
from solver.engine.status import Change, EngineStatus, ProbeResult
from solver.engine.views import Outlook
from solver.geometry.scene import Scene
from solver.illumination.settings import LightSettings
from solver.types import FloatArray, Points

R = TypeVar("R")


class Request(Generic[R]):
    """A request that is answered with an R."""


AnyRequest: TypeAlias = Request[Any]


@dataclass(frozen=True)
class Open(Request[EngineStatus]):
    """Make the worker's engine, of a scene or of what a session was before. Its first request."""

    scene: Scene | Past
    settings: LightSettings
    limits: SceneLimits
    frame_limits: FrameLimits
    most_bytes: int
    """Of memory that it may take"""
    light: LightPlace | None = None
    """Where its light is kept; None: nowhere"""


@dataclass(frozen=True)
class GetStatus(Request[EngineStatus]):
    """How the session stands."""


@dataclass(frozen=True)
class SceneAnswer:
    """The scene of a revision."""

    revision: int
    scene: Scene


@dataclass(frozen=True)
class GetScene(Request[SceneAnswer]):
    """The scene as it stands."""


@dataclass(frozen=True)
class Configure(Request[EngineStatus]):
    """Change the solver settings that the document gives."""

    changes: SettingsDocument


@dataclass(frozen=True)
class EditsAnswer:
    """What a batch did."""

    revision: int
    changes: tuple[Change, ...]


@dataclass(frozen=True)
class ApplyEdits(Request[EditsAnswer]):
    """Apply a batch of edits."""

    edits: tuple[Edit, ...]
    if_revision: int | None
    gesture: str | None = None
    """Batches of one in a row are taken back together."""


@dataclass(frozen=True)
class Undo(Request[EditsAnswer]):
    """Take back the newest batch."""


@dataclass(frozen=True)
class Redo(Request[EditsAnswer]):
    """Bring back the batch that was taken back last."""


@dataclass(frozen=True)
class GetLog(Request[EditsAnswer]):
    """The change log: all entries, and the revision."""


@dataclass(frozen=True)
class FrameAnswer:
    """An encoded frame; without content where the client has it already."""

    content: bytes | None
    tag: str
    outlook: Outlook
    seconds: float
    """What drawing it took"""
    width: int = 0
    height: int = 0
    """Pixels; 0 without content"""
    scale_maximum: float | None = None
    """Lux at the end of the scale of false colours; None where that is not known"""


@dataclass(frozen=True)
class GetFrame(Request[FrameAnswer]):
    """A frame, once it is good enough or time is up."""

    frame: FrameRequest
    encoding: Encoding
    wait: Wait
    timeout: float
    """Seconds"""
    known_tags: frozenset[str]
    """Frames of these tags need not be sent"""
    presentation: Presentation | None = None
    """How a stream shows it; None: as it is"""
    is_budget: bool = False
    """Whether the frame is to be drawn and encoded by then, not to be begun"""


@dataclass(frozen=True)
class Probe(Request[ProbeResult]):
    """The light at points (n, 3) with normals (n, 3)."""

    positions: Points
    normals: FloatArray


@dataclass(frozen=True)
class GetPick(Request[PickResult]):
    """What a pixel shows."""

    camera: CameraChoice
    x: int
    y: int


@dataclass(frozen=True)
class OverlayAnswer:
    """An encoded overlay."""

    content: bytes


@dataclass(frozen=True)
class GetOverlay(Request[OverlayAnswer]):
    """An overlay, once it can be shown; refused where time is up before."""

    overlay: OverlayRequest
    format: OverlayFormat
    timeout: float
    """Seconds"""


@dataclass(frozen=True)
class LightmapAnswer:
    """An encoded lightmap, and what is to be told of it."""

    content: bytes
    revision: int
    width: int
    height: int
    density: float
    """Texels per metre"""
    white: float
    """W/m2 of irradiance that pictures show white"""
    method: str
    error_estimate: float
    converged: bool


@dataclass(frozen=True)
class GetLightmap(Request[LightmapAnswer]):
    """A lightmap, once it is good enough or time is up; refused where there is nothing of it by then."""

    lightmap: LightmapRequest
    format: LightmapFormat
    white: float | None
    """W/m2; None: as suits"""
    complete: bool
    """Wait until all is done that is to be done"""
    timeout: float
    """Seconds"""


@dataclass(frozen=True)
class GetExport(Request[Export]):
    """The session as a file, once its light is good enough or time is up."""

    export: ExportRequest
    complete: bool
    """Wait until the solution rests"""
    timeout: float
    """Seconds"""


@dataclass(frozen=True)
class GetGrid(Request[Export]):
    """Light measured over a grid of points, as a table."""

    grid: GridRequest
    complete: bool
    """Wait until the solution rests"""
    timeout: float
    """Seconds"""


class RefusalKind(StrEnum):
    """Why a request was refused."""

    INVALID = "invalid"
    CONFLICT = "conflict"
    NOTHING = "nothing"
    LIMIT = "limit"
    NOT_AVAILABLE = "not_available"
    NO_RENDERING = "no_rendering"
    NOT_READY = "not_ready"


@dataclass(frozen=True)
class Refusal:
    """A request was refused, and nothing has changed."""

    kind: RefusalKind
    detail: str
    location: Location = ()
    """The offending field of an invalid request"""


@dataclass(frozen=True)
class Call:
    """To the worker: answer a request."""

    number: int
    request: AnyRequest


@dataclass(frozen=True)
class Abandon:
    """To the worker: nobody waits for that answer any more."""

    number: int


@dataclass(frozen=True)
class Answer:
    """To the web process: what a request is answered with."""

    number: int
    value: object


@dataclass(frozen=True)
class Ready:
    """To the web process: the worker has its kernels loaded and can take a session."""

    rendering_problem: str | None
    """Why it cannot draw frames, if it cannot"""


@dataclass(frozen=True)
class StatusChanged:
    """To the web process: the session stands otherwise than before."""

    status: EngineStatus


ToWorker: TypeAlias = Call | Abandon
FromWorker: TypeAlias = Ready | Answer | StatusChanged
