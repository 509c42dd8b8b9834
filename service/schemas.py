"""What the service sends and takes, beside the scene document itself."""

from __future__ import annotations

from dataclasses import asdict, replace
from typing import Annotated, TypeAlias

from pydantic import BaseModel, ConfigDict, Field

from service.journal.documents import Gesture, Snapshot
from solver.document.edits import Edit
from solver.document.fields import Closed, Direction, Point
from solver.document.models import SceneDocument
from solver.document.settings import SettingsDocument
from solver.engine.picking import PickResult
from solver.engine.status import Change, ChangeState, EngineStatus, ProbeResult, SessionState, Spared

Triple: TypeAlias = Annotated[list[float], Field(min_length=3, max_length=3)]
"""x, y, z or R, G, B that are told."""


class SessionRequest(Closed):
    """A scene to be solved: one given here, one that ships with the service, by name, or a snapshot's."""

    scene: SceneDocument | None = None
    sample: str | None = Field(
        default=None,
        strict=True,
        min_length=1,
        max_length=200,
        description="A name from `GET /v1/scenes`, in place of `scene`.",
        examples=["cornell"],
    )
    snapshot: Snapshot | None = Field(
        default=None, description="What `GET …/snapshot` gave, in place of `scene`: a session with a history."
    )
    settings: SettingsDocument = SettingsDocument()


class SavedWork(BaseModel):
    """One saving."""

    saving: str = Field(description="What `settings.in_full` switches off, or `coarse_links`.")
    spared: int = Field(
        description="How many channels, shadow tests of links, rays, discontinuities or interpolants; "
        "how many links are not subdivided further."
    )
    of: int = Field(description="Out of how many.")
    error_estimate: float = Field(
        description="Relative error that this may cause; 0 where it makes no difference. Those of rays and "
        "coarse links are parts of the session's `error_estimate`."
    )

    @classmethod
    def of_engine(cls, spared: Spared) -> SavedWork:
        """The wire's form of a saving."""
        return cls(**asdict(spared))


class SessionStatus(BaseModel):
    """How a session stands."""

    id: str
    name: str = Field(description="The scene's name.")
    revision: int = Field(description="Counts the edit batches: 1 for the scene as it was posted.")
    state: SessionState = Field(
        description="`converged` only when `error_estimate` is within `settings.error_tolerance` and nothing "
        "is left to redistribute; `paused` when a limit of the settings was reached before, and a warning "
        "says which."
    )
    progress: float = Field(ge=0.0, le=1.0)
    error_estimate: float = Field(
        ge=0.0,
        description="Estimated relative error of the radiosity field against the scene's exact solution.",
    )
    unshot_fraction: float = Field(
        ge=0.0, description="Share of the radiosity that is received and not passed on."
    )
    statistics: dict[str, bool | int | float] = Field(
        description="Counts: `polygons`, `elements`, `links`, and more.",
        examples=[{"polygons": 16, "elements": 2412, "links": 30117}],
    )
    savings: list[SavedWork] = Field(
        default=[], description="What the scene did not need, and the error that leaving it out may cause."
    )
    warnings: list[str]
    settings: SettingsDocument
    awake: bool = Field(
        default=True,
        description="Whether a process holds the session; the next request wakes one that sleeps.",
    )

    @classmethod
    def of(cls, session_id: str, status: EngineStatus) -> SessionStatus:
        """The wire's form of a status."""
        return cls(
            id=session_id,
            name=status.name,
            revision=status.revision,
            state=status.state,
            progress=status.progress,
            error_estimate=status.error_estimate,
            unshot_fraction=status.unshot_fraction,
            statistics=asdict(status.statistics) | asdict(status.fine),
            savings=[SavedWork.of_engine(spared) for spared in status.savings],
            warnings=list(status.warnings),
            settings=SettingsDocument.describing(status.settings),
        )

    @classmethod
    def lost(cls, session_id: str, last: EngineStatus) -> SessionStatus:
        """The wire's form of the last status of a session that cannot be brought back now."""
        warnings = (
            *last.warnings,
            "The worker of this session has ended, and it cannot be brought back now.",
        )
        return cls.of(session_id, replace(last, state=SessionState.FAILED, warnings=warnings))

    @classmethod
    def asleep(cls, session_id: str, name: str, revision: int, settings: SettingsDocument) -> SessionStatus:
        """The wire's form of a session that sleeps: of its light nothing is left."""
        return cls(
            id=session_id,
            name=name,
            revision=revision,
            state=SessionState.PAUSED,
            progress=0.0,
            error_estimate=1.0,
            unshot_fraction=1.0,
            statistics={},
            warnings=["The session sleeps: the next request wakes it, and its light settles anew."],
            settings=settings,
            awake=False,
        )


class SessionList(BaseModel):
    """The sessions that the service holds."""

    sessions: list[SessionStatus]


class SceneAnswer(BaseModel):
    """The scene as it stands: posted back, it gives an equal session."""

    revision: int
    scene: SceneDocument


class SampleScene(BaseModel):
    """A scene that ships with the service."""

    name: str
    objects: int
    polygons: int
    cameras: list[str]


class SampleList(BaseModel):
    """The scenes that ship with the service."""

    scenes: list[SampleScene]


class EditBatch(Closed):
    """Edits that are applied all, in their order, or not at all."""

    edits: list[Edit] = Field(min_length=1)
    if_revision: Annotated[int, Field(strict=True, ge=0, lt=2**63)] | None = Field(
        default=None, description="Refuse the batch with 409 where the scene is at another revision."
    )
    gesture: Gesture | None = Field(
        default=None,
        description="The client's own name of what the batch is part of, a drag, say: batches of one "
        "gesture, one right after the other, are undone together.",
    )

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "if_revision": 1,
                    "edits": [
                        {"op": "move", "id": "short_block", "transform": {"translation": [0.05, 0, 0]}},
                        {"op": "set_material", "id": "floor", "material": {"reflectance": [0.2, 0.2, 0.6]}},
                    ],
                }
            ]
        }
    )


class LogEntry(BaseModel):
    """One change, and how far the light has followed it."""

    entry: int = Field(description="Number of the entry in the session, from 1.")
    revision: int = Field(description="The revision that the change made.")
    op: str
    id: str = Field(description="The object that changed.")
    state: ChangeState
    energy_to_redistribute: float = Field(
        description="W of luminance that the change takes away or brings, as far as the solution knew it."
    )
    shots: int = Field(description="Links over which the change has been shot so far.")

    @classmethod
    def of(cls, change: Change) -> LogEntry:
        """The wire's form of a change."""
        return cls(**asdict(change))


class EditsAnswer(BaseModel):
    """What a batch did. The light follows."""

    revision: int
    changes: list[LogEntry]


class LogAnswer(BaseModel):
    """The change log, oldest entries first."""

    revision: int
    entries: list[LogEntry]


class ProbePoint(Closed):
    """A point and the direction that it faces."""

    position: Point = Field(description="Metres.")
    normal: Direction = Field(
        description="Of any length but 0. The point receives light from the side that it points to."
    )


class ProbeRequest(Closed):
    """Points at which to measure."""

    points: list[ProbePoint]

    model_config = ConfigDict(
        json_schema_extra={"examples": [{"points": [{"position": [0.28, 0.0, 0.28], "normal": [0, 1, 0]}]}]}
    )


class ProbeAnswer(BaseModel):
    """The light at the points, in their order."""

    revision: int
    irradiance: list[list[float]] = Field(description="R, G, B in W/m2.")
    illuminance: list[float] = Field(description="lux")
    error_estimate: list[float] = Field(description="Estimated relative error of each.")

    @classmethod
    def of(cls, result: ProbeResult) -> ProbeAnswer:
        """The wire's form of a measurement."""
        return cls(
            revision=result.revision,
            irradiance=result.irradiance.tolist(),
            illuminance=result.illuminance.tolist(),
            error_estimate=result.error_estimate.tolist(),
        )


class PickAnswer(BaseModel):
    """What a pixel shows; all but `revision` and `hit` are null where it shows nothing."""

    revision: int
    hit: bool = Field(description="Whether it shows anything.")
    object: str | None = None
    face: int | None = Field(default=None, description="Index of the face in its object's mesh.")
    patch: int | None = Field(
        default=None, description="The convex piece of the face, as overlays number it."
    )
    element: int | None = Field(default=None, description="The leaf of the element hierarchy.")
    leaf: int | None = Field(default=None, description="The same as a frame's layer `element` numbers it.")
    triangle: int | None = Field(
        default=None,
        description="Of the triangulation, as a frame's layer `triangle`; null before there is one.",
    )
    barycentric: Triple | None = Field(default=None, description="Weights of that triangle's corners.")
    point: Triple | None = Field(default=None, description="Metres.")
    normal: Triple | None = Field(default=None, description="Of the face's front, of length 1.")
    front: bool | None = Field(default=None, description="Whether that is what is seen; a back is black.")
    irradiance: Triple | None = Field(
        default=None, description="W/m2, as a frame shows it: by the interpolant where there is one."
    )
    illuminance: float | None = Field(default=None, description="lux")
    radiosity: Triple | None = Field(default=None, description="W/m2, emission included.")
    depth: float | None = Field(default=None, description="Metres along the viewing direction.")

    @classmethod
    def of(cls, result: PickResult) -> PickAnswer:
        """The wire's form of a pick."""
        found = result.point
        if found is None:
            return cls(revision=result.revision, hit=False)
        seen = found.seen
        return cls(
            revision=result.revision,
            hit=True,
            object=seen.object_id,
            face=seen.face,
            patch=seen.patch,
            element=found.element,
            leaf=seen.leaf,
            triangle=seen.triangle if found.has_interpolant else None,
            barycentric=seen.barycentric.tolist() if found.has_interpolant else None,
            point=seen.position.tolist(),
            normal=(seen.normal + 0.0).tolist(),
            front=found.front,
            irradiance=found.irradiance.tolist(),
            illuminance=found.illuminance,
            radiosity=found.radiosity.tolist(),
            depth=found.depth,
        )


class Health(BaseModel):
    """The service is up."""

    status: str = "ok"
    version: str
    sessions: int
