"""`halflight info`: what this machine renders with."""

from __future__ import annotations

import platform
from importlib.metadata import PackageNotFoundError, version
from typing import Final

import typer

from halflight.console import project_version

_PACKAGES: Final = (
    "numpy", "numba", "embreex", "mapbox_earcut", "shapely", "moderngl", "pillow", "OpenEXR", "OpenImageIO",
    "pydantic", "fastapi", "uvicorn",
)  # fmt: skip


def info() -> None:
    """Tell what this machine renders with: OpenGL, Embree, cores, versions."""
    from solver.parallel import core_count
    from solver.visibility.rays import embree_version

    for name, value in (
        ("halflight", project_version()),
        *_opengl(),
        ("Embree", embree_version()),
        ("cores", str(core_count())),
        ("Python", f"{platform.python_version()} ({platform.python_implementation()})"),
        ("system", platform.platform()),
        *((name, _package(name)) for name in _PACKAGES),
    ):
        typer.echo(f"{name:16}{value}")


def _opengl() -> list[tuple[str, str]]:
    """The driver, or why there is none: everything but frames works without."""
    from solver.errors import RenderingUnavailableError
    from solver.rendering.device import GlDevice

    try:
        device = GlDevice()
    except RenderingUnavailableError as unavailable:
        return [("OpenGL", f"not available. {unavailable}")]
    found = device.info
    device.release()
    return [("OpenGL", found.version), ("GL renderer", found.renderer), ("GL vendor", found.vendor)]


def _package(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed"
