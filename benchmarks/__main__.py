"""`python -m benchmarks`: measure, and show tables."""

from __future__ import annotations

import json
import time
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer
from rich.console import Console

if TYPE_CHECKING:
    from benchmarks.plan import Section
    from benchmarks.tables import Table

_SECTIONS: Final = ("solve", "accuracy", "rays", "frames", "service")
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
) -> None:  # fmt: skip
    """Measure time, memory, rays and frames against error, and say which targets are met.

    Everything runs on this machine alone, each measurement in a process of its own. Other work on the
    machine shows in the figures.
    """
    from benchmarks import accuracy, frames, occlusion, serving, solving
    from benchmarks.machine import Machine
    from benchmarks.plan import SCENES, Options

    every = tuple(name for name in SCENES if not (quick and name == _QUICK_LEAVES_OUT))
    options = Options(_named(scenes, SCENES, "--scenes") if scenes else every, quick)
    chosen = _named(only, _SECTIONS, "--only") if only else _SECTIONS
    made = (module.section(options) for module in (solving, accuracy, occlusion, frames, serving))
    plan = [section for section in made if section.name in chosen and section.jobs]
    if file is not None and not file.parent.is_dir():
        raise typer.BadParameter(f"there is no directory {file.parent}", param_hint="--json")
    machine, start = Machine.this(), time.perf_counter()
    found = _run(plan)
    tables = [section.table(found[section.name]) for section in plan]
    if file is not None:
        record = {"machine": machine.record(), "options": asdict(options)}
        measured = {name: [asdict(figures) for figures in several] for name, several in found.items()}
        file.write_text(json.dumps({**record, **measured}, indent=2) + "\n", encoding="utf-8")
    _show(str(machine), tables, time.perf_counter() - start, markdown)


def _run(plan: list[Section]) -> dict[str, list[Any]]:
    """What the jobs of each section return."""
    from benchmarks.isolation import in_own_process
    from halflight.console import progress_bar

    found: dict[str, list[Any]] = {}
    with progress_bar() as bar:
        task = bar.add_task("Measuring", total=sum(len(section.jobs) for section in plan), note="")
        for section in plan:
            for job in section.jobs:
                bar.update(task, note=f"{section.name}: {job.label}")
                found.setdefault(section.name, []).append(in_own_process(job.measure, *job.arguments))
                bar.advance(task)
        bar.update(task, note="")
    return found


def _show(machine: str, tables: list[Table], seconds: float, markdown: bool) -> None:
    targets = [target for table in tables for target in table.targets]
    met = sum(target.met for target in targets)
    summary = f"{met} of {len(targets)} targets met; measured in {seconds:.0f} s"
    if markdown:
        typer.echo("\n".join([f"{machine}\n", *(table.markdown() for table in tables), summary]))
        return
    console = Console()
    # A table that is cut off where the output is no terminal helps nobody.
    if not console.is_terminal:
        console = Console(width=200)
    console.print(machine, highlight=False)
    for table in tables:
        console.print()
        console.print(table.rich())
    console.print(f"\n{summary}", highlight=False)


def _named(given: str, known: tuple[str, ...], option: str) -> tuple[str, ...]:
    """The names of a list by comma. Raises BadParameter for one that is not known."""
    names = tuple(name.strip() for name in given.split(","))
    for name in names:
        if name not in known:
            raise typer.BadParameter(f"{name!r} is none of {', '.join(known)}", param_hint=option)
    return names


if __name__ == "__main__":
    typer.run(bench)
