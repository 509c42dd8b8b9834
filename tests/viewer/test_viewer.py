"""The viewer in a real browser: it loads, orbits, edits, undoes, and comes back when the service does."""

from __future__ import annotations

import json
import re
import socket
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, expect, sync_playwright

from tests.engine.scenes import box_document
from tests.service.apps import Served, serving
from tests.service.test_server import running
from tests.viewer.browser import ARTEFACTS, PATIENCE, Viewer, chromium, viewing


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with sync_playwright() as playwright:
        browser = chromium(playwright)
        expect.set_options(timeout=PATIENCE)
        yield browser
        browser.close()


@pytest.fixture(scope="module")
def service() -> Iterator[Served]:
    with serving(pool_size=1) as http:
        yield Served(http)


@pytest.fixture
def viewer(browser: Browser, service: Served) -> Iterator[Viewer]:
    with viewing(browser, f"{service.http.base_url}/") as viewer:
        yield viewer


def session_of(viewer: Viewer) -> str:
    """The path of the session that the page shows."""
    viewer.page.wait_for_url(re.compile("#session="))
    found = re.search(r"#session=(\w+)", viewer.page.url)
    assert found is not None
    return f"/v1/sessions/{found[1]}"


def scene_of(service: Served, path: str) -> dict[str, Any]:
    objects = service.http.get(f"{path}/scene").json()["scene"]["objects"]
    return {found["id"]: found for found in objects}


def test_it_shows_a_scene_that_converges_and_follows_the_pointer(viewer: Viewer, service: Served) -> None:
    viewer.open()
    viewer.settle()
    page = viewer.page
    expect(page.locator("#state")).to_contain_text("Converged to 2 %")
    assert page.locator("#curve .error").count() == 1
    viewer.keep("converged")
    before = page.url
    viewer.drag((0.8, 0.4), (0.6, 0.45))
    viewer.settle()
    page.wait_for_url(lambda url: url != before)
    moving = re.search(r'stream_frames_total{quality="moving"} (\d+)', service.http.get("/metrics").text)
    assert moving is not None
    assert int(moving[1]) > 0
    eye = page.url
    page.keyboard.down("w")
    page.wait_for_timeout(300)
    page.keyboard.up("w")
    page.keyboard.press("ArrowLeft")
    page.mouse.wheel(0, 200)
    page.wait_for_url(lambda url: url != eye)
    # A link restores session and camera.
    viewer.settle()
    page.wait_for_timeout(400)
    shared = page.url
    page.reload()
    viewer.settle()
    assert page.url == shared


def test_what_is_clicked_can_be_moved_painted_undone_and_deleted(viewer: Viewer, service: Served) -> None:
    viewer.open()
    viewer.settle()
    page, path = viewer.page, session_of(viewer)
    viewer.click(0.4, 0.55)
    viewer.await_state(selected="tall_block")
    assert page.input_value("#objects") == "tall_block"
    before = scene_of(service, path)["tall_block"].get("transform", {})
    # By the arrow up, which begins at the middle of the block.
    viewer.drag((0.41, 0.59), (0.41, 0.4))
    viewer.rest()
    viewer.keep("moved")
    moved = scene_of(service, path)["tall_block"]["transform"]["translation"]
    assert moved[1] > 0.02
    assert moved[0] == moved[2] == 0.0
    # However many steps it was seen in, the drag is one deed.
    with viewer.one_revision():
        page.click("#undo")
    assert scene_of(service, path)["tall_block"].get("transform", {}) == before
    expect(page.locator("#log")).to_contain_text("tall_block")
    viewer.settle()
    viewer.await_state(unsettled="0")

    def emission() -> float:
        return float(max(scene_of(service, path)["tall_block"]["material"].get("emission", [0.0])))

    with viewer.one_revision():
        page.fill("#emission", "5")
        page.press("#emission", "Tab")
    assert emission() == 5.0
    page.focus("#over")
    with viewer.one_revision():
        page.keyboard.press("Control+z")
    assert emission() == 0.0
    with viewer.one_revision():
        page.keyboard.press("Control+Shift+Z")
    assert emission() == 5.0

    page.click("#add-box")
    viewer.await_state(selected="box_1")
    page.focus("#over")
    with viewer.one_revision():
        page.keyboard.press("Delete")
    viewer.await_state(selected="")
    assert "box_1" not in scene_of(service, path)
    page.click("#add-lamp")
    viewer.await_state(selected="lamp_1")
    viewer.settle()
    viewer.keep("lamp")


OVERLAYS = (
    "mesh", "links", "discontinuities", "triangulation", "samples", "graph", "probe", "backprojection"
)  # fmt: skip


@pytest.mark.slow
def test_overlays_and_false_colours_show(viewer: Viewer) -> None:
    viewer.open()
    viewer.settle()
    page = viewer.page
    viewer.click(0.5, 0.95)
    viewer.await_state(selected="floor")
    for name in OVERLAYS:
        page.check(f"#overlay-{name}")
        expect(page.locator(f"#note-{name}")).to_have_text(re.compile(r"^[\d,]+( of [\d,]+)?$"))
        page.wait_for_timeout(100)
        viewer.keep(f"overlay-{name}")
        page.uncheck(f"#overlay-{name}")
    page.select_option("#layer", "false_colour")
    expect(page.locator("#legend")).to_be_visible()
    page.fill("#scale", "500")
    page.press("#scale", "Tab")
    expect(page.locator("#legend li").last).to_have_text("500")
    viewer.settle()
    viewer.keep("false-colour")


@pytest.mark.slow
def test_a_file_is_opened_and_bad_ones_say_what_is_wrong(viewer: Viewer, tmp_path: Path) -> None:
    viewer.open()
    page = viewer.page
    scene = tmp_path / "box.json"
    scene.write_text(json.dumps(box_document()))
    page.set_input_files("#file", scene)
    expect(page.locator("#objects option")).to_have_text(["Nothing selected", "floor", "lamp", "crate"])
    viewer.settle()
    assert page.locator("#cameras option").count() == 3
    page.select_option("#cameras", "side")
    bad = tmp_path / "bad.json"
    bad.write_text("{")
    page.set_input_files("#file", bad)
    expect(page.locator("#problem")).to_contain_text("bad.json")


@pytest.mark.slow
def test_it_reads_well_on_a_phone_and_in_the_dark(browser: Browser, service: Served) -> None:
    with viewing(browser, f"{service.http.base_url}/", (390, 844), "dark") as viewer:
        viewer.open()
        viewer.settle()
        page = viewer.page
        assert page.evaluate("() => document.documentElement.scrollWidth") <= 390
        ground = page.evaluate("() => getComputedStyle(document.body).backgroundColor")
        assert max(int(part) for part in re.findall(r"\d+", ground)[:3]) < 60
        viewer.keep("phone-dark")
        page.locator("#picture").scroll_into_view_if_needed()
        viewer.page.screenshot(path=ARTEFACTS / "phone-dark-all.png", full_page=True)


def test_keys_reach_everything(viewer: Viewer) -> None:
    viewer.open()
    page = viewer.page
    page.focus("#sample")
    reached = []
    for _ in range(45):
        page.keyboard.press("Tab")
        reached.append(page.evaluate("() => document.activeElement.id"))
    wanted = {
        "undo",
        "share",
        "help-open",
        "over",
        "tolerance",
        "add-box",
        "objects",
        "renderer",
        "overlay-mesh",
        "log",
    }
    assert wanted <= set(reached)
    unnamed = page.evaluate("""() => [...document.querySelectorAll("input, select, button")]
        .filter(({ labels, ariaLabel, textContent }) => !labels?.length && !ariaLabel && !textContent.trim())
        .map(({ id }) => id)""")
    assert unnamed == []
    page.focus("#over")
    page.keyboard.press("?")
    expect(page.locator("#help")).to_be_visible()
    page.keyboard.press("Escape")
    expect(page.locator("#help")).to_be_hidden()


@pytest.mark.slow
def test_a_session_that_is_gone_is_told_and_opened_anew(browser: Browser, service: Served) -> None:
    with viewing(browser, f"{service.http.base_url}/", may_be_lost=True) as viewer:
        viewer.open()
        path, page = session_of(viewer), viewer.page
        assert service.http.delete(path).status_code == 204
        expect(page.locator("#problem")).to_contain_text("This session is gone")
        viewer.keep("gone")
        page.click("#restart")
        expect(page.locator("#problem")).to_be_hidden()
        viewer.await_state(connection="open")
        viewer.settle()
        assert session_of(viewer) != path


@pytest.mark.slow
def test_it_comes_back_when_the_service_does(browser: Browser, tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = str(free.getsockname()[1])
    place = {"HALFLIGHT_PORT": port, "HALFLIGHT_DATA_DIR": str(tmp_path)}
    with viewing(browser, f"http://127.0.0.1:{port}/", may_be_lost=True) as viewer:
        page = viewer.page
        with running(**place):
            viewer.open()
            viewer.settle()
            path = session_of(viewer)
        expect(page.locator("#banner")).to_contain_text("Trying again")
        viewer.keep("lost")
        viewer.await_state(connection="waiting")
        with running(**place) as service:
            viewer.await_state(connection="open")
            expect(page.locator("#banner")).to_be_hidden()
            viewer.settle()
            assert session_of(viewer) == path
            assert service.http.get(path).status_code == 200
