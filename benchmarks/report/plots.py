"""Curves as pictures, log-log: error against time, one a scene and case; time and memory against polygons."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from benchmarks.report.front import GOALS, front
from benchmarks.report.trials import Case, Trial

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from benchmarks.report.scaling import Size

_COLOURS: Final = {
    "interpolant": "C0", "gouraud": "C2", "flat": "C8", "vpl": "C1", "gather": "C4", "path": "C5",
    "Mitsuba path": "0.6", "Mitsuba path + OIDN": "k",
}  # fmt: skip
_LEAST_ERROR: Final = 1e-3
_TITLES: Final = {Case.COLD: "from the scene's text on", Case.EDITED: "from a small edit on"}


def has_plots() -> bool:
    """Whether there is what draws them."""
    return find_spec("matplotlib") is not None


def plot_name(scene: str, case: Case) -> str:
    """The file of a plot."""
    return f"{scene}_{case}.svg"


def plot_trials(trials: list[Trial], scene: str, case: Case, directory: Path) -> None:
    """Every setting as a curve, its last frame as a dot, and the front of the project's frames over all.

    Peers start over after an edit: what they take from the scene on is drawn there, too.
    """
    figure, axes = _figure()
    shown = [t for t in trials if t.scene == scene and (t.case is case or t.is_peer) and t.shots]
    told = set()
    for trial in shown:
        across = [shot.seconds for shot in trial.shots]
        up = [max(shot.error, _LEAST_ERROR) for shot in trial.shots]
        colour = _COLOURS.get(trial.renderer, "C9")
        label = None if trial.renderer in told else trial.renderer
        told.add(trial.renderer)
        axes.plot(across, up, color=colour, linewidth=1.0, alpha=0.75, label=label)
        axes.plot(across[-1:], up[-1:], "o", color=colour, markersize=4)
    best = front(shot for trial in shown if not trial.is_peer for shot in trial.shots)
    axes.step(
        [shot.seconds for shot in best],
        [max(shot.error, _LEAST_ERROR) for shot in best],
        "r--",
        where="post",
        linewidth=1.6,
        label="Pareto front of halflight",
    )
    for goal in GOALS:
        axes.axhline(goal, color="0.8", linewidth=0.7, zorder=0)
    axes.set_xlabel("seconds")
    axes.set_ylabel("relative RMS luminance error")
    axes.set_ylim(_LEAST_ERROR, 1.2)
    axes.set_title(f"{scene}, 640x480, {_TITLES[case]}", fontsize="medium")
    axes.legend(fontsize="x-small", loc="lower left")
    _save(figure, directory / plot_name(scene, case))


def plot_scaling(found: list[Any], directory: Path) -> None:
    """Time and memory of the figures `Size`, a file for each."""
    sizes: list[Size] = found
    families = sorted({size.family for size in sizes})
    figure, axes = _figure()
    for number, family in enumerate(families):
        known = [size for size in sizes if size.family == family]
        for name, style, values in (
            ("first frame", ":", [s.first_frame for s in known]),
            ("solved to 5 %", "-", [s.solved for s in known]),
            ("vpl to 10 %", "--", [s.virtual for s in known]),
        ):
            points = [(s.polygons, v) for s, v in zip(known, values, strict=True) if v is not None]
            if points:
                axes.plot(
                    *zip(*points, strict=True), f"C{number}o{style}", markersize=3, label=f"{family}: {name}"
                )
    axes.set_xlabel("polygons")
    axes.set_ylabel("seconds")
    axes.legend(fontsize="x-small")
    _save(figure, directory / "scaling_time.svg")
    figure, axes = _figure()
    for number, family in enumerate(families):
        known = [size for size in sizes if size.family == family]
        axes.plot(
            [s.polygons for s in known], [s.memory for s in known], f"C{number}o-", markersize=3, label=family
        )
    axes.set_xlabel("polygons")
    axes.set_ylabel("MB at most")
    axes.legend(fontsize="x-small")
    _save(figure, directory / "scaling_memory.svg")


def _figure() -> tuple[Figure, Axes]:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.0, 4.6), layout="constrained")
    axes = figure.subplots()
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.grid(alpha=0.25)
    return figure, axes


def _save(figure: Figure, file: Path) -> None:
    """The same figures give the same file."""
    import matplotlib as mpl

    with mpl.rc_context({"svg.hashsalt": "halflight", "svg.fonttype": "none"}):
        figure.savefig(file, metadata={"Date": None})
