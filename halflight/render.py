"""`halflight render`: a scene file becomes a picture file, without a server."""

from __future__ import annotations

import math
import time
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from halflight.console import ExitCode, fail, progress_bar, warn
from halflight.loading import load

if TYPE_CHECKING:
    from halflight.pictures import Picture
    from solver.engine.requests import CameraChoice

_SLICE: Final = 0.05
"""Seconds of work between two looks at the progress."""

_MAX_SIDE: Final = 16384
"""Pixels across or down a picture."""


class Renderer(StrEnum):
    """How the picture is made."""

    FLAT = "flat"
    GOURAUD = "gouraud"
    INTERPOLANT = "interpolant"
    VPL = "vpl"
    GATHER = "gather"
    PATH = "path"


class Layer(StrEnum):
    """What the picture shows."""

    RADIANCE = "radiance"
    IRRADIANCE = "irradiance"
    ILLUMINANCE = "illuminance"
    DEPTH = "depth"
    POSITION = "position"
    NORMAL = "normal"
    OBJECT = "object"
    ELEMENT = "element"
    TRIANGLE = "triangle"
    BARYCENTRIC = "barycentric"
    ERROR = "error"
    FALSE_COLOUR = "false_colour"


class ToneMap(StrEnum):
    """The curve from radiance to brightness."""

    LINEAR = "linear"
    REINHARD = "reinhard"
    FILMIC = "filmic"


def render(
    scene: Annotated[str, typer.Argument(help="A scene file, or a sample's name.", metavar="SCENE")],
    output: Annotated[
        Path,
        typer.Option(
            "--output", "-o",
            help="Where the picture goes. Its suffix says the format: .png .jpg .webp are tone-mapped, "
            ".exr .hdr .npy hold linear values.",
        ),
    ],
    renderer: Annotated[Renderer, typer.Option(help="How the picture is made.")] = Renderer.INTERPOLANT,
    layer: Annotated[Layer, typer.Option(help="What it shows.")] = Layer.RADIANCE,
    camera: Annotated[str | None, typer.Option(help="A camera of the scene.", show_default="main")] = None,
    eye: Annotated[str | None, typer.Option(help="Where the camera stands.", metavar="X,Y,Z")] = None,
    target: Annotated[str | None, typer.Option(help="The point it looks at.", metavar="X,Y,Z")] = None,
    up: Annotated[str | None, typer.Option(help="The direction that is up.", metavar="X,Y,Z")] = None,
    fov: Annotated[
        float | None, typer.Option(min=1e-3, max=179.9, help="Vertical angle of view, degrees.")
    ] = None,
    width: Annotated[int | None, typer.Option(min=1, max=_MAX_SIDE, help="Pixels across.")] = None,
    height: Annotated[int | None, typer.Option(min=1, max=_MAX_SIDE, help="Pixels down.")] = None,
    tolerance: Annotated[
        float, typer.Option(min=1e-5, max=1.0, help="Relative error of the light, or noise of the paths.")
    ] = 0.02,
    samples: Annotated[
        int | None,
        typer.Option(
            min=1, max=65536,
            help="Samples of a pixel, against jagged edges. With --renderer path: paths of a pixel, "
            "in place of the tolerance.",
            show_default="4",
        ),
    ] = None,
    exposure: Annotated[str, typer.Option(help="Stops, or auto.")] = "auto",
    tone_map: Annotated[ToneMap, typer.Option(help="Curve from radiance to brightness.")] = ToneMap.FILMIC,
) -> None:  # fmt: skip
    """Solve the light in SCENE and write a picture of it.

    Sample scenes: cornell, cube_room, office, robot_cell.

    Exit status: 0 done; 1 this machine cannot do it; 2 an input is not acceptable; 3 the picture is
    written, but a limit ended the solve before the tolerance.
    """
    from halflight.pictures import InstantPicture, PathPicture, RadiosityPicture
    from solver.engine.drawing import Drawing, encode
    from solver.engine.requests import Encoding, FrameRequest, LayerName, NotAvailableError, RendererName
    from solver.errors import LimitExceededError, RenderingUnavailableError, SceneError
    from solver.rendering.encoding import LinearFormat, PictureFormat
    from solver.rendering.tone_mapping import ToneCurve

    start = time.perf_counter()
    formats: dict[str, PictureFormat | LinearFormat] = {
        ".png": PictureFormat.PNG,
        ".jpg": PictureFormat.JPEG,
        ".jpeg": PictureFormat.JPEG,
        ".webp": PictureFormat.WEBP,
        ".exr": LinearFormat.EXR,
        ".hdr": LinearFormat.HDR,
        ".npy": LinearFormat.NPY,
    }
    suffix = output.suffix.lower()
    if suffix not in formats:
        fail(f"--output: {output} ends in none of {' '.join(formats)}", ExitCode.BAD_INPUT)
    if not output.parent.is_dir():
        fail(f"--output: there is no directory {output.parent}", ExitCode.BAD_INPUT)
    encoding = Encoding(formats[suffix], _exposure(exposure), ToneCurve(tone_map.value))
    choice = _camera_choice(camera, eye, target, up, fov, width, height)
    request = FrameRequest(choice, RendererName(renderer.value), LayerName(layer.value), samples or 4)
    try:
        loaded = load(scene)
        picture: Picture
        if renderer is Renderer.PATH:
            if layer is not Layer.RADIANCE:
                fail("--layer: paths show radiance alone", ExitCode.BAD_INPUT)
            picture = PathPicture(loaded, request, tolerance, samples)
        else:
            drawing = Drawing()
            if drawing.problem is not None:
                fail(drawing.problem, ExitCode.UNABLE)
            made = InstantPicture if renderer is Renderer.VPL else RadiosityPicture
            picture = made(loaded, request, tolerance, drawing)
        _work(picture, tolerance)
        content = encode(picture.draw(), request.layer, encoding)
    except SceneError as refused:
        # The scene has been read: what is refused is how it is to be looked at.
        fail(f"--{refused}", ExitCode.BAD_INPUT)
    except NotAvailableError as refused:
        fail(f"--layer: {refused}", ExitCode.BAD_INPUT)
    except LimitExceededError as refused:
        fail(str(refused), ExitCode.BAD_INPUT)
    except RenderingUnavailableError as refused:
        fail(str(refused), ExitCode.UNABLE)
    try:
        output.write_bytes(content)
    except OSError as refused:
        fail(f"cannot write {output}: {refused.strerror}", ExitCode.UNABLE)
    for warning in picture.warnings:
        warn(warning)
    typer.echo(
        f"{output}: error estimate {picture.error_estimate:.2%}, {picture.summary}, "
        f"{time.perf_counter() - start:.1f} s"
    )
    if not picture.converged:
        raise typer.Exit(ExitCode.NOT_REACHED)


def _camera_choice(
    name: str | None,
    eye: str | None,
    target: str | None,
    up: str | None,
    fov: float | None,
    width: int | None,
    height: int | None,
) -> CameraChoice:
    from solver.engine.requests import CameraChoice

    if up is not None and not any(_triple("--up", up)):
        fail("--up: a direction of length 0 points nowhere", ExitCode.BAD_INPUT)
    return CameraChoice(
        name=name,
        eye=None if eye is None else _triple("--eye", eye),
        target=None if target is None else _triple("--target", target),
        up=None if up is None else _triple("--up", up),
        vertical_fov=fov,
        width=width,
        height=height,
    )


def _triple(option: str, text: str) -> tuple[float, float, float]:
    try:
        x, y, z = (float(part) for part in text.split(","))
    except ValueError:
        x = y = z = math.nan
    if not (math.isfinite(x) and math.isfinite(y) and math.isfinite(z)):
        fail(f"{option}: {text!r} is not three numbers like 1,2.5,0", ExitCode.BAD_INPUT)
    return x, y, z


def _exposure(text: str) -> float | None:
    if text == "auto":
        return None
    try:
        stops = float(text)
    except ValueError:
        stops = math.nan
    if not math.isfinite(stops):
        fail(f"--exposure: {text!r} is neither a number of stops nor auto", ExitCode.BAD_INPUT)
    return stops


def _work(picture: Picture, tolerance: float) -> None:
    """Work on the picture until no more can be done, and show how far it is."""
    with progress_bar() as bar:
        task = bar.add_task("Rendering", total=1.0, note="")
        working = True
        while working:
            working = picture.step(_SLICE)
            error = picture.error_estimate
            note = f"error {error:.1%} of {tolerance:.1%}" if math.isfinite(error) else ""
            bar.update(task, completed=picture.progress, note=note)
