"""Shaders are files in `shaders/`; each is read once."""

from __future__ import annotations

from functools import cache
from importlib import resources
from typing import Final

_HEADER: Final = "#version 430 core\n"


@cache
def load_shader(*names: str) -> str:
    """The source of a shader: the files `names`.glsl of `shaders/`, one after the other."""
    folder = resources.files("solver.rendering").joinpath("shaders")
    parts = [folder.joinpath(f"{name}.glsl").read_text(encoding="utf-8") for name in names]
    # Lines are counted anew in each file, so that a compiler's message tells the file and its line.
    return _HEADER + "\n".join(f"#line 1 {index}\n{part}" for index, part in enumerate(parts))
