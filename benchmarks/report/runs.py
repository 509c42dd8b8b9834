"""What has been measured, kept as JSON: each section with the commit, the machine and the day of its run.

A run of some sections leaves those of earlier runs as they were, and a run of some scenes the figures of
others, so that a long report can be made in pieces.
"""

from __future__ import annotations

import json
import subprocess
from dataclasses import asdict, dataclass, replace
from datetime import date
from pathlib import Path
from typing import Any, Final, Self

from benchmarks.machine import Machine
from benchmarks.plan import SCENES, Options
from benchmarks.report.peers import peer_versions
from benchmarks.report.profile import Profile
from benchmarks.report.scaling import Size
from benchmarks.report.trials import Trial
from benchmarks.tables import Table

_ROOT: Final = Path(__file__).parents[2]


@dataclass(frozen=True)
class Run:
    """Of one section."""

    commit: str
    day: str
    machine: str
    peers: str
    """Versions of those installed"""
    is_quick: bool
    scenes: tuple[str, ...]
    seconds: float
    figures: list[dict[str, Any]]
    table: str
    """As Markdown"""

    @classmethod
    def of(cls, machine: Machine, options: Options, seconds: float, found: list[Any], table: Table) -> Self:
        """What has just been measured."""
        return cls(
            commit=_commit(),
            day=date.today().isoformat(),
            machine=str(machine),
            peers=peer_versions(),
            is_quick=options.quick,
            scenes=options.scenes,
            seconds=seconds,
            figures=[asdict(one) for one in found],
            table=table.markdown(),
        )

    def joined(self, before: Run | None) -> Run:
        """This run with those figures of an earlier one, of the same form, that it has none in place of."""
        if before is None or before.is_quick != self.is_quick:
            return self
        known = {_key(figure) for figure in self.figures}
        others = [figure for figure in before.figures if _key(figure) not in known | {None}]
        if not others:
            return self
        commits = dict.fromkeys([*before.commit.split(", "), self.commit])
        return replace(
            self,
            commit=", ".join(commits),
            scenes=tuple(dict.fromkeys([*before.scenes, *self.scenes])),
            seconds=before.seconds + self.seconds,
            figures=[*others, *self.figures],
        )


def _key(figure: dict[str, Any]) -> tuple[str, ...] | None:
    """What a figure of the report is of; None for others, which are replaced as a whole."""
    if figure.get("trials"):
        first = figure["trials"][0]
        return str(first["scene"]), str(first["renderer"])
    if "profiles" in figure:
        return (str(figure["profiles"][0]["scene"]),)
    return (str(figure["family"]), str(figure["polygons"])) if "family" in figure else None


def load(file: Path) -> dict[str, Run]:
    """Sections by name; none where there is no file."""
    if not file.exists():
        return {}
    return {name: Run(**run) for name, run in json.loads(file.read_text(encoding="utf-8")).items()}


def save(file: Path, runs: dict[str, Run]) -> None:
    """Write them all."""
    file.parent.mkdir(parents=True, exist_ok=True)
    told = {name: asdict(run) for name, run in runs.items()}
    file.write_text(json.dumps(told, indent=1) + "\n", encoding="utf-8")


def trials_of(runs: dict[str, Run]) -> list[Trial]:
    """Of all sections that have some, scene by scene."""
    figures = [one for run in runs.values() for one in run.figures if "trials" in one]
    trials = [Trial.from_record(trial) for one in figures for trial in one["trials"]]
    return sorted(trials, key=lambda trial: SCENES.index(trial.scene))


def sizes_of(runs: dict[str, Run]) -> list[Size]:
    """Of the scaling."""
    sizes = [Size.from_record(size) for size in runs["scaling"].figures] if "scaling" in runs else []
    return sorted(sizes, key=lambda size: (size.family, size.polygons))


def profiles_of(runs: dict[str, Run]) -> list[Profile]:
    """Of where the time goes."""
    figures = runs["profile"].figures if "profile" in runs else []
    return [Profile.from_record(profile) for one in figures for profile in one["profiles"]]


def missing_of(runs: dict[str, Run]) -> str:
    """Why there are no peers, if so."""
    figures = runs["peers"].figures if "peers" in runs else []
    return next((one["missing"] for one in figures if one["missing"]), "" if figures else "not measured")


def _commit() -> str:
    """Of the checkout, + where it has changes; empty where it is none."""
    try:
        done = subprocess.run(
            ["git", "describe", "--always", "--dirty=+", "--abbrev=10"],
            cwd=_ROOT, capture_output=True, text=True, check=True,
        )  # fmt: skip
    except (OSError, subprocess.CalledProcessError):
        return ""
    return done.stdout.strip()
