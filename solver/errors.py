"""The SolverError family: each error carries its data and builds its own message from it."""

from __future__ import annotations


class SolverError(Exception):
    """Base of all errors that the solver raises on purpose."""


class SceneError(SolverError):
    """A scene or an edit of it is not acceptable; `location` is the path of the offending field."""

    def __init__(self, message: str, location: tuple[str | int, ...] = ()) -> None:
        self.message = message
        self.location = location
        where = ".".join(str(part) for part in location)
        super().__init__(f"{where}: {message}" if where else message)


class UnknownObjectError(SceneError):
    """An edit names an object that the scene does not hold."""

    def __init__(self, object_id: str, location: tuple[str | int, ...] = ()) -> None:
        self.object_id = object_id
        super().__init__(f"no object with id {object_id!r}", location)


class DuplicateObjectError(SceneError):
    """An object id occurs twice."""

    def __init__(self, object_id: str, location: tuple[str | int, ...] = ()) -> None:
        self.object_id = object_id
        super().__init__(f"an object with id {object_id!r} exists already", location)


class UnknownCameraError(SceneError):
    """A frame names a camera that the scene does not hold."""

    def __init__(self, camera: str, known: tuple[str, ...]) -> None:
        self.camera = camera
        self.known = known
        super().__init__(f"no camera {camera!r}; the scene has {', '.join(known) or 'none'}", ("camera",))


class RevisionConflictError(SolverError):
    """An edit was made for a revision that is not the current one."""

    def __init__(self, expected: int, current: int) -> None:
        self.expected = expected
        self.current = current
        super().__init__(f"if_revision is {expected}, but the scene is at revision {current}")


class LimitExceededError(SolverError):
    """Something asked for is larger than a configured limit."""

    def __init__(self, what: str, value: float, limit: float) -> None:
        self.what = what
        self.value = value
        self.limit = limit
        super().__init__(f"{what}: {value:,} exceeds the limit of {limit:,}")


class RenderingUnavailableError(SolverError):
    """No OpenGL context can be made on this machine."""

    def __init__(self, reason: str) -> None:
        self.reason = reason
        super().__init__(
            "Rendering needs OpenGL 4.3 through EGL: install Mesa with "
            f"'apt-get install libegl1 libgl1-mesa-dri' ({reason})"
        )
