"""`halflight bake`: the light of a scene file becomes a lightmap, without a server."""

from __future__ import annotations

import time
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from halflight.console import ExitCode, fail, progress_bar, warn
from halflight.loading import load

if TYPE_CHECKING:
    from solver.engine.engine import Engine
    from solver.engine.lightmaps.bake import Bake, LightmapRequest

_SLICE: Final = 0.05
"""Seconds of work between two looks at the progress."""

_MOST_TEXELS: Final = 2**24
"""Texels of the picture."""


class Source(StrEnum):
    """Where the light comes from."""

    VPL = "vpl"
    RADIOSITY = "radiosity"


class Gathering(StrEnum):
    """How the light of a solution comes to texels."""

    AUTO = "auto"
    EXACT = "exact"
    SOLUTION = "solution"


def bake(
    scene: Annotated[str, typer.Argument(help="A scene file, or a sample's name.", metavar="SCENE")],
    output: Annotated[
        Path,
        typer.Option(
            "--output", "-o",
            help="Where the lightmap goes. Its suffix says what: .glb the scene with the picture as a "
            "texture, .exr irradiance in W/m2, .png the picture alone.",
        ),
    ],
    density: Annotated[
        float | None,
        typer.Option(min=1e-9, max=1e9, help="Texels per metre, at least.", show_default="500x500 in all"),
    ] = None,
    source: Annotated[Source, typer.Option(help="Where the light comes from.")] = Source.VPL,
    gather: Annotated[
        Gathering, typer.Option(help="With --source radiosity: gather exactly, or show the solution.")
    ] = Gathering.AUTO,
    white: Annotated[
        float | None,
        typer.Option(
            min=1e-30, max=1e30, help="W/m2 that the picture shows white.", show_default="as suits"
        ),
    ] = None,
    tolerance: Annotated[
        float, typer.Option(min=1e-5, max=1.0, help="Relative error of the light.")
    ] = 0.02,
) -> None:  # fmt: skip
    """Bake the light in SCENE into a lightmap.

    Exit status: 0 done; 1 this machine cannot do it; 2 an input is not acceptable; 3 the lightmap is
    written, but a limit ended the work before the tolerance.
    """
    from solver.document.limits import SceneLimits
    from solver.engine.engine import Engine
    from solver.engine.lightmaps.bake import Gather, LightmapRequest, LightmapSource
    from solver.engine.lightmaps.files import LightmapFormat, encode_lightmap, white_of
    from solver.engine.overlays.base import NotReadyError
    from solver.errors import SceneError
    from solver.illumination.settings import LightSettings

    start = time.perf_counter()
    formats = {f".{chosen}": chosen for chosen in LightmapFormat}
    suffix = output.suffix.lower()
    if suffix not in formats:
        fail(f"--output: {output} ends in none of {' '.join(formats)}", ExitCode.BAD_INPUT)
    if not output.parent.is_dir():
        fail(f"--output: there is no directory {output.parent}", ExitCode.BAD_INPUT)
    request = LightmapRequest(density, LightmapSource(source.value), Gather(gather.value), _MOST_TEXELS)
    unlimited = SceneLimits(max_polygons=2**31, max_vertices=2**31)
    engine = Engine(load(scene), LightSettings(error_tolerance=tolerance), unlimited)
    try:
        lightmap = _work(engine, request, tolerance).lightmap()
    except SceneError as refused:
        fail(f"--{refused}", ExitCode.BAD_INPUT)
    except NotReadyError as refused:
        fail(f"--source: {refused}", ExitCode.BAD_INPUT)
    shown = white_of(lightmap) if white is None else white
    try:
        output.write_bytes(encode_lightmap(lightmap, formats[suffix], shown))
    except OSError as refused:
        fail(f"cannot write {output}: {refused.strerror}", ExitCode.UNABLE)
    for warning in engine.status().warnings:
        warn(warning)
    atlas = lightmap.atlas
    typer.echo(
        f"{output}: error estimate {lightmap.error_estimate:.2%}, {atlas.width}x{atlas.height} texels, "
        f"{atlas.density:.4g} a metre, {lightmap.method}, white is {shown:.4g} W/m2, "
        f"{time.perf_counter() - start:.1f} s"
    )
    if not lightmap.converged:
        raise typer.Exit(ExitCode.NOT_REACHED)


def _work(engine: Engine, request: LightmapRequest, tolerance: float) -> Bake:
    """Solve where need be, and bake until no more can be done, and show how far it is."""
    with progress_bar() as bar:
        task = bar.add_task("Solving", total=1.0, note="")
        while (made := engine.bake(request)) is None:
            engine.step(_SLICE)
            bar.update(task, completed=engine.status().progress)
        bar.update(task, description="Baking", completed=0.0)
        while made.step(_SLICE):
            note = f"error {made.error_estimate:.1%} of {tolerance:.1%}"
            bar.update(task, completed=made.progress, note=note)
    return made
