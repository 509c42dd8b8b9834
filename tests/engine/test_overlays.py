"""Overlays tell what the solver holds: their laws."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from solver.engine.drawing import Drawing
from solver.engine.engine import Engine
from solver.engine.overlays.base import NotReadyError, OverlayRequest, Page
from solver.engine.overlays.discontinuities import Activity, DiscontinuitiesOverlay
from solver.engine.overlays.elements import MeshColour, MeshOverlay
from solver.engine.overlays.links import BlockersOverlay, LinkKind, LinksOverlay
from solver.engine.overlays.selection import Selection
from solver.engine.overlays.shapes import GREEN, PINK, VIOLET, WHITE
from solver.engine.overlays.triangles import TriangulationOverlay
from solver.engine.requests import CameraChoice
from solver.errors import SceneError
from solver.geometry.surfaces import flatten
from solver.illumination.settings import LightSettings
from solver.types import AnyArray
from tests.engine.acting import settle
from tests.engine.showing import columns_of, room, show, table

SURFACES = flatten(room())
PATCHES = SURFACES.patch_count


@pytest.fixture(scope="module")
def engine(drawing: Drawing) -> Iterator[Engine]:
    made = Engine(room(), LightSettings(error_tolerance=0.04), drawing=drawing)
    settle(made)
    show(made, TriangulationOverlay())
    yield made


def area_by_patch(columns: dict[str, AnyArray]) -> AnyArray:
    return np.bincount(columns["patch"], columns["area"], PATCHES)


# --- elements ---


@pytest.mark.parametrize("depth", [0, 1, 2, 5, None])
def test_elements_of_a_depth_tile_the_surfaces(engine: Engine, depth: int | None) -> None:
    shown = show(engine, MeshOverlay(depth))
    columns = columns_of(shown)
    assert shown.total == len(columns["element"])
    np.testing.assert_allclose(area_by_patch(columns), SURFACES.area, rtol=1e-12)
    if depth is None:
        assert np.all(columns["leaf"])
        assert shown.total == engine.status().statistics.leaves
    else:
        assert np.max(columns["depth"]) <= depth
        assert np.all(columns["leaf"] | (columns["depth"] == depth))


def test_elements_carry_the_mean_of_their_parts(engine: Engine) -> None:
    leaves, patches = table(engine, MeshOverlay()), table(engine, MeshOverlay(0))
    area, radiosity = leaves["area"], leaves["radiosity"]
    for channel in range(3):
        sent = np.bincount(leaves["patch"], area * radiosity[:, channel], PATCHES)
        expected = sent / SURFACES.area
        np.testing.assert_allclose(patches["radiosity"][:, channel], expected, rtol=1e-12)
    lit = leaves["reflectance"].any(axis=1)
    assert np.all(radiosity[lit] <= SURFACES.emission.max())
    assert np.all(radiosity >= 0.0)


def test_an_element_is_shown_with_its_parts_alone(engine: Engine) -> None:
    one = table(engine, MeshOverlay(1, element=0))
    assert sum(one["area"]) == pytest.approx(SURFACES.area[0], rel=1e-12)
    assert set(one["parent"]) == {0}
    child = int(one["element"][0])
    below = table(engine, MeshOverlay(element=child))
    assert sum(below["area"]) == pytest.approx(one["area"][0], rel=1e-12)


def test_colours_of_elements(engine: Engine) -> None:
    bright = table(engine, MeshOverlay())
    emits = bright["patch"] == 1
    assert np.all(bright["rgb"][emits] == WHITE)
    assert bright["rgb"][~emits].max() == 1.0
    rho = table(engine, MeshOverlay(colour=MeshColour.RHO))
    np.testing.assert_array_equal(rho["rgb"], rho["reflectance"])


def test_pages_are_the_whole(engine: Engine) -> None:
    whole = show(engine, MeshOverlay())
    parts = [show(engine, MeshOverlay(page=Page(7, start))) for start in range(0, whole.total, 7)]
    for name, column in whole.columns.items():
        together = [row for part in parts for row in part.columns[name]]
        np.testing.assert_array_equal(np.asarray(together), np.asarray(column))
    assert {part.total for part in parts} == {whole.total}
    assert len(show(engine, MeshOverlay(page=Page(5, whole.total))).columns["element"]) == 0


# --- links ---


def test_links_are_counted_as_the_statistics_do(engine: Engine) -> None:
    statistics = engine.status().statistics
    shown = show(engine, LinksOverlay())
    assert shown.total == statistics.links
    expected = {
        "full": statistics.links_full,
        "partial": statistics.links_partial,
        "none": statistics.links_none,
    }
    assert shown.facts["counts"] == expected
    assert min(expected.values()) > 0, "the scene has links of all classes"
    for kind, count in expected.items():
        found = show(engine, LinksOverlay(kind=LinkKind(kind)))
        assert found.total == count
        assert set(found.columns["visibility"]) == {kind}
    crossing = show(engine, LinksOverlay(kind=LinkKind.PLANE))
    assert crossing.total == np.count_nonzero(columns_of(shown)["crosses_plane"]) > 0
    assert columns_of(crossing)["crosses_plane"].all()


def test_links_are_reciprocal(engine: Engine) -> None:
    links = table(engine, LinksOverlay())
    area = np.zeros(engine.status().statistics.elements)
    for depth in range(12):
        elements = table(engine, MeshOverlay(depth))
        area[elements["element"]] = elements["area"]
    assert area.all()
    exchange = links["exchange"]
    np.testing.assert_allclose(links["form_factor_pq"] * area[links["p"]], exchange, rtol=1e-12)
    np.testing.assert_allclose(links["form_factor_qp"] * area[links["q"]], exchange, rtol=1e-12)
    assert np.all(links["form_factor_pq"] <= 1.0 + 1e-3)


def test_links_are_coloured_by_what_they_see(engine: Engine) -> None:
    links = table(engine, LinksOverlay())
    expected = {"full": WHITE, "partial": GREEN, "none": (0.0, 0.0, 0.0)}
    for visibility, crosses, fraction, colour in zip(
        links["visibility"], links["crosses_plane"], links["visible_fraction"], links["rgb"], strict=True
    ):
        assert tuple(colour) == (PINK if crosses else expected[str(visibility)])
        if visibility != "partial":
            assert fraction == (1.0 if visibility == "full" else 0.0)


def test_the_links_of_an_element_are_those_with_this_end(engine: Engine) -> None:
    every = table(engine, LinksOverlay())
    found = 0
    for element in range(engine.status().statistics.elements):
        links = table(engine, LinksOverlay(element))
        assert np.all((links["p"] == element) | (links["q"] == element))
        found += len(links["link"])
    assert found == 2 * len(every["link"])


def test_blockers_stand_between_the_ends_of_their_link(engine: Engine) -> None:
    links = table(engine, LinksOverlay())
    blocked = np.flatnonzero(links["blockers"] > 0)
    for row in (*blocked[:20].tolist(), int(np.argmin(links["blockers"]))):
        shown = show(engine, BlockersOverlay(int(links["link"][row])))
        assert shown.total == links["blockers"][row]
        ends = shown.facts["ends"]
        assert isinstance(ends, list)
        assert [end["element"] for end in ends] == [links["p"][row], links["q"][row]]
        assert not set(shown.columns["patch"]) & {end["patch"] for end in ends}
        sides = 4.0 - (np.array([len(end["corners"]) for end in ends]) == 3)
        assert len(shown.shapes.lines) == sides.sum() + columns_of(shown)["corner_count"].sum()


# --- discontinuities and triangles ---


def test_discontinuities_are_active_or_not(engine: Engine) -> None:
    every, active, idle = (
        show(engine, DiscontinuitiesOverlay(a)) for a in (Activity.ALL, Activity.TRUE, Activity.FALSE)
    )
    assert every.total == active.total + idle.total > 0
    assert columns_of(active)["active"].all() and not columns_of(idle)["active"].any()
    fine = engine.status().fine
    assert (every.total, active.total) == (fine.discontinuities, fine.discontinuities_active)
    assert every.facts["counts"] == {
        "found": fine.discontinuities,
        "active": fine.discontinuities_active,
        "dropped_by_weight": fine.discontinuities_weak,
        "dropped_by_limit": fine.discontinuities_crowded,
    }
    assert len(every.shapes.lines) == every.total
    assert np.all(every.shapes.lines.colour == VIOLET)


def test_discontinuities_lie_on_their_receiver(engine: Engine) -> None:
    columns = table(engine, DiscontinuitiesOverlay())
    receiver = columns["receiver"]
    offset = columns["ends"] - SURFACES.corners[receiver][:, :1]
    height = np.einsum("dea,da->de", offset, SURFACES.normal[receiver])
    assert np.abs(height).max() < 1e-9 * SURFACES.size
    assert "contact" in columns["kind"], "the screen stands on the floor"
    for kind, source, weight, patch, owner in zip(
        columns["kind"], columns["source"], columns["weight"], columns["blocker"], columns["blocker_object"],
        strict=True,
    ):  # fmt: skip
        assert (source is None) == (kind == "contact")
        assert np.isinf(weight) == (kind == "contact")
        assert (patch is None) == (kind == "horizon") == (owner is None)
        assert patch is None or owner == SURFACES.object[patch]


def test_triangles_tile_the_surfaces(engine: Engine) -> None:
    shown = show(engine, TriangulationOverlay())
    columns = columns_of(shown)
    np.testing.assert_allclose(area_by_patch(columns), SURFACES.area, rtol=1e-9)
    leaf_area = np.bincount(columns["element"], columns["area"])
    elements = table(engine, MeshOverlay())
    np.testing.assert_allclose(leaf_area[elements["element"]], elements["area"], rtol=1e-9)
    assert shown.total == engine.status().fine.triangles


def test_edges_of_triangles_come_once(engine: Engine) -> None:
    shown = show(engine, TriangulationOverlay())
    columns = columns_of(shown)
    neighbour = columns["neighbour"]
    border = np.count_nonzero(neighbour == None)  # noqa: E711
    assert len(shown.shapes.lines) == shown.facts["edges"] == border + (neighbour.size - border) // 2
    on_line = columns["edge_is_discontinuity"]
    violet = np.all(shown.shapes.lines.colour == VIOLET, axis=1)
    assert np.all(violet | np.all(shown.shapes.lines.colour == GREEN, axis=1))
    inner = np.count_nonzero(on_line & (neighbour != None))  # noqa: E711
    assert violet.sum() == np.count_nonzero(on_line) - inner // 2 > 0
    assert np.all(on_line[columns["edge_is_jump"]])


def test_triangles_of_an_element_or_one_alone(engine: Engine) -> None:
    every = table(engine, TriangulationOverlay())
    floor = table(engine, TriangulationOverlay(Selection(element=0)))
    assert np.array_equal(floor["triangle"], np.flatnonzero(every["patch"] == 0))
    leaf = int(every["element"][3])
    parts = table(engine, TriangulationOverlay(Selection(element=leaf)))
    assert np.array_equal(parts["triangle"], np.flatnonzero(every["element"] == leaf))
    alone = show(engine, TriangulationOverlay(Selection(triangle=3)))
    assert (alone.total, len(alone.shapes.lines)) == (1, 3)


# --- what cannot be shown ---


@pytest.mark.parametrize(
    ("overlay", "name"),
    [
        (MeshOverlay(element=10**6), "element"),
        (LinksOverlay(element=10**6), "element"),
        (BlockersOverlay(10**6), "link"),
        (TriangulationOverlay(Selection(triangle=10**6)), "triangle"),
        (TriangulationOverlay(Selection(element=10**6)), "element"),
        (TriangulationOverlay(Selection(triangle=0, element=0)), "triangle"),
    ],
)
def test_what_does_not_exist_is_named(engine: Engine, overlay: MeshOverlay, name: str) -> None:
    with pytest.raises(SceneError) as refused:
        show(engine, overlay)
    assert refused.value.location == (name,)


def test_the_solution_can_be_watched_while_it_is_solved(drawing: Drawing) -> None:
    engine = Engine(room(), LightSettings(error_tolerance=0.04), drawing=drawing)
    request = OverlayRequest(LinksOverlay(), CameraChoice())
    assert engine.is_overlay_ready(request, complete=False)
    assert not engine.is_overlay_ready(request, complete=True)
    assert show(engine, LinksOverlay(), complete=False).total == 0
    assert show(engine, MeshOverlay(), complete=False).total == PATCHES
    asked = OverlayRequest(TriangulationOverlay(), CameraChoice())
    assert not engine.is_overlay_ready(asked, complete=False)
    with pytest.raises(NotReadyError):
        next(work := engine.overlay(asked))
        next(work)
    assert show(engine, TriangulationOverlay(), complete=False).total > 0, "asking has the work done"
