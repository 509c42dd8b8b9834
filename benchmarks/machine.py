"""What the figures were measured on."""

from __future__ import annotations

import os
import platform
import re
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path

from solver.errors import RenderingUnavailableError
from solver.parallel import core_count
from solver.rendering.device import GlDevice
from solver.visibility.rays import embree_version


@dataclass(frozen=True)
class Machine:
    """A machine and what runs on it."""

    processor: str
    cores: int
    """That this process may use"""
    memory: float
    """GB (10^9 bytes)"""
    load: float
    """Mean number of runnable processes over the last minute, before anything was measured"""
    system: str
    python: str
    numpy: str
    numba: str
    embree: str
    opengl: str

    @staticmethod
    def this() -> Machine:
        """The machine this runs on."""
        return Machine(
            processor=_processor(),
            cores=core_count(),
            memory=os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 1e9,
            load=os.getloadavg()[0],
            system=f"{platform.system()} {platform.release()}",
            python=platform.python_version(),
            numpy=version("numpy"),
            numba=version("numba"),
            embree=embree_version(),
            opengl=_opengl(),
        )

    def __str__(self) -> str:
        return (
            f"{self.processor}, {self.cores} cores, {self.memory:.0f} GB, load {self.load:.1f} before; "
            f"{self.system}; Python {self.python}, numpy {self.numpy}, numba {self.numba}, "
            f"Embree {self.embree}, OpenGL {self.opengl}"
        )

    def record(self) -> dict[str, object]:
        """For a file."""
        return asdict(self)


def _processor() -> str:
    found = re.search(r"(?m)^model name\s*:\s*(.+)$", Path("/proc/cpuinfo").read_text())
    return found[1].strip() if found else platform.machine()


def _opengl() -> str:
    try:
        device = GlDevice()
    except RenderingUnavailableError as unavailable:
        return f"not available ({unavailable.reason})"
    found = device.info
    device.release()
    return f"{found.version}, {found.renderer}"
