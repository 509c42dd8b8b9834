"""Frames: every parameter of the contract, and the headers that tell what a frame is worth."""

from __future__ import annotations

import io
import math
from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient
from PIL import Image

from solver.types import AnyArray
from tests.service.conftest import open_box
from tests.service.problem import fields_at_fault, problem_of

CORNER = (44, 4)
"""Row and column of a pixel that shows a corner of the floor."""


def frame(client: TestClient, path: str, **query: Any) -> AnyArray:
    answer = client.get(f"{path}/frame", params={"format": "npy", **query})
    assert answer.status_code == 200, answer.text
    image: AnyArray = np.load(io.BytesIO(answer.content))
    return image


@pytest.mark.parametrize(
    ("name", "media", "kind"),
    [("png", "image/png", "PNG"), ("jpeg", "image/jpeg", "JPEG"), ("webp", "image/webp", "WEBP")],
)
def test_pictures(client: TestClient, settled: str, name: str, media: str, kind: str) -> None:
    by_name = client.get(f"{settled}/frame", params={"format": name})
    by_header = client.get(f"{settled}/frame", headers={"Accept": f"text/html, {media};q=0.8, */*;q=0.1"})
    for answer in (by_name, by_header):
        assert answer.headers["content-type"] == media
        picture = Image.open(io.BytesIO(answer.content))
        assert (picture.format, picture.size, picture.mode) == (kind, (48, 48), "RGB")
    assert by_name.content == by_header.content
    assert "vary" not in by_name.headers
    assert by_header.headers["vary"] == "Accept"


@pytest.mark.parametrize(
    ("name", "media", "magic"),
    [
        ("exr", "image/x-exr", b"v/1\x01"),
        ("hdr", "image/vnd.radiance", b"#?RADIANCE"),
        ("npy", "application/x-npy", b"\x93NUMPY"),
    ],
)
def test_linear_files(client: TestClient, settled: str, name: str, media: str, magic: bytes) -> None:
    answer = client.get(f"{settled}/frame", params={"format": name})
    assert answer.headers["content-type"] == media
    assert answer.content.startswith(magic)


def test_npy_is_linear_radiance_top_row_first(client: TestClient, settled: str) -> None:
    image = frame(client, settled)
    assert image.dtype == np.float32
    assert image.shape == (48, 48, 3)
    irradiance = frame(client, settled, layer="irradiance")
    # The floor's reflectance is 0.6, 0.4, 0.2.
    assert image[CORNER] == pytest.approx(np.array([0.6, 0.4, 0.2]) * irradiance[CORNER] / math.pi, rel=1e-4)
    objects = frame(client, settled, layer="object")[:, :, 0]
    assert (objects[:24, 24:] == 2).any(), "the crate hangs over the upper right"
    assert not (objects[24:, :24] == 2).any()


def test_accept_decides_only_without_a_format(client: TestClient, settled: str) -> None:
    answer = client.get(f"{settled}/frame", params={"format": "png"}, headers={"Accept": "image/webp"})
    assert answer.headers["content-type"] == "image/png"
    assert client.get(f"{settled}/frame", headers={"Accept": "*/*"}).headers["content-type"] == "image/png"
    browser = "image/avif,image/webp,image/apng,image/svg+xml,image/*,*/*;q=0.8"
    assert client.get(f"{settled}/frame", headers={"Accept": browser}).headers["content-type"] == "image/png"
    refused = client.get(f"{settled}/frame", headers={"Accept": "text/html, image/png;q=0, image/gif"})
    problem_of(refused, 406)


def test_headers_tell_what_a_frame_is_worth(client: TestClient, settled: str) -> None:
    headers = client.get(f"{settled}/frame", params={"wait": "converged"}).headers
    coarse = client.get(f"{settled}/frame", params={"renderer": "gouraud"}).headers
    status = client.get(settled).json()
    assert headers["x-revision"] == "1"
    assert headers["x-converged"] == "true"
    assert headers["x-renderer"] == "interpolant"
    # Elements show less than the solution knows.
    assert float(coarse["x-error-estimate"]) >= 0.999 * status["error_estimate"]
    assert 0.0 < float(headers["x-error-estimate"]) < status["settings"]["error_tolerance"]
    assert float(headers["x-render-ms"]) > 0.0
    assert headers["cache-control"] == "no-cache"


def test_a_frame_that_the_client_has_is_not_sent_again(client: TestClient, settled: str) -> None:
    first = client.get(f"{settled}/frame")
    tag = first.headers["etag"]
    assert tag.startswith('"')
    for known in (tag, f'"other", W/{tag}'):
        again = client.get(f"{settled}/frame", headers={"If-None-Match": known})
        assert again.status_code == 304
        assert again.content == b""
        assert again.headers["etag"] == tag
        assert again.headers["x-converged"] == "true"
    assert client.get(f"{settled}/frame", headers={"If-None-Match": '"other"'}).status_code == 200
    other = client.get(f"{settled}/frame", params={"exposure": 1}, headers={"If-None-Match": tag})
    assert other.status_code == 200
    assert other.headers["etag"] != tag


def test_an_edit_makes_a_new_tag(client: TestClient, session: str) -> None:
    query = {"wait": "converged"}
    tag = client.get(f"{session}/frame", params=query).headers["etag"]
    edits = {"edits": [{"op": "remove", "id": "crate"}]}
    assert client.post(f"{session}/edits", json=edits).json()["revision"] == 2
    answer = client.get(f"{session}/frame", headers={"If-None-Match": tag})
    assert answer.status_code == 200
    assert answer.headers["x-revision"] == "2"


def test_a_camera_of_the_scene_or_one_given_here(client: TestClient, settled: str) -> None:
    assert frame(client, settled, camera="side").shape == (24, 32, 3)
    assert frame(client, settled, width=10, height=20).shape == (20, 10, 3)
    near = frame(client, settled, layer="depth", eye="0,0,1", up="0,1,0", vertical_fov=20)[..., 0]
    assert near == pytest.approx(np.ones((48, 48)), rel=1e-5)
    aside = frame(client, settled, eye="0.9,0,1", target="0.9,0,0", vertical_fov=1.0, layer="position")
    assert aside[24, 24] == pytest.approx([0.9, 0.0, 0.0], abs=1e-3)


@pytest.mark.parametrize(
    "layer", ["radiance", "irradiance", "illuminance", "depth", "position", "normal", "object", "element"]
)
def test_layers_come_as_numbers_and_as_pictures(client: TestClient, settled: str, layer: str) -> None:
    numbers = frame(client, settled, layer=layer)
    assert numbers.dtype == np.float32
    assert numbers.shape == (48, 48, 3)
    picture = client.get(f"{settled}/frame", params={"layer": layer, "format": "png"})
    pixels = np.asarray(Image.open(io.BytesIO(picture.content)))
    assert len(np.unique(pixels)) > 1


def test_a_format_that_cannot_hold_a_layer_is_named(client: TestClient, settled: str) -> None:
    query = {"layer": "position", "format": "hdr", "eye": "0,0,1", "target": "-0.5,0,0", "up": "0,1,0"}
    answer = client.get(f"{settled}/frame", params=query)
    assert problem_of(answer, 422)
    assert fields_at_fault(answer) == [["query", "format"]]


def test_illuminance_is_in_lux(client: TestClient, settled: str) -> None:
    irradiance = frame(client, settled, layer="irradiance")[CORNER]
    expected = 179.0 * float(irradiance @ [0.2126, 0.7152, 0.0722])
    assert frame(client, settled, layer="illuminance")[CORNER] == pytest.approx([expected] * 3, rel=1e-4)


def test_exposure_and_tone_map_shape_a_picture(client: TestClient, settled: str) -> None:
    def mean(**query: Any) -> float:
        answer = client.get(f"{settled}/frame", params={"format": "png", **query})
        return float(np.asarray(Image.open(io.BytesIO(answer.content))).mean())

    assert mean(exposure=-2) < mean(exposure=0) < mean(exposure=2)
    assert mean(exposure="auto") == mean()
    assert len({mean(exposure=3, tone_map=curve) for curve in ("linear", "reinhard", "filmic")}) == 3


def test_samples_smooth_edges(client: TestClient, settled: str) -> None:
    once, often = (frame(client, settled, samples=samples) for samples in (1, 16))
    assert once.shape == often.shape
    assert not np.array_equal(once, often)
    assert once.mean() == pytest.approx(often.mean(), rel=0.05)


@pytest.mark.parametrize("renderer", ["flat", "gouraud", "interpolant", "gather", "vpl"])
def test_renderers_that_are_named(client: TestClient, settled: str, renderer: str) -> None:
    small = {"width": 24, "height": 18}
    answer = client.get(f"{settled}/frame", params={"renderer": renderer, "wait": "converged", **small})
    assert answer.headers["x-renderer"] == renderer


@pytest.mark.parametrize("renderer", ["gouraud", "vpl"])
@pytest.mark.parametrize("layer", ["triangle", "barycentric", "error"])
def test_what_there_is_not_says_so(client: TestClient, settled: str, renderer: str, layer: str) -> None:
    answer = client.get(f"{settled}/frame", params={"renderer": renderer, "layer": layer})
    assert problem_of(answer, 501)["type"] == "urn:halflight:not-available"
    assert layer in answer.json()["detail"]


@pytest.mark.parametrize("layer", ["triangle", "barycentric", "error", "false_colour"])
def test_layers_of_interpolants(client: TestClient, settled: str, layer: str) -> None:
    asked = {"layer": layer, "wait": "converged"}
    answer = client.get(f"{settled}/frame", params=asked)
    assert answer.status_code == 200
    assert answer.headers["x-converged"] == "true"
    assert np.asarray(Image.open(io.BytesIO(answer.content))).std() > 0.0
    numbers = frame(client, settled, **asked)
    assert np.isfinite(numbers).all()


# --- virtual lights ---


def test_frames_by_virtual_lights_come_without_a_solve(client: TestClient) -> None:
    """A session that would solve for long has a picture at once, and its headers tell what it is worth."""
    path = open_box(client, error_tolerance=1e-5)
    query = {"renderer": "vpl", "timeout_ms": 10_000, "wait": "max_error=0.2"}
    answer = client.get(f"{path}/frame", params=query)
    assert answer.status_code == 200
    assert answer.headers["x-renderer"] == "vpl"
    assert answer.headers["x-revision"] == "1"
    assert answer.headers["x-converged"] == "false"
    assert 1e-5 < float(answer.headers["x-error-estimate"]) <= 0.2
    assert client.get(path).json()["state"] == "solving"
    late = client.get(f"{path}/frame", params={**query, "wait": "converged", "timeout_ms": 200})
    assert late.status_code == 200, "a wait is bounded"
    assert late.headers["x-converged"] == "false"
    assert client.delete(path).status_code == 204


def test_converged_frames_by_virtual_lights_have_a_tag_that_stays(client: TestClient, settled: str) -> None:
    query = {"renderer": "vpl", "width": 40, "height": 30, "wait": "converged"}
    first = client.get(f"{settled}/frame", params=query)
    assert first.headers["x-converged"] == "true"
    assert 0.0 < float(first.headers["x-error-estimate"]) <= 0.05
    again = client.get(f"{settled}/frame", params=query, headers={"If-None-Match": first.headers["etag"]})
    assert again.status_code == 304
    assert again.content == b""
    less = 0.5 * float(first.headers["x-error-estimate"])
    better = client.get(f"{settled}/frame", params={**query, "wait": f"max_error={less}"})
    assert better.headers["etag"] != first.headers["etag"]
    assert float(better.headers["x-error-estimate"]) <= less


def test_virtual_lights_and_a_solution_give_one_picture(client: TestClient, settled: str) -> None:
    asked = {"wait": "converged", "samples": 4}
    solved, lit = (frame(client, settled, **asked, **r) for r in ({}, {"renderer": "vpl"}))
    assert lit.dtype == np.float32
    assert lit.mean() == pytest.approx(solved.mean(), rel=0.05)
    illuminance = frame(client, settled, renderer="vpl", layer="illuminance", **asked)[CORNER]
    assert illuminance == pytest.approx([179.0 * float(lit[CORNER] @ [0.0, math.pi, 0.0]) / 0.4] * 3, rel=0.1)


def test_an_edit_shows_at_once_by_virtual_lights(client: TestClient, session: str) -> None:
    query = {"renderer": "vpl", "wait": "converged"}
    before = client.get(f"{session}/frame", params=query)
    edits = {"edits": [{"op": "remove", "id": "crate"}]}
    assert client.post(f"{session}/edits", json=edits).json()["revision"] == 2
    answer = client.get(f"{session}/frame", params={"renderer": "vpl"})
    assert (answer.status_code, answer.headers["x-revision"]) == (200, "2")
    assert answer.headers["etag"] != before.headers["etag"]
    after = client.get(f"{session}/frame", params=query)
    assert after.headers["x-converged"] == "true"


def test_samples_of_virtual_lights_have_a_limit(client: TestClient, settled: str) -> None:
    problem_of(client.get(f"{settled}/frame", params={"renderer": "vpl", "samples": 17}), 413)


# --- waiting ---


def test_a_budget_is_spent_on_as_many_paths_as_fit(client: TestClient, settled: str) -> None:
    asked = {"renderer": "vpl", "width": 333, "height": 222}
    errors = []
    for budget in (1, 4000):
        answer = client.get(f"{settled}/frame", params={**asked, "budget_ms": budget})
        assert answer.status_code == 200
        errors.append(float(answer.headers["x-error-estimate"]))
    assert errors[1] < errors[0]


def test_a_frame_within_the_tolerance_does_not_use_its_budget(client: TestClient, settled: str) -> None:
    answer = client.get(f"{settled}/frame", params={"renderer": "gouraud", "budget_ms": 60_000})
    assert answer.headers["x-converged"] == "true"


def test_a_frame_can_wait_for_convergence(client: TestClient, session: str) -> None:
    answer = client.get(f"{session}/frame", params={"wait": "converged"})
    assert answer.headers["x-converged"] == "true"
    assert client.get(session).json()["state"] == "converged"


def test_a_frame_can_wait_for_an_error(client: TestClient, session: str) -> None:
    answer = client.get(f"{session}/frame?wait=max_error=0.08")
    assert float(answer.headers["x-error-estimate"]) <= 0.08


def test_a_wait_that_nothing_can_fulfil_ends_when_the_solve_does(client: TestClient, settled: str) -> None:
    answer = client.get(f"{settled}/frame?wait=max_error=0")
    assert answer.status_code == 200
    assert answer.headers["x-converged"] == "true"


def test_a_wait_is_bounded(client: TestClient, settled: str) -> None:
    query = {"renderer": "path", "camera": "side", "wait": "max_error=1e-6", "timeout_ms": 300}
    answer = client.get(f"{settled}/frame", params=query)
    assert answer.status_code == 200
    assert answer.headers["x-renderer"] == "path"
    assert float(answer.headers["x-error-estimate"]) > 1e-6


def test_a_wait_for_convergence_is_bounded(client: TestClient) -> None:
    path = open_box(client, error_tolerance=1e-5)
    answer = client.get(f"{path}/frame", params={"wait": "converged", "timeout_ms": 200})
    assert answer.status_code == 200
    assert answer.headers["x-converged"] == "false"
    assert client.delete(path).status_code == 204


def test_the_witness_s_frame_gets_better(client: TestClient, settled: str) -> None:
    query = {"renderer": "path", "camera": "side", "width": 40}
    first = client.get(f"{settled}/frame", params=query)
    last = client.get(f"{settled}/frame", params={**query, "wait": "converged"})
    assert last.headers["x-converged"] == "true"
    assert float(last.headers["x-error-estimate"]) <= 0.05
    assert float(last.headers["x-error-estimate"]) <= float(first.headers["x-error-estimate"])
    traced, drawn = (
        frame(client, settled, camera="side", width=40, samples=4, **r) for r in ({"renderer": "path"}, {})
    )
    assert traced.mean() == pytest.approx(drawn.mean(), rel=0.1)


# --- bad input ---


@pytest.mark.parametrize(
    ("query", "field"),
    [
        ({"camera": "nope"}, "camera"),
        ({"camera": ""}, "camera"),
        ({"eye": "1,2"}, "eye"),
        ({"eye": "1,2,x"}, "eye"),
        ({"eye": "1,2,nan"}, "eye"),
        ({"eye": "1,2,1e99"}, "eye"),
        ({"target": "inf,0,0"}, "target"),
        ({"eye": "0,0,0", "target": "0,0,0"}, "target"),
        ({"up": "0,0,0"}, "up"),
        ({"up": "0,1e-200,0"}, "up"),
        ({"up": "0,0,1"}, "up"),
        ({"vertical_fov": "0"}, "vertical_fov"),
        ({"vertical_fov": "5e-324"}, "vertical_fov"),
        ({"vertical_fov": "180"}, "vertical_fov"),
        ({"width": "0"}, "width"),
        ({"width": "-5"}, "width"),
        ({"width": "1.5"}, "width"),
        ({"height": "many"}, "height"),
        ({"height": "9" * 30}, "height"),
        ({"renderer": "raytrace"}, "renderer"),
        ({"format": "gif"}, "format"),
        ({"exposure": "bright"}, "exposure"),
        ({"exposure": "nan"}, "exposure"),
        ({"exposure": "1e9"}, "exposure"),
        ({"tone_map": "aces"}, "tone_map"),
        ({"layer": "albedo"}, "layer"),
        ({"samples": "0"}, "samples"),
        ({"wait": "forever"}, "wait"),
        ({"wait": "max_error"}, "wait"),
        ({"wait": "max_error=nan"}, "wait"),
        ({"wait": "max_error=-1"}, "wait"),
        ({"timeout_ms": "-1"}, "timeout_ms"),
        ({"timeout_ms": "inf"}, "timeout_ms"),
        ({"colour": "red"}, "colour"),
    ],
)
def test_the_parameter_at_fault_is_named(
    client: TestClient, settled: str, query: dict[str, str], field: str
) -> None:
    (found,) = {tuple(loc[:2]) for loc in fields_at_fault(client.get(f"{settled}/frame", params=query))}
    assert found == ("query", field)


@pytest.mark.parametrize(
    "query", [{"width": 4097}, {"height": 5000}, {"width": 4000, "height": 4000}, {"samples": 65}]
)
def test_frames_have_limits(client: TestClient, settled: str, query: dict[str, int]) -> None:
    problem_of(client.get(f"{settled}/frame", params=query), 413)
    assert client.get(f"{settled}/frame").status_code == 200
