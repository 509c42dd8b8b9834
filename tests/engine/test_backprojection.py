"""What a point sees of its sources: visible and hidden parts tile them, and form factors agree."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from solver.document.samples import load_sample
from solver.engine.drawing import Drawing
from solver.engine.engine import Engine
from solver.engine.overlays.backprojection import BackprojectionOverlay, Sources
from solver.engine.overlays.base import OverlayRequest
from solver.engine.overlays.partition import INSERTED, OUTLINE, SHADOW, part_source
from solver.engine.overlays.places import SurfacePoint
from solver.engine.overlays.shapes import GREEN, VIOLET
from solver.engine.requests import CameraChoice
from solver.types import AnyArray, FloatArray
from tests.engine.showing import columns_of, show

SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


@pytest.fixture(scope="module")
def office(drawing: Drawing) -> Iterator[Engine]:
    """As it is at first: what is seen is a matter of geometry."""
    yield Engine(load_sample("office"), drawing=drawing)


def area_of(triangles: FloatArray) -> float:
    u, v = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    return float(0.5 * np.linalg.norm(np.cross(u, v), axis=1).sum()) if len(triangles) else 0.0


def fans(pieces: list[list[list[float]]]) -> FloatArray:
    """The triangles (n, 3, 3) of convex polygons."""
    return np.array(
        [[piece[0], piece[k], piece[k + 1]] for piece in pieces for k in range(1, len(piece) - 1)]
    ).reshape(-1, 3, 3)


def seen(engine: Engine, overlay: BackprojectionOverlay) -> dict[str, AnyArray]:
    return columns_of(show(engine, overlay, complete=False))


# --- parts of a source ---


@given(cuts=st.lists(st.floats(0.05, 0.95), min_size=1, max_size=4, unique=True), kept=st.integers(0, 31))
def test_strips_of_a_square_are_seen_or_hidden(cuts: list[float], kept: int) -> None:
    ends = [0.0, *sorted(cuts), 1.0]
    strips = [np.array([[a, 0.0], [b, 0.0], [b, 1.0], [a, 1.0]]) for a, b in pairwise(ends)]
    is_seen = [bool(kept >> k & 1) for k in range(len(strips))]
    found = part_source(SQUARE, [strip for strip, seen in zip(strips, is_seen, strict=True) if seen])
    hidden = np.pad(found.hidden, ((0, 0), (0, 0), (0, 1)))
    unseen = sum(b - a for a, b, seen in zip(ends[:-1], ends[1:], is_seen, strict=True) if not seen)
    assert area_of(hidden) == pytest.approx(unseen, abs=1e-8)
    u, v = hidden[:, 1] - hidden[:, 0], hidden[:, 2] - hidden[:, 0]
    assert np.all(u[:, 0] * v[:, 1] > u[:, 1] * v[:, 0]), "counter-clockwise"
    length = np.linalg.norm(found.lines[:, 1] - found.lines[:, 0], axis=1)
    assert length[found.kind == OUTLINE].sum() == pytest.approx(4.0)
    pairs = list(pairwise(is_seen))
    assert length[found.kind == SHADOW].sum() == pytest.approx(sum(a != b for a, b in pairs), abs=1e-8)
    assert length[found.kind == INSERTED].sum() == pytest.approx(sum(a and b for a, b in pairs), abs=1e-8)


# --- sources of a point ---


@pytest.mark.parametrize("point", [(2.0, 1.6, 0.0), (0.8, 0.64, 0.0), (0.0, 1.6, 1.3), (1.1, 2.2, 0.73)])
def test_all_that_a_point_sees_of_a_closed_room_is_around_it(
    office: Engine, point: tuple[float, float, float]
) -> None:
    """From the floor, a wall and the desk no black back is seen: form factors add up to 1."""
    columns = seen(office, BackprojectionOverlay(SurfacePoint(*point), Sources.ALL))
    assert columns["form_factor"].sum() == pytest.approx(1.0, abs=1e-12)
    assert np.all(columns["form_factor"] <= columns["form_factor_unoccluded"] + 1e-12)
    assert columns["form_factor_unoccluded"].sum() > 1.01
    partial = 0
    for area, share, visible, hidden in zip(
        *(columns[name] for name in ("area_above_horizon", "visible_fraction", "visible", "hidden")),
        strict=True,
    ):
        assert area_of(fans(visible)) == pytest.approx(share * area, rel=1e-9, abs=1e-12)
        rest = area_of(np.array(hidden).reshape(-1, 3, 3))
        assert rest == pytest.approx((1.0 - share) * area, abs=1e-6 * area)
        partial += 1e-6 < share < 1.0 - 1e-6
    assert partial > 0


def test_what_emits_is_the_default(office: Engine) -> None:
    shown = show(office, BackprojectionOverlay(SurfacePoint(2.0, 1.6, 0.0)), complete=False)
    columns = columns_of(shown)
    assert columns["emits"].all()
    every = seen(office, BackprojectionOverlay(SurfacePoint(2.0, 1.6, 0.0), Sources.ALL))
    assert set(columns["patch"]) == set(every["patch"][every["emits"].astype(bool)])
    assert shown.facts["receiver"] == 0
    colours = {tuple(colour) for colour in shown.shapes.lines.colour.tolist()}
    assert GREEN in colours
    assert colours <= {GREEN, VIOLET}
    assert len(shown.shapes.triangles) == sum(len(fans(pieces)) for pieces in columns["visible"])


def test_backprojections_need_no_light(office: Engine) -> None:
    request = OverlayRequest(BackprojectionOverlay(SurfacePoint(2.0, 1.6, 0.0)), CameraChoice())
    assert office.is_overlay_ready(request, complete=False)
    assert not office.is_overlay_ready(request, complete=True)
