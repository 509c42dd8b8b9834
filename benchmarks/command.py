"""`make bench`, `halflight bench`, `python -m benchmarks`: measure, show tables, and write the report."""

from __future__ import annotations

import json
import time
from concurrent.futures.process import BrokenProcessPool
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer
from rich.console import Console

if TYPE_CHECKING:
    from rich.table import Table as RichTable

    from benchmarks.plan import Options, Section
    from benchmarks.tables import Target

REPORT: Final = ("cold", "edited", "peers", "profile", "scaling", "calibration", "savings")
DETAILS: Final = (
    "solve", "accuracy", "rays", "fine", "points", "frames", "interpolants", "patterns", "walks",
    "instant", "lights", "walkthrough", "edits", "drags", "service",
)  # fmt: skip
_GROUPS: Final = {"report": REPORT, "details": DETAILS, "all": REPORT + DETAILS}
_FULL_ALONE: Final = ("calibration", "savings")
"""Not in the quick form unless they are named: it is to take three minutes"""

_QUICK_LEAVES_OUT: Final = "robot_cell"
_OUT: Final = Path("out") / "report"


def bench(
    scenes: Annotated[
        str | None, typer.Option(help="Scenes to measure, by comma.", show_default="all", metavar="NAMES")
    ] = None,
    only: Annotated[
        str,
        typer.Option(
            help=f"Measurements, by comma: those of the report ({', '.join(REPORT)}), others "
            f"({', '.join(DETAILS)}), or {', '.join(_GROUPS)}.",
        ),
    ] = "report",
    full: Annotated[
        bool,
        typer.Option("--full", help=f"All settings and sizes, {_QUICK_LEAVES_OUT} too: over an hour."),
    ] = False,
    out: Annotated[
        Path,
        typer.Option(
            help="Where the report goes: performance.md, and its plots and figures beside it. What was "
            "measured before and is not measured now stays in it."
        ),
    ] = _OUT,
    markdown: Annotated[bool, typer.Option("--markdown", help="Print Markdown.")] = False,
    file: Annotated[
        Path | None, typer.Option("--json", help="Write all figures here, too.", metavar="FILE")
    ] = None,
    plots: Annotated[Path | None, typer.Option(help="Draw the curves of edits into this directory.")] = None,
) -> None:  # fmt: skip
    """Measure speed against error, here and of peers, and say which targets are met.

    The quick form takes under three minutes. Everything runs on this machine alone, each measurement in a
    process of its own. Other work on the machine shows in the figures.
    """
    from benchmarks.isolation import in_own_process
    from benchmarks.machine import Machine
    from benchmarks.plan import SCENES, Options
    from benchmarks.report import document, runs
    from benchmarks.report.plots import has_plots
    from halflight.console import progress_bar

    every = tuple(name for name in SCENES if full or name != _QUICK_LEAVES_OUT)
    options = Options(_named(scenes, SCENES, "--scenes") if scenes else every, not full)
    named = _named(only, (*_GROUPS, *_GROUPS["all"]), "--only")
    chosen = {name for given in named for name in _GROUPS.get(given, (given,))}
    if not full:
        chosen -= set(_FULL_ALONE) - set(named)
    plan = [section for section in _sections(options) if section.name in chosen and section.jobs]
    if file is not None and not file.parent.is_dir():
        raise typer.BadParameter(f"there is no directory {file.parent}", param_hint="--json")
    if plots is not None and not has_plots():
        raise typer.BadParameter(
            "curves are drawn by matplotlib, which is not installed", param_hint="--plots"
        )
    machine, start = Machine.this(), time.perf_counter()
    found: dict[str, list[Any]] = {}
    targets: list[Target] = []
    kept = out / "performance" / "figures.json"
    _tell(str(machine))
    with progress_bar() as bar:
        task = bar.add_task("Measuring", total=sum(len(section.jobs) for section in plan), note="")
        for section in plan:
            measured = found[section.name] = []
            begun = time.perf_counter()
            for job in section.jobs:
                bar.update(task, note=f"{section.name}: {job.label}")
                try:
                    measured.append(in_own_process(job.measure, *job.arguments))
                except BrokenProcessPool:
                    # That memory is short, or a compiler gives up, is no reason to lose the others.
                    _tell(f"{section.name}: the process of {job.label} died, and is left out")
                bar.advance(task)
            # At once: what comes later may fail.
            table = section.table(measured)
            targets.extend(table.targets)
            _tell(table.markdown() if markdown else table.rich())
            run = runs.Run.of(machine, options, time.perf_counter() - begun, measured, table)
            before = runs.load(kept)
            runs.save(kept, {**before, section.name: run.joined(before.get(section.name))})
            if plots is not None and section.plot is not None:
                plots.mkdir(parents=True, exist_ok=True)
                section.plot(measured, plots)
        bar.update(task, note="")
    if file is not None:
        record = {"machine": machine.record(), "options": asdict(options)}
        figures = {name: [asdict(one) for one in several] for name, several in found.items()}
        file.write_text(json.dumps({**record, **figures}, indent=2) + "\n", encoding="utf-8")
    if chosen & set(REPORT):
        known = runs.load(kept)
        told = document.headline(known)
        targets.extend(told.targets)
        _tell(told.markdown() if markdown else told.rich())
        _tell(f"The report: {document.write(out, known)}")
    met = sum(target.met for target in targets)
    _tell(f"{met} of {len(targets)} targets met; measured in {time.perf_counter() - start:.0f} s")


def run(arguments: list[str] | None = None, name: str = "python -m benchmarks") -> None:
    """The command by itself, with `arguments` or those that the process has."""
    app = typer.Typer(add_completion=False, rich_markup_mode=None, pretty_exceptions_enable=False)
    app.command(context_settings={"help_option_names": ["-h", "--help"]})(bench)
    app(arguments, prog_name=name)


def _sections(options: Options) -> list[Section]:
    """All there are, in the order of the report."""
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
        savings,
        serving,
        solving,
        walks,
        walkthrough,
    )
    from benchmarks.calibration import section as calibration
    from benchmarks.report import profile, sections

    details = (
        solving, accuracy, occlusion, fine, point_irradiance, frames, interpolant_frames, patterns, walks,
        instant, instant_costs, walkthrough, edits, drags, serving,
    )  # fmt: skip
    report = (
        sections.cold, sections.edited, sections.peers, profile.section, sections.scaling,
        calibration.section, savings.section,
    )  # fmt: skip
    return [make(options) for make in (*report, *(module.section for module in details))]


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
