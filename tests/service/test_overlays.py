"""Overlays over HTTP: JSON as described, binary glTF that loads, and what is refused."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any, Final

import numpy as np
import pygltflib
import pytest
from fastapi.testclient import TestClient
from pydantic import BaseModel

from service import overlay_schemas as schemas
from service.app import create_app
from solver.types import AnyArray
from tests.engine.showing import room_document
from tests.halflight.commands import ROOT
from tests.service.conftest import LOOSE
from tests.service.problem import fields_at_fault, problem_of

GLB: Final = "model/gltf-binary"
POINTS, LINES, TRIANGLES = 0, 1, 4

OVERLAYS: Final[dict[str, tuple[dict[str, Any], type[BaseModel]]]] = {
    "mesh": ({}, schemas.MeshAnswer),
    "links": ({}, schemas.LinksAnswer),
    "blockers": ({"link": 0}, schemas.BlockersAnswer),
    "discontinuities": ({}, schemas.DiscontinuitiesAnswer),
    "triangulation": ({}, schemas.TriangulationAnswer),
    "samples": ({}, schemas.SamplesAnswer),
    "graph": ({"triangle": 0, "kind": "difference"}, schemas.GraphAnswer),
    "probe": ({"x": 4, "y": 44}, schemas.ProbeOverlayAnswer),
    "backprojection": ({"x": 0.45, "y": 0.45, "z": 0}, schemas.BackprojectionAnswer),
}
"""What each needs, and what it is answered with"""


@pytest.fixture(scope="module")
def room(client: TestClient) -> str:
    """The path of a settled session with screens and a triangle."""
    answer = client.post("/v1/sessions", json={"scene": room_document(), "settings": LOOSE})
    path = str(answer.headers["location"])
    shown = client.get(f"{path}/overlays/triangulation", params={"wait": "converged"})
    assert shown.status_code == 200
    return path


def overlay(client: TestClient, path: str, name: str, **query: Any) -> dict[str, Any]:
    answer = client.get(f"{path}/overlays/{name}", params=OVERLAYS[name][0] | query)
    assert answer.status_code == 200, answer.text
    assert answer.headers["content-type"] == "application/json"
    OVERLAYS[name][1].model_validate_json(answer.content, strict=True)
    result: dict[str, Any] = answer.json()
    return result


def shapes(client: TestClient, path: str, name: str, **query: Any) -> dict[int, tuple[AnyArray, AnyArray]]:
    """Positions (n, 3) and colours (n, 4) of the file by mode."""
    answer = client.get(f"{path}/overlays/{name}", params=OVERLAYS[name][0] | query | {"format": "glb"})
    assert answer.status_code == 200, answer.text
    assert answer.headers["content-type"] == GLB
    file = pygltflib.GLTF2.load_from_bytes(answer.content)
    assert file.scenes[0].extras["revision"] == 1
    assert file.scenes[0].extras["units"]["length"] == "m"
    blob = file.binary_blob()

    def read(number: int) -> AnyArray:
        accessor = file.accessors[number]
        view = file.bufferViews[accessor.bufferView]
        kind, width = (np.float32, 3) if accessor.type == "VEC3" else (np.uint8, 4)
        data = np.frombuffer(blob[view.byteOffset : view.byteOffset + view.byteLength], dtype=kind)
        assert len(data) == accessor.count * width
        return data.reshape(-1, width)

    found = {}
    for mesh in file.meshes:
        for primitive in mesh.primitives:
            position, colour = read(primitive.attributes.POSITION), read(primitive.attributes.COLOR_0)
            assert len(position) == len(colour)
            bounds = file.accessors[primitive.attributes.POSITION]
            assert (position.min(axis=0).tolist(), position.max(axis=0).tolist()) == (bounds.min, bounds.max)
            found[primitive.mode] = position, colour
    return found


def test_the_list_names_every_overlay(client: TestClient, room: str) -> None:
    listed = client.get(f"{room}/overlays").json()
    schemas.OverlayList.model_validate(listed)
    assert listed["revision"] == 1
    assert [entry["name"] for entry in listed["overlays"]] == list(OVERLAYS)
    for entry in listed["overlays"]:
        assert client.get(entry["href"], params=OVERLAYS[entry["name"]][0]).status_code == 200
        assert entry["shows"]


@pytest.mark.parametrize("name", OVERLAYS)
def test_overlays_are_tables_as_described(client: TestClient, room: str, name: str) -> None:
    shown = overlay(client, room, name)
    assert (shown["overlay"], shown["revision"]) == (name, 1)
    assert shown["objects"] == [o["id"] for o in room_document()["objects"]]
    facts = {"objects", "ends"} if name == "blockers" else {"objects"}
    facts |= {"triangles", "resolution", "lines"} if name == "graph" else set()
    facts |= {"position", "normal"} if name == "backprojection" else set()
    columns = {key: value for key, value in shown.items() if isinstance(value, list) and key not in facts}
    assert {len(column) for column in columns.values()} == {shown["count"]}
    assert shown["count"] == shown["total"]


@pytest.mark.parametrize(
    ("name", "query", "expected"),
    [
        (
            "mesh", {},
            lambda s: {
                LINES: 2 * sum(s["corner_count"]), TRIANGLES: 3 * sum(n - 2 for n in s["corner_count"]),
            },
        ),
        ("links", {}, lambda s: {LINES: 2 * s["count"]}),
        ("links", {"limit": 0}, lambda s: {}),
        ("discontinuities", {}, lambda s: {LINES: 2 * s["count"]}),
        ("triangulation", {}, lambda s: {LINES: 2 * s["edges"]}),
        ("samples", {}, lambda s: {POINTS: s["count"], LINES: 2 * s["count"]}),
        ("graph", {}, lambda s: {LINES: 2 * len(s["lines"])}),
        ("probe", {}, lambda s: {POINTS: 1, LINES: 2}),
        ("backprojection", {"limit": 0}, lambda s: {POINTS: 1}),
    ],
)  # fmt: skip
def test_files_hold_the_shapes(
    client: TestClient,
    room: str,
    name: str,
    query: dict[str, Any],
    expected: Callable[[dict[str, Any]], dict[int, int]],
) -> None:
    drawn = shapes(client, room, name, **query)
    found = {mode: len(position) for mode, (position, _) in drawn.items()}
    assert found == expected(overlay(client, room, name, **query))


def test_files_have_the_colours_of_the_kinds(client: TestClient, room: str) -> None:
    links = overlay(client, room, "links")
    _, colour = shapes(client, room, "links")[LINES]
    expected = np.rint(255 * np.array(links["rgb"]))
    assert np.array_equal(colour[::2, :3], expected)
    assert np.array_equal(colour[1::2, :3], expected)
    assert np.all(colour[:, 3] == 255)
    position, _ = shapes(client, room, "links")[LINES]
    assert position == pytest.approx(np.array(links["ends"]).reshape(-1, 3), abs=1e-6)


def test_accept_decides_where_no_format_is_given(client: TestClient, room: str) -> None:
    path = f"{room}/overlays/mesh"
    answer = client.get(path, headers={"Accept": GLB})
    assert answer.content[:4] == b"glTF"
    assert (answer.headers["content-type"], answer.headers["vary"]) == (GLB, "Accept")
    assert client.get(path, headers={"Accept": "text/html, */*;q=0.1"}).json()["overlay"] == "mesh"
    assert client.get(path, params={"format": "json"}, headers={"Accept": GLB}).json()["overlay"] == "mesh"
    problem_of(client.get(path, headers={"Accept": "image/png"}), 406)


def test_limits_leave_out_and_tell_the_total(client: TestClient, room: str) -> None:
    for name in ("mesh", "links", "discontinuities", "triangulation", "samples", "graph"):
        whole = overlay(client, room, name)
        part = overlay(client, room, name, limit=2, offset=1)
        assert (part["total"], part["count"]) == (whole["total"], 2)
        key = next(key for key in ("element", "link", "discontinuity", "triangle", "sample") if key in whole)
        assert part[key] == whole[key][1:3]


def test_what_parameters_choose(client: TestClient, room: str) -> None:
    status = client.get(room).json()["statistics"]
    patches = overlay(client, room, "mesh", depth=0, colour="rho")
    assert (patches["total"], patches["colour"]) == (status["patches"], "rho")
    assert overlay(client, room, "mesh")["total"] == status["leaves"]
    counts = {
        kind: overlay(client, room, "links", kind=kind)["total"] for kind in ("full", "partial", "none")
    }
    assert counts == {kind: status[f"links_{kind}"] for kind in counts}
    assert overlay(client, room, "links", kind="plane")["total"] > 0
    active = overlay(client, room, "discontinuities", active="true")
    assert active["total"] == status["discontinuities_active"]
    idle = overlay(client, room, "discontinuities", active="false")
    assert active["total"] + idle["total"] == status["discontinuities"]
    contact = overlay(client, room, "discontinuities")
    weights = dict(zip(contact["kind"], contact["weight"], strict=True))
    assert weights["contact"] is None
    assert weights["VE"] > 0.0
    leaf = overlay(client, room, "mesh")["element"][0]
    triangles = overlay(client, room, "triangulation", element=leaf)
    assert set(triangles["element"]) == {leaf}
    assert overlay(client, room, "samples", triangle=triangles["triangle"][0])["total"] == 6
    query = {"element": leaf, "kind": "analytic", "resolution": 2, "scale": 0.25}
    graph = client.get(f"{room}/overlays/graph", params=query).json()
    assert (graph["total"], graph["height_scale"]) == (6 * triangles["total"], 0.25)


def test_probes_take_points_and_pixels(client: TestClient, room: str) -> None:
    by_pixel = overlay(client, room, "probe")
    x, y, z = by_pixel["position"][0]
    by_point = overlay(client, room, "probe", x=x, y=y, z=z)
    assert by_point["analytic"][0] == pytest.approx(by_pixel["analytic"][0])
    assert by_point["triangle"] == by_pixel["triangle"]
    picked = client.get(f"{room}/pick", params={"x": 4, "y": 44}).json()
    assert by_pixel["triangle"] == [picked["triangle"]]
    assert by_pixel["element"] == [picked["element"]]
    assert by_pixel["interpolated"][0] == pytest.approx(picked["irradiance"], rel=1e-6)


def test_the_examples_of_the_documentation_are_calls_that_there_are() -> None:
    """Their answers depend on the scene; their names do not."""
    examples = re.findall(r'"\$session(/\S*)"', (ROOT / "docs/visualizations.md").read_text())
    paths = create_app().openapi()["paths"]
    told = set()
    for example in examples:
        place, _, query = example.partition("?")
        told.add(place.rpartition("/")[2])
        parameters = {p["name"] for p in paths[f"/v1/sessions/{{id}}{place}"]["get"]["parameters"]}
        assert {pair.partition("=")[0] for pair in query.split("&")} <= parameters
    assert told == {*OVERLAYS, "pick"}


def test_backprojections_take_points_and_pixels(client: TestClient, room: str) -> None:
    lamp = overlay(client, room, "backprojection")
    assert [lamp["objects"][k] for k in lamp["object"]] == ["lamp"]
    assert 0.0 < lamp["visible_fraction"][0] < 1.0, "the crate hangs between"
    assert lamp["visible"][0] and lamp["hidden"][0]
    every = overlay(client, room, "backprojection", sources="all", limit=2)
    assert every["total"] > every["count"] == 2
    pixel = client.get(f"{room}/overlays/backprojection", params={"x": 4, "y": 44}).json()
    picked = client.get(f"{room}/pick", params={"x": 4, "y": 44}).json()
    assert pixel["position"] == pytest.approx(picked["point"], abs=1e-9)
    assert (pixel["receiver"], pixel["element"]) == (picked["patch"], picked["element"])
    drawn = shapes(client, room, "backprojection")
    fans = sum(len(piece) - 2 for piece in lamp["visible"][0])
    assert len(drawn[TRIANGLES][0]) == 3 * fans
    assert {tuple(colour) for colour in drawn[LINES][1][:, :3].tolist()} == {
        (115, 26, 230), (13, 178, 26),
    }, "violet and green"  # fmt: skip


# --- what is refused ---


@pytest.mark.parametrize(
    ("name", "query", "field"),
    [
        ("mesh", {"depth": -1}, "depth"),
        ("mesh", {"depth": 99}, "depth"),
        ("mesh", {"colour": "red"}, "colour"),
        ("mesh", {"limit": -1}, "limit"),
        ("mesh", {"limit": 10**6}, "limit"),
        ("mesh", {"offset": -1}, "offset"),
        ("mesh", {"element": 10**6}, "element"),
        ("mesh", {"format": "obj"}, "format"),
        ("mesh", {"wait": "max_error=0.1"}, "wait"),
        ("mesh", {"timeout_ms": "nan"}, "timeout_ms"),
        ("mesh", {"camera": "main"}, "camera"),
        ("links", {"kind": "half"}, "kind"),
        ("links", {"element": -1}, "element"),
        ("links", {"element": 10**6}, "element"),
        ("blockers", {}, "link"),
        ("blockers", {"link": 10**6}, "link"),
        ("discontinuities", {"active": "maybe"}, "active"),
        ("discontinuities", {"camera": "nope"}, "camera"),
        ("triangulation", {"triangle": 10**6}, "triangle"),
        ("triangulation", {"triangle": 0, "element": 0}, "triangle"),
        ("samples", {"element": 10**6}, "element"),
        ("samples", {"scale": -1}, "scale"),
        ("graph", {}, "triangle"),
        ("graph", {"triangle": 0, "kind": "height"}, "kind"),
        ("graph", {"triangle": 0, "resolution": 0}, "resolution"),
        ("graph", {"triangle": 0, "resolution": 257}, "resolution"),
        ("graph", {"triangle": 10**6}, "triangle"),
        ("probe", {"x": 0}, "y"),
        ("probe", {"x": 0.5, "y": 0}, "x"),
        ("probe", {"x": 0, "y": -1}, "y"),
        ("probe", {"x": 48, "y": 0}, "x"),
        ("probe", {"x": 0, "y": 0, "patch": 0}, "patch"),
        ("probe", {"x": 0, "y": 0, "z": 1.5}, "x"),
        ("probe", {"x": 0, "y": 0, "z": 0, "patch": 99}, "patch"),
        ("probe", {"x": 0, "y": 0, "z": 1e99}, "z"),
        ("probe", {"x": 0, "y": 0, "camera": "side"}, "x"),
        ("backprojection", {"x": 0}, "y"),
        ("backprojection", {"x": 0, "y": 0, "z": 1.5}, "x"),
        ("backprojection", {"x": 0, "y": 0, "sources": "some"}, "sources"),
    ],
)
def test_the_parameter_at_fault_is_named(
    client: TestClient, room: str, name: str, query: dict[str, Any], field: str
) -> None:
    answer = client.get(f"{room}/overlays/{name}", params=query)
    assert fields_at_fault(answer) == [["query", field]]


def test_what_does_not_exist_says_what_does(client: TestClient, room: str) -> None:
    last = overlay(client, room, "links")["total"] - 1
    answer = client.get(f"{room}/overlays/blockers", params={"link": last + 1})
    assert f"0 to {last}" in problem_of(answer, 422)["detail"]


def test_graphs_have_limits(client: TestClient, room: str) -> None:
    answer = client.get(f"{room}/overlays/graph", params={"element": 0, "resolution": 256})
    problem_of(answer, 413)


def test_overlays_are_waited_for_or_refused_and_follow_edits(client: TestClient) -> None:
    hard = {"scene": room_document(), "settings": {"error_tolerance": 1e-5}}
    path = client.post("/v1/sessions", json=hard).headers["location"]
    for name in ("discontinuities", "triangulation", "samples", "graph", "probe"):
        answer = client.get(f"{path}/overlays/{name}", params=OVERLAYS[name][0] | {"timeout_ms": 20})
        assert problem_of(answer, 409)["type"] == "urn:halflight:not-ready"
    for name in ("mesh", "links"):
        assert client.get(f"{path}/overlays/{name}").status_code == 200, "the solve can be watched"
        late = client.get(f"{path}/overlays/{name}", params={"wait": "converged", "timeout_ms": 20})
        assert late.status_code == 200, "time is up, and there is something to show"
    eased = client.patch(f"{path}/settings", json={"error_tolerance": 0.05})
    assert eased.status_code == 200

    before = overlay(client, path, "triangulation", wait="converged")
    edits = {"edits": [{"op": "remove", "id": "screen"}]}
    assert client.post(f"{path}/edits", json=edits).json()["revision"] == 2
    after = overlay(client, path, "triangulation", wait="converged")
    assert (before["revision"], after["revision"]) == (1, 2)
    assert "screen" not in after["objects"]
    assert sum(after["area"]) == pytest.approx(sum(before["area"]) - 2 * 0.7 * 0.6)
    assert client.delete(path).status_code == 204
