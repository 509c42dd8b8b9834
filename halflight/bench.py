"""`halflight bench`: speed against error, measured and reported; what `make bench` runs."""

from __future__ import annotations

from typing import Final

import typer

from halflight.console import ExitCode, fail

CONTEXT: Final = {"allow_extra_args": True, "ignore_unknown_options": True, "help_option_names": []}
"""All options are those of the measurements, `--help` too."""


def bench(context: typer.Context) -> None:
    """Measure speed against error, of peers too where they are installed, and write a report."""
    try:
        from benchmarks.command import run
    except ModuleNotFoundError:
        fail("the measurements are not installed; they are in the project's checkout", ExitCode.UNABLE)
    run(context.args, "halflight bench")
