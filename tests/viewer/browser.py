"""A real browser for tests of the viewer: Debian's Chromium, without a window."""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Literal

from playwright.sync_api import Browser, ConsoleMessage, Page, Playwright

ARTEFACTS = Path(__file__).resolve().parent.parent.parent / "out" / "viewer"
"""Where screenshots are kept"""

PATIENCE = 20_000
"""Milliseconds after which what should have happened has not"""

NAMES = ("chromium", "chromium-browser", "google-chrome")

LOST = re.compile(r"WebSocket connection to|ERR_CONNECTION_|ERR_EMPTY_RESPONSE|ERR_SOCKET|status of 40[49]")
"""What the browser itself says of a service that is away, or of a session that is gone"""


def chromium(playwright: Playwright) -> Browser:
    """The browser."""
    found = next((path for path in map(shutil.which, NAMES) if path), None)
    assert found is not None, "there is no Chromium: run scripts/setup.sh --dev"
    # As root, as in containers, its own sandbox cannot start; the pages are ours alone.
    return playwright.chromium.launch(executable_path=found, args=["--no-sandbox", "--disable-gpu"])


class Viewer:
    """The viewer in a page of its own."""

    def __init__(self, page: Page, address: str) -> None:
        self.page = page
        self.address = address
        self.complaints: list[str] = []
        page.on("console", self._hear)
        page.on("pageerror", lambda error: self.complaints.append(str(error)))
        page.set_default_timeout(PATIENCE)

    def _hear(self, message: ConsoleMessage) -> None:
        if message.type in {"error", "warning"}:
            self.complaints.append(message.text)

    def open(self, fragment: str = "") -> None:
        """Load the page, and wait for a frame."""
        self.page.goto(self.address + fragment)
        self.await_state(frame="")

    def await_state(self, **wanted: str) -> None:
        """Wait until the page's data are so; an empty text stands for any."""
        selector = "".join(
            f"[data-{name}]" if value == "" else f'[data-{name}="{value}"]' for name, value in wanted.items()
        )
        self.page.wait_for_selector(f"#viewer{selector}", state="attached")

    def state(self, name: str) -> str:
        """One of the page's data."""
        return self.page.get_attribute("#viewer", f"data-{name}") or ""

    def settle(self) -> None:
        """Wait until the frame of the newest revision is converged."""
        self.page.wait_for_function(
            """() => {
                const { state, converged, shown, revision, quality } = viewer.dataset;
                const isGood = state === "converged" && converged === "true";
                return isGood && quality === "rest" && shown === revision;
            }"""
        )

    def place(self, x: float, y: float) -> tuple[float, float]:
        """Pixels of the page of a place in the picture, from 0 to 1."""
        box = self.page.locator("#over").bounding_box()
        assert box is not None
        return box["x"] + x * box["width"], box["y"] + y * box["height"]

    def rest(self) -> None:
        """Wait until the newest revision is shown, and stays the newest for a while."""
        while True:
            revision = self.state("revision")
            self.page.wait_for_function("() => viewer.dataset.shown === viewer.dataset.revision")
            self.page.wait_for_timeout(500)
            if self.state("revision") == revision:
                return

    @contextmanager
    def one_revision(self) -> Iterator[None]:
        """What is done inside makes one revision, which is waited for."""
        before = int(self.state("revision"))
        yield
        self.page.wait_for_function(f"() => Number(viewer.dataset.revision) > {before}")
        assert int(self.state("revision")) == before + 1

    def drag(self, start: tuple[float, float], end: tuple[float, float], steps: int = 12) -> None:
        """Drag with the left button between two places in the picture."""
        self.page.mouse.move(*self.place(*start))
        self.page.mouse.down()
        for step in range(1, steps + 1):
            t = step / steps
            at = (start[0] + t * (end[0] - start[0]), start[1] + t * (end[1] - start[1]))
            self.page.mouse.move(*self.place(*at))
            self.page.wait_for_timeout(25)
        self.page.mouse.up()

    def click(self, x: float, y: float) -> None:
        """Click on a place in the picture."""
        self.page.mouse.click(*self.place(x, y))

    def keep(self, name: str) -> None:
        """Keep a screenshot."""
        ARTEFACTS.mkdir(parents=True, exist_ok=True)
        self.page.screenshot(path=ARTEFACTS / f"{name}.png")


@contextmanager
def viewing(
    browser: Browser,
    address: str,
    size: tuple[int, int] = (1000, 700),
    scheme: Literal["dark", "light"] = "light",
    may_be_lost: bool = False,
) -> Iterator[Viewer]:
    """The viewer in a fresh profile. What the browser complains of in the end is a failure."""
    with browser.new_context(
        viewport={"width": size[0], "height": size[1]}, color_scheme=scheme, reduced_motion="reduce"
    ) as context:
        viewer = Viewer(context.new_page(), address)
        yield viewer
        if may_be_lost:
            viewer.complaints = [text for text in viewer.complaints if not LOST.search(text)]
        assert not viewer.complaints, viewer.complaints
