from __future__ import annotations

from collections.abc import Iterator

import pytest

from solver.rendering.device import GlDevice
from solver.rendering.renderer import FrameRenderer


@pytest.fixture(scope="package")
def device() -> Iterator[GlDevice]:
    made = GlDevice()
    yield made
    made.release()


@pytest.fixture(scope="package")
def renderer(device: GlDevice) -> Iterator[FrameRenderer]:
    made = FrameRenderer(device)
    yield made
    made.release()
