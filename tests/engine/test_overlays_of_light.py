"""Samples, graphs and probes against the interpolants and point irradiances that they show."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from solver.engine.drawing import Drawing
from solver.engine.engine import Engine
from solver.engine.overlays.base import OverlayRequest, Page
from solver.engine.overlays.graph import DENSEST, GraphKind, GraphOverlay
from solver.engine.overlays.places import Pixel, SurfacePoint
from solver.engine.overlays.probe import ProbeOverlay
from solver.engine.overlays.samples import SamplesOverlay
from solver.engine.overlays.selection import Selection
from solver.engine.overlays.shapes import BLUE, RED, WHITE, YELLOW
from solver.engine.overlays.triangles import TriangulationOverlay
from solver.engine.requests import CameraChoice, FrameRequest, LayerName, RendererName
from solver.errors import LimitExceededError, SceneError
from solver.geometry.surfaces import flatten
from solver.illumination.interpolation.samples import NUDGE
from solver.illumination.settings import LightSettings
from solver.types import LUMINANCE_WEIGHTS, AnyArray
from tests.engine.acting import settle
from tests.engine.showing import columns_of, room, show, table

SURFACES = flatten(room())
FLOOR = Selection(element=0)


@pytest.fixture(scope="module")
def engine(drawing: Drawing) -> Iterator[Engine]:
    made = Engine(room(), LightSettings(error_tolerance=0.04), drawing=drawing)
    settle(made)
    show(made, TriangulationOverlay())
    yield made


def hidden_triangle(engine: Engine) -> int:
    """A triangle that the camera does not see: it is not built unless somebody asks."""
    triangles = table(engine, TriangulationOverlay())
    return int(triangles["triangle"][~triangles["exact"]][0])


# --- samples ---


def test_a_triangle_has_six_samples_at_its_corners_and_middles(engine: Engine) -> None:
    corners = table(engine, TriangulationOverlay())["corners"]
    for triangle in (0, len(corners) // 2, hidden_triangle(engine)):
        samples = table(engine, SamplesOverlay(Selection(triangle=triangle)))
        assert samples["exact"].all(), "what is selected is built"
        a, b, c = corners[triangle]
        places = np.array([a, (a + b) / 2, b, (b + c) / 2, c, (c + a) / 2])
        # Another triangle may have nudged a sample that this one shares with it.
        assert np.abs(samples["position"] - places).max() <= NUDGE * SURFACES.size


def test_samples_are_what_interpolants_pass_through(engine: Engine) -> None:
    triangle = 5
    samples = table(engine, SamplesOverlay(Selection(triangle=triangle)))
    graph = table(engine, GraphOverlay(Selection(triangle=triangle), GraphKind.INTERPOLATED, resolution=2))
    order = [tuple(place) for place in graph["st"].tolist()]
    wanted = [(0.0, 0.0), (0.5, 0.0), (1.0, 0.0), (0.5, 0.5), (0.0, 1.0), (0.0, 0.5)]
    found = graph["irradiance"][[order.index(place) for place in wanted]]
    np.testing.assert_allclose(found, samples["irradiance"].clip(0.0), rtol=1e-5, atol=1e-6)


def test_samples_of_all_triangles_come_once(engine: Engine) -> None:
    shown = show(engine, SamplesOverlay())
    columns = columns_of(shown)
    assert len(np.unique(columns["sample"])) == shown.total
    np.testing.assert_allclose(columns["luminance"], columns["irradiance"] @ LUMINANCE_WEIGHTS)
    scale = shown.facts["height_scale"]
    np.testing.assert_allclose(columns["height"], scale * columns["luminance"])
    assert len(shown.shapes.points) == len(shown.shapes.lines) == shown.total
    assert np.all(shown.shapes.points.colour == YELLOW)
    stalks = shown.shapes.lines.position[:, 1] - shown.shapes.lines.position[:, 0]
    raised = np.einsum("na,na->n", stalks, SURFACES.normal[columns["patch"]])
    np.testing.assert_allclose(raised, columns["height"], atol=1e-12)
    floor = table(engine, SamplesOverlay(FLOOR))
    assert set(floor["sample"]) == set(columns["sample"][columns["patch"] == 0])


# --- graphs ---


def test_the_difference_is_analytic_less_interpolated(engine: Engine) -> None:
    chosen = Selection(triangle=hidden_triangle(engine))
    analytic, interpolated, difference = (
        table(engine, GraphOverlay(chosen, kind, resolution=3))["irradiance"] for kind in GraphKind
    )
    np.testing.assert_allclose(difference, analytic - interpolated, atol=1e-12)
    assert analytic.shape == (10, 3)


@pytest.mark.parametrize(
    ("kind", "colour"),
    [(GraphKind.ANALYTIC, WHITE), (GraphKind.INTERPOLATED, BLUE), (GraphKind.DIFFERENCE, RED)],
)
def test_a_graph_is_a_grid_over_its_triangle(engine: Engine, kind: GraphKind, colour: AnyArray) -> None:
    n = 4
    shown = show(engine, GraphOverlay(Selection(triangle=0), kind, resolution=n, scale=0.5))
    columns = columns_of(shown)
    assert shown.total == (n + 1) * (n + 2) // 2
    lines = np.array(shown.facts["lines"])
    assert len(lines) == 3 * n * (n + 1) // 2
    steps = np.abs(np.diff(columns["st"][lines], axis=1))
    assert steps.max() == pytest.approx(1 / n)
    np.testing.assert_allclose(columns["height"], 0.5 * columns["irradiance"] @ LUMINANCE_WEIGHTS)
    assert np.all(shown.shapes.lines.colour == colour)
    a, b, c = table(engine, TriangulationOverlay())["corners"][0]
    s, t = columns["st"].T[:, :, None]
    np.testing.assert_allclose(columns["position"], a + s * (b - a) + t * (c - a), atol=1e-12)


def test_the_density_of_graphs_follows_the_share_of_the_patch(engine: Engine) -> None:
    shown = show(engine, GraphOverlay(FLOOR, GraphKind.INTERPOLATED))
    triangles = table(engine, TriangulationOverlay(FLOOR))
    share = triangles["area"] / SURFACES.area[0]
    expected = np.ceil(DENSEST * np.sqrt(share))
    assert np.array_equal(np.array(shown.facts["resolution"]), expected)
    assert len(set(expected.tolist())) > 1
    assert np.array_equal(
        np.bincount(columns_of(shown)["triangle"])[triangles["triangle"]], (expected + 1) * (expected + 2) / 2
    )


def test_pages_of_a_graph_keep_the_lines_within(engine: Engine) -> None:
    whole = show(engine, GraphOverlay(Selection(triangle=0), GraphKind.INTERPOLATED, resolution=6))
    part = show(
        engine, GraphOverlay(Selection(triangle=0), GraphKind.INTERPOLATED, resolution=6, page=Page(10, 9))
    )
    np.testing.assert_array_equal(columns_of(part)["st"], columns_of(whole)["st"][9:19])
    lines = np.array(part.facts["lines"])
    assert 0 < len(lines) < len(np.array(whole.facts["lines"]))
    assert (lines.min() >= 0) and (lines.max() < 10)


def test_graphs_have_limits(engine: Engine) -> None:
    with pytest.raises(SceneError) as refused:
        show(engine, GraphOverlay())
    assert refused.value.location == ("triangle",)
    with pytest.raises(LimitExceededError):
        show(engine, GraphOverlay(FLOOR, resolution=256))


# --- probes ---


def test_a_probe_is_the_same_by_pixel_and_by_point(engine: Engine) -> None:
    for x, y in ((5, 40), (12, 20), (30, 25)):
        seen = table(engine, ProbeOverlay(Pixel(x, y)))
        place = seen["position"][0].tolist()
        point = SurfacePoint(x=place[0], y=place[1], z=place[2], patch=int(seen["patch"][0]))
        given = table(engine, ProbeOverlay(point))
        for name, column in seen.items():
            np.testing.assert_allclose(given[name], column, rtol=1e-9, atol=1e-12, err_msg=name)


def test_a_probe_measures_what_light_meters_and_frames_show(engine: Engine) -> None:
    request = FrameRequest(renderer=RendererName.INTERPOLANT, layer=LayerName.IRRADIANCE)
    frame = engine.frame(request).image
    for x, y in ((5, 40), (12, 20), (30, 25)):
        probe = table(engine, ProbeOverlay(Pixel(x, y)))
        np.testing.assert_allclose(probe["interpolated"][0], frame[y, x], rtol=1e-4, atol=1e-5)
        meter = engine.probe(probe["position"], probe["normal"])
        np.testing.assert_allclose(probe["analytic"], meter.irradiance, rtol=1e-2, atol=1e-6)
        np.testing.assert_allclose(probe["illuminance"], 179.0 * probe["analytic"] @ LUMINANCE_WEIGHTS)
        np.testing.assert_allclose(probe["difference"], probe["analytic"] - probe["interpolated"])


def test_a_point_is_found_on_the_patch_that_is_meant(engine: Engine) -> None:
    on_crate = (0.5, 0.6, 0.5)
    above = table(engine, ProbeOverlay(SurfacePoint(*on_crate)))
    assert above["normal"][0].tolist() == [0.0, 0.0, 1.0]
    patch = int(above["patch"][0])
    others = [
        k for k in range(SURFACES.patch_count) if SURFACES.object[k] == SURFACES.object[patch] and k != patch
    ]
    below = table(engine, ProbeOverlay(SurfacePoint(*on_crate, others[0])))
    assert below["normal"][0].tolist() == [0.0, 0.0, -1.0]
    assert below["analytic"][0].sum() < above["analytic"][0].sum()
    rounded = np.array(on_crate, dtype=np.float32).astype(float)
    near = table(engine, ProbeOverlay(SurfacePoint(*rounded.tolist())))
    assert int(near["patch"][0]) == patch


@pytest.mark.parametrize(
    ("at", "name"),
    [
        (SurfacePoint(0.0, 0.0, 1.0), "x"),
        (SurfacePoint(5.0, 0.0, 0.0), "x"),
        (SurfacePoint(0.0, 0.0, 0.0, patch=1), "x"),
        (SurfacePoint(0.0, 0.0, 0.0, patch=99), "patch"),
        (Pixel(48, 0), "x"),
        (Pixel(0, 48), "y"),
    ],
)
def test_points_that_are_nowhere_are_named(engine: Engine, at: SurfacePoint | Pixel, name: str) -> None:
    with pytest.raises(SceneError) as refused:
        show(engine, ProbeOverlay(at))
    assert refused.value.location == (name,)


def test_probes_wait_for_the_triangulation(drawing: Drawing) -> None:
    engine = Engine(room(), LightSettings(error_tolerance=0.04), drawing=drawing)
    request = OverlayRequest(ProbeOverlay(Pixel(5, 40)), CameraChoice())
    assert not engine.is_overlay_ready(request, complete=False)
    assert show(engine, request.overlay, complete=False).total == 1
