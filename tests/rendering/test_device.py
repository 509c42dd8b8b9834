"""The device: its thread, its end, and machines without one."""

from __future__ import annotations

import os
import subprocess
import sys
import threading

import pytest

from solver.rendering.device import DeviceUseError, GlDevice
from solver.rendering.renderer import FrameRenderer

PROBE = """
from solver.errors import RenderingUnavailableError
from solver.rendering.device import GlDevice
try:
    GlDevice()
except RenderingUnavailableError as told:
    print(told)
"""


@pytest.mark.parametrize(
    ("variable", "value", "reason"),
    [
        ("__EGL_VENDOR_LIBRARY_FILENAMES", "/nowhere.json", "found 0 devices"),
        ("GLCONTEXT_LINUX_LIBEGL", "/nowhere/libEGL.so", "/nowhere/libEGL.so not loaded"),
        ("MESA_GL_VERSION_OVERRIDE", "3.3", "eglCreateContext failed"),
    ],
    ids=["no driver", "no library", "too old"],
)
def test_machine_without_a_context_gets_one_sentence(variable: str, value: str, reason: str) -> None:
    done = subprocess.run(
        [sys.executable, "-c", PROBE],
        env={**os.environ, variable: value},
        capture_output=True,
        text=True,
        check=True,
    )
    (sentence,) = done.stdout.splitlines()
    assert sentence.startswith("Rendering needs OpenGL 4.3 through EGL: install Mesa with 'apt-get install")
    assert reason in sentence


def test_device_says_what_it_is(device: GlDevice) -> None:
    assert device.info.vendor
    assert device.info.renderer
    assert float(device.info.version[:3]) >= 4.3
    assert min(device.largest_frame) >= 4096


def test_other_threads_are_refused(device: GlDevice) -> None:
    failures: list[BaseException] = []

    def use() -> None:
        for call in (lambda: FrameRenderer(device), device.release):
            try:
                call()
            except DeviceUseError as failure:
                failures.append(failure)

    thread = threading.Thread(target=use)
    thread.start()
    thread.join()
    assert [str(failure) for failure in failures] == [
        "An OpenGL device can only be used by the thread that made it"
    ] * 2


def test_released_device_is_refused_and_leaves_others_alone(device: GlDevice) -> None:
    other = GlDevice()
    other.release()
    other.release()
    with pytest.raises(DeviceUseError, match="has been released"):
        FrameRenderer(other)
    FrameRenderer(device).release()


def test_each_thread_can_have_its_own_device() -> None:
    told: list[str] = []

    def make() -> None:
        made = GlDevice()
        FrameRenderer(made).release()
        told.append(made.info.version)
        made.release()

    threads = [threading.Thread(target=make) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(told) == 2
