"""`halflight convert`: a scene file of one format becomes one of another."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from halflight.console import ExitCode, fail
from halflight.loading import load

if TYPE_CHECKING:
    from solver.geometry.scene import Scene


class Up(StrEnum):
    """An axis that is up."""

    Y = "y"
    Z = "z"


def convert(
    scene: Annotated[str, typer.Argument(help="A scene file, or a sample's name.", metavar="SCENE")],
    output: Annotated[
        Path, typer.Argument(help="Where it goes: .json, a scene document, or .glb.", metavar="OUTPUT")
    ],
    scale: Annotated[float, typer.Option(min=1e-9, max=1e9, help="Metres of one unit of SCENE.")] = 1.0,
    up: Annotated[
        Up | None, typer.Option(help="Axis that is up, where there is no camera.", show_default="by format")
    ] = None,
    two_sided: Annotated[
        bool | None,
        typer.Option(help="Whether surfaces of OBJ and STL have two sides.", show_default="by format"),
    ] = None,
    merge: Annotated[
        bool, typer.Option(help="Make triangles in one plane one polygon.")
    ] = True,
) -> None:  # fmt: skip
    """Read SCENE (.json .glb .gltf .obj .stl .mgf .ies .zip) and write it as OUTPUT.

    Exit status: 0 done; 1 it cannot be written; 2 an input is not acceptable.
    """
    from solver.document.limits import SceneLimits
    from solver.formats.source import ReadOptions, UpAxis

    suffix = output.suffix.lower()
    if suffix not in {".json", ".glb"}:
        fail(f"{output} ends in none of .json .glb", ExitCode.BAD_INPUT)
    options = ReadOptions(
        scale=scale,
        up=None if up is None else UpAxis(up.value),
        two_sided=two_sided,
        merge=merge,
        limits=SceneLimits(max_polygons=2**31, max_vertices=2**31),
    )
    found = load(scene, options)
    try:
        output.write_bytes(_content(found, suffix))
    except OSError as refused:
        fail(f"cannot write {output}: {(refused.strerror or str(refused)).lower()}", ExitCode.UNABLE)
    polygons = sum(len(each.mesh.faces) for each in found)
    typer.echo(f"{output}: {len(found.objects)} objects, {polygons} polygons, {len(found.cameras)} cameras")


def _content(scene: Scene, suffix: str) -> bytes:
    from solver.document.conversion import document_of
    from solver.formats.gltf.writer import scene_glb

    if suffix == ".glb":
        return scene_glb(scene, {})
    return document_of(scene).model_dump_json(exclude_unset=True).encode()
