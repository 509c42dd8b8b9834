"""The curves of edits as pictures, [G figures 6 and 7] again: error against time, shots and rays."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from benchmarks.edit_curves import Curve, Sample

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from benchmarks.edits import EditFigures

_ACROSS: Final[tuple[tuple[str, Callable[[Sample], float]], ...]] = (
    ("CPU time, s", lambda sample: sample.work.cpu),
    ("pairs of elements or links shot over", lambda sample: sample.work.pairs),
    ("rays", lambda sample: sample.work.rays),
)
_DOWN: Final[tuple[tuple[str, Callable[[Sample], float]], ...]] = (
    ("error", lambda sample: sample.error.everywhere),
    ("error of the 1 % that changes most", lambda sample: sample.error.where_most),
)


def plot_edits(found: list[Any], directory: Path) -> None:
    """Write a PNG for each edit of each of the figures `SceneEdits`."""
    from matplotlib.figure import Figure

    for figures in (one for scene in found for one in scene.edits):
        picture = Figure(figsize=(13.0, 7.0), layout="constrained")
        axes = picture.subplots(len(_DOWN), len(_ACROSS), sharey="row", sharex="col", squeeze=False)
        for row, (name, error) in zip(axes, _DOWN, strict=True):
            for cell, (_, work) in zip(row, _ACROSS, strict=True):
                _draw(cell, figures, work, error)
            row[0].set_ylabel(name)
        for cell, (name, _) in zip(axes[-1], _ACROSS, strict=True):
            cell.set_xlabel(name)
        axes[0, 0].legend(fontsize="small")
        told = f"tolerance {100.0 * figures.tolerance:g} %"
        picture.suptitle(
            f"{figures.edit.scene}: {figures.edit.label}, on {figures.elements:,} elements, {told}"
        )
        name = f"{figures.edit.scene} {figures.edit.label} {100.0 * figures.tolerance:g}".replace(" ", "_")
        picture.savefig(directory / f"{name}.png", dpi=110)


def _draw(
    axes: Axes, figures: EditFigures, work: Callable[[Sample], float], error: Callable[[Sample], float]
) -> None:
    """One curve a method, of all samples at which some work of that kind has been done."""
    for number, curve in enumerate(figures.curves):
        across, up = _points(curve, work, error)
        if across:
            axes.plot(across, up, f"C{number}", label=curve.method.replace("_", " "))
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.grid(alpha=0.3)


def _points(
    curve: Curve, work: Callable[[Sample], float], error: Callable[[Sample], float]
) -> tuple[list[float], list[float]]:
    there = [sample for sample in curve.samples if work(sample) > 0]
    return [float(work(sample)) for sample in there], [error(sample) for sample in there]
