"""The `halflight` command: its subcommands, and how their failures are told.

Modules of a subcommand are imported when it runs, so that `--help` answers at once.
"""

from __future__ import annotations

from typing import Annotated

import typer

from halflight import bake, bench, convert, info, render, serve, warm
from halflight.console import project_version

app = typer.Typer(
    name="halflight",
    help="Global illumination that keeps up with edits: post a scene, change it, get converged frames back.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.command("serve")(serve.serve)
app.command("warm")(warm.warm)
app.command("render")(render.render)
app.command("bake")(bake.bake)
app.command("convert")(convert.convert)
app.command("info")(info.info)
app.command("bench", context_settings=bench.CONTEXT)(bench.bench)


def _tell_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"halflight {project_version()}")
        raise typer.Exit


@app.callback()
def _options(
    wanted: Annotated[
        bool, typer.Option("--version", callback=_tell_version, is_eager=True, help="Tell the version.")
    ] = False,
) -> None:
    pass


def main() -> None:
    """Run the command that the arguments name."""
    app()
