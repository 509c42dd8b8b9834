"""How the command line talks: results on standard output, progress and failures on standard error."""

from __future__ import annotations

from enum import IntEnum
from importlib.metadata import PackageNotFoundError, version
from typing import NoReturn

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn


class ExitCode(IntEnum):
    """What the exit status of a failed command says; 0 is success."""

    UNABLE = 1
    """This machine cannot do it: no OpenGL, no room on the disk, a port that is taken."""
    BAD_INPUT = 2
    """A scene, an option or a setting is not acceptable."""
    NOT_REACHED = 3
    """The picture is written, but a limit ended the solve before its tolerance."""


def fail(message: str, code: ExitCode) -> NoReturn:
    """Tell on one line what is wrong, and end with that status."""
    typer.echo(f"halflight: {' '.join(message.split())}", err=True)
    raise typer.Exit(code)


def warn(message: str) -> None:
    """Tell what a user should know, and go on."""
    typer.echo(f"halflight: warning: {message}", err=True)


def progress_bar() -> Progress:
    """A progress bar on standard error, if that is a terminal; a task's field `note` is shown at its end."""
    console = Console(stderr=True)
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        TaskProgressColumn(),
        TimeElapsedColumn(),
        TextColumn("{task.fields[note]}"),
        console=console,
        disable=not console.is_terminal,
    )


def project_version() -> str:
    """The version of the installed project."""
    try:
        return version("halflight")
    except PackageNotFoundError:
        return "(not installed)"
