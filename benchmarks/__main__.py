"""`python -m benchmarks`: measure, and show tables."""

from __future__ import annotations

import json
import time
from dataclasses import asdict
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer
from rich.console import Console

if TYPE_CHECKING:
    from rich.table import Table as RichTable

    from benchmarks.tables import Target

_SECTIONS: Final = (
    "solve", "accuracy", "rays", "fine", "points", "frames", "interpolants", "patterns", "walks",
    "instant", "lights", "walkthrough", "edits", "drags", "service",
)  # fmt: skip
_QUICK_LEAVES_OUT: Final = "robot_cell"


def bench(
    scenes: Annotated[
        str | None, typer.Option(help="Scenes to solve, by comma.", show_default="all", metavar="NAMES")
    ] = None,
    only: Annotated[
        str | None,
        typer.Option(help=f"Measurements, by comma: {', '.join(_SECTIONS)}.", show_default="all"),
    ] = None,
    quick: Annotated[
        bool,
        typer.Option("--quick", help=f"Coarser, in less time; without {_QUICK_LEAVES_OUT}."),
    ] = False,
    markdown: Annotated[bool, typer.Option("--markdown", help="Print Markdown.")] = False,
    file: Annotated[
        Path | None, typer.Option("--json", help="Write all figures here, too.", metavar="FILE")
    ] = None,
    plots: Annotated[
        Path | None,
        typer.Option(help="Draw curves into this directory; needs the packages of `make setup-dev`."),
    ] = None,
) -> None:  # fmt: skip
    """Measure time, memory, rays and frames against error, and say which targets are met.

    Everything runs on this machine alone, each measurement in a process of its own. Other work on the
    machine shows in the figures.
    """
    from benchmarks import (
        accuracy,
        drags,
        edits,
        fine,
        frames,
        instant,
        instant_costs,
        interpolant_frames,
        occlusion,
        patterns,
        point_irradiance,
        serving,
        solving,
        walks,
        walkthrough,
    )
    from benchmarks.isolation import in_own_process
    from benchmarks.machine import Machine
    from benchmarks.plan import SCENES, Options
    from halflight.console import progress_bar

    every = tuple(name for name in SCENES if not (quick and name == _QUICK_LEAVES_OUT))
    options = Options(_named(scenes, SCENES, "--scenes") if scenes else every, quick)
    chosen = _named(only, _SECTIONS, "--only") if only else _SECTIONS
    modules = (
        solving, accuracy, occlusion, fine, point_irradiance, frames, interpolant_frames, patterns, walks,
        instant, instant_costs, walkthrough, edits, drags, serving,
    )  # fmt: skip
    made = (module.section(options) for module in modules)
    plan = [section for section in made if section.name in chosen and section.jobs]
    if file is not None and not file.parent.is_dir():
        raise typer.BadParameter(f"there is no directory {file.parent}", param_hint="--json")
    if plots is not None and find_spec("matplotlib") is None:
        raise typer.BadParameter(
            "curves are drawn by matplotlib, which is not installed", param_hint="--plots"
        )
    machine, start = Machine.this(), time.perf_counter()
    found: dict[str, list[Any]] = {}
    targets: list[Target] = []
    _tell(str(machine))
    with progress_bar() as bar:
        task = bar.add_task("Measuring", total=sum(len(section.jobs) for section in plan), note="")
        for section in plan:
            measured = found[section.name] = []
            for job in section.jobs:
                bar.update(task, note=f"{section.name}: {job.label}")
                measured.append(in_own_process(job.measure, *job.arguments))
                bar.advance(task)
            # At once: what comes later may fail.
            table = section.table(measured)
            targets.extend(table.targets)
            _tell(table.markdown() if markdown else table.rich())
            if plots is not None and section.plot is not None:
                plots.mkdir(parents=True, exist_ok=True)
                section.plot(measured, plots)
        bar.update(task, note="")
    if file is not None:
        record = {"machine": machine.record(), "options": asdict(options)}
        figures = {name: [asdict(one) for one in several] for name, several in found.items()}
        file.write_text(json.dumps({**record, **figures}, indent=2) + "\n", encoding="utf-8")
    met = sum(target.met for target in targets)
    _tell(f"{met} of {len(targets)} targets met; measured in {time.perf_counter() - start:.0f} s")


def _tell(what: str | RichTable) -> None:
    """Text as it is, or a table."""
    if isinstance(what, str):
        typer.echo(f"{what}\n")
        return
    console = Console()
    # A table that is cut off where the output is no terminal helps nobody.
    if not console.is_terminal:
        console = Console(width=200)
    console.print(what, "")


def _named(given: str, known: tuple[str, ...], option: str) -> tuple[str, ...]:
    """The names of a list by comma. Raises BadParameter for one that is not known."""
    names = tuple(name.strip() for name in given.split(","))
    for name in names:
        if name not in known:
            raise typer.BadParameter(f"{name!r} is none of {', '.join(known)}", param_hint=option)
    return names


if __name__ == "__main__":
    app = typer.Typer(add_completion=False, rich_markup_mode=None, pretty_exceptions_enable=False)
    app.command()(bench)
    app()
