"""The report's measurements as sections of `make bench`, in a quick and in a full form."""

from __future__ import annotations

from typing import Any, Final

from benchmarks.plan import Job, Options, Section
from benchmarks.report.front import GOALS, told
from benchmarks.report.halls import FAMILIES
from benchmarks.report.ours import TOLERANCES, measure_cold, measure_edited
from benchmarks.report.peers import DENOISED, RAW, measure_peer
from benchmarks.report.plots import plot_scaling
from benchmarks.report.scaling import TOLERANCE, VPL_ERROR, Size, exponent, measure_size
from benchmarks.report.telling import memory_text, seconds_text, text_of
from benchmarks.report.trials import Case, Ending, Trial, Trials
from benchmarks.tables import Row, Table, percent
from solver.engine.requests import RendererName

LIMIT: Final = 60.0
"""Seconds of one measurement in the full form"""

_SCALING_LIMIT: Final = 30.0
"""Of each of the two that are measured of one size"""

QUICK_LIMIT: Final = 6.0
QUICK_SCENES: Final = ("cornell", "office")

_SOLVED: Final = (RendererName.INTERPOLANT, RendererName.GOURAUD)
_QUICK_TOLERANCES: Final = (0.08, 0.04, 0.02)
_QUICK_RENDERERS: Final = (*_SOLVED, RendererName.VPL)
_QUICK_SIZES: Final = 700
"""Polygons, at most"""

_SAMPLED_SHARE: Final = 0.5
"""Of the limit for what is never finished"""

_GATHERED: Final = (0.04,)
"""Of frames that take longest to draw, whatever their setting"""


def cold(options: Options) -> Section:
    """Frames from a scene's text on."""
    jobs = []
    for scene in _scenes(options):
        for renderer in _QUICK_RENDERERS if options.quick else tuple(RendererName):
            tolerances = _GATHERED if renderer == RendererName.GATHER else TOLERANCES
            chosen = _QUICK_TOLERANCES if options.quick else tolerances
            arguments = (scene, renderer.value, chosen, _limit_of(renderer, options))
            jobs.append(Job(f"{scene}, {renderer}", measure_cold, arguments))
    return Section("cold", tuple(jobs), tabulate_cold)


def edited(options: Options) -> Section:
    """Frames after a small edit. Path tracing starts over, and so has nothing of its own here."""
    jobs = []
    for scene in _scenes(options):
        for renderer in (RendererName.INTERPOLANT, RendererName.GOURAUD, RendererName.VPL):
            chosen = _QUICK_TOLERANCES[1:] if options.quick else TOLERANCES[1:]
            if options.quick and renderer != RendererName.INTERPOLANT:
                continue
            arguments = (scene, renderer.value, chosen, _limit_of(renderer, options))
            jobs.append(Job(f"{scene}, {renderer}", measure_edited, arguments))
    return Section("edited", tuple(jobs), tabulate_edited)


def peers(options: Options) -> Section:
    """Mitsuba 3, denoised and raw."""
    limit = QUICK_LIMIT if options.quick else LIMIT
    jobs = (
        Job(f"{scene}, {DENOISED if is_denoised else RAW}", measure_peer, (scene, is_denoised, limit))
        for scene in _scenes(options)
        for is_denoised in (True, False)
    )
    return Section("peers", tuple(jobs), tabulate_peers)


def scaling(options: Options) -> Section:
    """Scenes of ever more polygons."""
    limit = QUICK_LIMIT if options.quick else _SCALING_LIMIT
    jobs = (
        Job(f"{family.name}, {size:,} polygons", measure_size, (family.name, size, limit))
        for family in FAMILIES.values()
        for size in family.sizes
        if not options.quick or size <= _QUICK_SIZES
    )
    return Section("scaling", tuple(jobs), tabulate_scaling, plot_scaling)


def _scenes(options: Options) -> tuple[str, ...]:
    return tuple(s for s in options.scenes if not options.quick or s in QUICK_SCENES)


def _limit_of(renderer: RendererName, options: Options) -> float:
    limit = QUICK_LIMIT if options.quick else LIMIT
    never_ends = renderer in (RendererName.VPL, RendererName.PATH)
    return _SAMPLED_SHARE * limit if never_ends else limit


def tabulate_cold(found: list[Trials]) -> Table:
    """One row a setting."""
    return _tabulate(found, "From a scene to its frames", Case.COLD)


def tabulate_edited(found: list[Trials]) -> Table:
    """One row a setting."""
    return _tabulate(found, "From a small edit to its frames", Case.EDITED)


def tabulate_peers(found: list[Trials]) -> Table:
    """One row a peer."""
    missing = {one.missing for one in found} - {""}
    if missing:
        return Table("Peers", ("peers",), (), f"Peers are {'; '.join(sorted(missing))}.")
    return _tabulate(found, "Peers from a scene to their frames", Case.COLD)


def _tabulate(found: list[Trials], title: str, case: Case) -> Table:
    trials = [trial for one in found for trial in one.trials]
    return Table(
        title,
        (
            "scene", "renderer", "setting", "first frame", "its error",
            *(f"to {percent(g, 0)}" for g in GOALS), "last frame", "its error", "peak MB",
        ),
        tuple(Row(_cells(trial)) for trial in trials if trial.case is case),
        "Seconds of wall time. Last frame: the finished one, unless time was up (…). ~: extrapolated by "
        "1 / sqrt(samples). >: not reached by then. -: not reached.",
        names=3,
    )  # fmt: skip


def _cells(trial: Trial) -> tuple[str, ...]:
    if not trial.shots:
        # Such a renderer has nothing to show until it is done.
        shown = ("-",) * (len(GOALS) + 2)
        return trial.scene, trial.renderer, trial.setting, *shown, "…", "-", memory_text(trial.peak_memory)
    first, last = trial.shots[0], trial.shots[-1]
    return (
        trial.scene,
        trial.renderer,
        trial.setting,
        seconds_text(first.seconds),
        percent(first.error, 1),
        *(text_of(told([trial], goal)) for goal in GOALS),
        seconds_text(last.seconds) + (" …" if trial.ending is Ending.TIME else ""),
        percent(last.error),
        memory_text(trial.peak_memory),
    )


def tabulate_scaling(found: list[Size]) -> Table:
    """One row a scene, and one of exponents a family."""
    rows = []
    for family in FAMILIES:
        sizes = [size for size in found if size.family == family]
        if not sizes:
            continue
        rows += [Row(_size_cells(size)) for size in sizes]
        rows.append(Row((family, "exponent", *_exponents(sizes))))
    return Table(
        "Time and memory against polygons",
        (
            "scenes", "polygons", "patches", "light", "first frame", f"to {percent(TOLERANCE, 0)}",
            "elements", "links", f"vpl to {percent(VPL_ERROR, 0)}", "MB",
        ),
        tuple(rows),
        "Seconds of wall time from the scene in memory on; errors are estimates of the solver and of the "
        "virtual lights. -: time was up. Exponents: of power laws through what points there are, if three.",
        names=1,
    )  # fmt: skip


def _size_cells(size: Size) -> tuple[str, ...]:
    solved = "-" if size.solved is None else seconds_text(size.solved)
    return (
        size.family,
        f"{size.polygons:,}",
        f"{size.patches:,}",
        "linked" if size.is_linked else "sampled",
        seconds_text(size.first_frame),
        solved if size.solved is not None else f"- ({percent(size.estimate, 0)} then)",
        f"{size.elements:,}",
        f"{size.links:,}",
        "-" if size.virtual is None else seconds_text(size.virtual),
        memory_text(size.memory),
    )


def _exponents(sizes: list[Size]) -> tuple[str, ...]:
    polygons = [size.polygons for size in sizes]

    def told(values: list[Any]) -> str:
        found = exponent(polygons, values)
        return "" if found is None else f"{found.value:.2f}"

    return (
        "",
        "",
        told([s.first_frame for s in sizes]),
        told([s.solved for s in sizes]),
        told([float(s.elements) for s in sizes]),
        told([float(s.links) if s.is_linked else None for s in sizes]),
        told([s.virtual for s in sizes]),
        told([s.memory for s in sizes]),
    )
