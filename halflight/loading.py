"""Scenes for the command line: files of the project's own format and of others, and samples by name."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from halflight.console import ExitCode, fail, warn

if TYPE_CHECKING:
    from solver.formats.source import ReadOptions
    from solver.geometry.scene import Scene


def load(name: str, options: ReadOptions | None = None) -> Scene:
    """The scene of a file, or the sample of that name. Fails where there is no good one.

    What a file of another format holds and a scene cannot is told as warnings.
    """
    from solver.document.samples import load_sample, load_scene, sample_names
    from solver.errors import LimitExceededError, SceneError
    from solver.formats.reading import format_of

    path = Path(name)
    if not path.exists() and name in sample_names():
        return load_sample(name)
    try:
        return load_scene(path) if format_of(name) is None else _read(path, options)
    except FileNotFoundError:
        samples = ", ".join(sample_names())
        fail(f"{name}: no such file, nor a sample scene; those are {samples}", ExitCode.BAD_INPUT)
    except OSError as refused:
        fail(f"{name}: {(refused.strerror or str(refused)).lower()}", ExitCode.BAD_INPUT)
    except (SceneError, LimitExceededError) as refused:
        fail(f"{name}: {refused}", ExitCode.BAD_INPUT)


def _read(path: Path, options: ReadOptions | None) -> Scene:
    """The scene of a file of another format. Raises OSError, SceneError, LimitExceededError."""
    from solver.document.conversion import scene_of
    from solver.document.limits import SceneLimits
    from solver.formats.reading import format_of, read_scene
    from solver.formats.source import ReadOptions, SourceFile

    chosen = format_of(path.name)
    if chosen is None:
        raise ValueError(f"{path} is of no known format")
    unlimited = SceneLimits(max_polygons=2**31, max_vertices=2**31)
    source = SourceFile(path.name, path.read_bytes(), _Beside(path.resolve().parent))
    imported = read_scene(source, chosen, options or ReadOptions(limits=unlimited))
    for note in imported.warnings:
        warn(note)
    return scene_of(imported.document)


class _Beside(dict[str, bytes]):
    """Files in the directory of a scene file, and below it, as they are asked for."""

    def __init__(self, directory: Path) -> None:
        super().__init__()
        self._directory = directory

    def get(self, name: str, default: bytes | None = None) -> bytes | None:  # type: ignore[override]
        """The bytes of a file; what lies outside of the directory is not there."""
        path = (self._directory / name).resolve()
        if not path.is_relative_to(self._directory) or not path.is_file():
            return default
        return path.read_bytes()
