"""Running the command line, in this process or as a process of its own."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Final

from typer.testing import CliRunner, Result

from halflight.cli import app

ROOT: Final = Path(__file__).resolve().parent.parent.parent

WITHOUT_OPENGL: Final = {"__EGL_VENDOR_LIBRARY_FILENAMES": "/dev/null"}
"""Environment in which EGL finds no driver."""


def invoke(*arguments: str | Path) -> Result:
    """Run a command in this process."""
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def start(*arguments: str | Path, **environment: str) -> subprocess.Popen[str]:
    """Start a command as a process."""
    return subprocess.Popen(
        [sys.executable, "-m", "halflight", *map(str, arguments)],
        cwd=ROOT,
        env={**os.environ, **environment},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def run(*arguments: str | Path, **environment: str) -> tuple[int, str, str]:
    """Exit status, output and errors of a command that runs as a process."""
    process = start(*arguments, **environment)
    output, errors = process.communicate()
    return process.returncode, output, errors
