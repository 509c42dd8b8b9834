"""Sampled solutions: unbiased means, an error that tells the truth, and an engine that works with them."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from solver.engine import sampled as sampled_solver
from solver.engine import solution
from solver.engine.drawing import Drawing
from solver.engine.engine import Engine
from solver.engine.overlays.base import NotReadyError, OverlayRequest
from solver.engine.overlays.elements import MeshOverlay
from solver.engine.overlays.samples import SamplesOverlay
from solver.engine.requests import CameraChoice, FrameRequest, NotAvailableError, RendererName
from solver.engine.sampled import SampledSolver
from solver.engine.status import SessionState
from solver.engine.world import World
from solver.geometry.scene import Mesh, SceneObject
from solver.pathtracing import PathTracer
from solver.transport.field import SolveOutcome
from solver.transport.settings import SolverSettings
from solver.types import LUMINANCE_WEIGHTS, AnyArray
from tests.engine.acting import LOOSE, edits, settle
from tests.engine.scenes import box
from tests.pathtracing.worlds import CUBE, INWARD, material, world
from tests.transport.solving import furnace, lit_cube

WALLS = np.array(
    json.loads((Path(__file__).parents[1] / "data" / "reference" / "cube.json").read_text())["cases"][
        "A_uniform_rho_ceiling_light"
    ]["true_mean_H"]
)
"""W/m2 on the walls of the lit cube"""


def sampled(of: World, settings: SolverSettings) -> SampledSolver:
    """Finished."""
    solver = SampledSolver(of.surfaces, of.rays, settings)
    while solver.step(10.0):
        pass
    return solver


@pytest.fixture(autouse=True)
def coarse(monkeypatch: pytest.MonkeyPatch) -> None:
    """Begin with few elements, which have many passes then."""
    monkeypatch.setattr(sampled_solver, "FIRST_AREA", 1.0 / 200.0)


# --- the light ---


def test_a_furnace_is_as_bright_everywhere() -> None:
    solver = sampled(furnace(0.5), SolverSettings(error_tolerance=0.04))
    assert solver.outcome is SolveOutcome.CONVERGED
    assert solver.statistics().closed
    field = solver.field()
    off = field.irradiance @ LUMINANCE_WEIGHTS / 2.0 - 1.0
    # How the passes fall depends on the clock, and an RMS over some hundred elements scatters by itself.
    assert solver.error_estimate <= 0.04
    assert np.sqrt(field.area @ off**2 / field.area.sum()) < 1.25 * solver.error_estimate
    scatter = solver.error_estimate / np.sqrt(len(field.area))
    assert abs(field.area @ off / field.area.sum()) < 4.0 * scatter


def test_walls_of_a_lit_cube_agree_with_the_reference() -> None:
    solver = sampled(lit_cube(), SolverSettings(error_tolerance=0.025))
    field = solver.field()
    area = np.bincount(field.patch, field.area)
    mean, square = (
        np.bincount(field.patch, field.area * v) / area
        for v in (field.irradiance[:, 0], field.irradiance[:, 0] ** 2)
    )
    # All errors of elements are noise and independent: those of walls are as much less as elements are many.
    noise = solver.error_estimate * np.sqrt(square / np.bincount(field.patch))
    assert np.all(noise < 0.01 * mean)
    assert np.all(np.abs(mean - WALLS) < 4.0 * noise), (mean, WALLS, noise)


def measured_errors(of: World, solver: SampledSolver, samples: int = 4096) -> tuple[float, float]:
    """Relative RMS error of the reflected luminance, and part of it by the noise of the witness."""
    field, surfaces = solver.field(), of.surfaces
    truth, noise = PathTracer(surfaces, of.rays, 77).mean_irradiance(
        field.corners, field.corner_count, field.patch, samples
    )
    weights = surfaces.reflectance[field.patch] * LUMINANCE_WEIGHTS
    off, y, e = (np.einsum("nc,nc->n", v, weights) for v in (field.irradiance - truth, truth, noise))
    norm = field.area @ y**2
    return float(np.sqrt(field.area @ off**2 / norm)), float(np.sqrt(field.area @ e**2 / norm))


@pytest.mark.parametrize("tolerance", [0.1, 0.04])
def test_the_estimate_covers_the_error(tolerance: float) -> None:
    of = World.of(box())
    solver = sampled(of, SolverSettings(error_tolerance=tolerance))
    assert solver.outcome is SolveOutcome.CONVERGED
    error, noise = measured_errors(of, solver, 1024)
    assert solver.error_estimate <= tolerance
    assert np.sqrt(max(0.0, error**2 - noise**2)) <= 1.25 * solver.error_estimate, "which scatters, too"
    assert error > 0.1 * solver.error_estimate, "the estimate is no mere bound"


def test_noise_falls_with_the_square_root_of_the_paths() -> None:
    """Between two moments of one solve whose elements stay the same."""
    of = lit_cube()
    solver = SampledSolver(of.surfaces, of.rays, SolverSettings(error_tolerance=1e-3, max_elements=0))
    rays: list[int] = []
    errors: list[float] = []
    while solver.statistics().rays < 400_000:
        solver.step(0.0)
        if solver.error_estimate < 1.0 and solver.statistics().rays > 2 * (rays[-1] if rays else 0):
            rays.append(solver.statistics().rays)
            errors.append(measured_errors(of, solver, 1 << 14)[0])
    slope = np.polyfit(np.log(rays), np.log(errors), 1)[0]
    assert -0.8 < slope < -0.3, (rays, errors)


def test_elements_split_where_light_varies() -> None:
    """On the floor below the crate, whose shadow has edges, and less in the open."""
    of = World.of(box())
    field = sampled(of, SolverSettings(error_tolerance=0.03)).field()
    floor = field.patch == 0
    assert field.area[floor].min() < 0.5 * field.area[floor].max()
    middle = field.corners[floor].mean(axis=1)
    shadow = np.abs(middle[:, :2] - 0.5).max(axis=1) < 0.45
    assert field.area[floor][shadow].mean() < 0.8 * field.area[floor][~shadow].mean()


def test_limits_end_the_work_and_are_told() -> None:
    of = World.of(box())
    loose = SolverSettings(error_tolerance=0.03)
    for settings, outcome in (
        (replace(loose, max_elements=40), SolveOutcome.ELEMENT_LIMIT),
        (replace(loose, minimum_area=0.5), SolveOutcome.MINIMUM_AREA),
    ):
        solver = sampled(of, settings)
        assert solver.outcome is outcome
        assert outcome.value in solver.warnings
        assert solver.error_estimate > 0.03
        assert len(solver.field().area) <= 40


def test_without_lamps_it_is_dark_and_known_to_be() -> None:
    dark = world(SceneObject("walls", Mesh(CUBE, INWARD), material(0.5)))
    solver = sampled(dark, SolverSettings())
    assert (solver.outcome, solver.error_estimate) == (SolveOutcome.CONVERGED, 0.0)
    assert not solver.field().irradiance.any()
    _, error = solver.irradiance_at(np.full((1, 3), 0.5), np.array([[0.0, 0.0, 1.0]]))
    assert error[0] == 0.0


def test_the_field_always_belongs_to_the_elements() -> None:
    """Also between a split and its samples: frames, picks and overlays take elements by their place in it."""
    of = World.of(box())
    solver = SampledSolver(of.surfaces, of.rays, SolverSettings(error_tolerance=0.03))
    told, version, field = [1.0], -1, solver.field()
    while solver.step(0.0):
        if solver.version != version:
            version, field = solver.version, solver.field()
        assert len(field.area) == len(solver.state.tree.leaves)
        told.append(solver.error_estimate)
    assert told == sorted(told, reverse=True), "what is shown gets no worse"


# --- the engine ---


@pytest.fixture
def large(monkeypatch: pytest.MonkeyPatch, drawing: Drawing) -> Engine:
    """The box, where two patches are as many as can be linked."""
    monkeypatch.setattr(solution, "MOST_LINKED", 2)
    return Engine(box(), LOOSE, drawing=drawing)


def drawn(engine: Engine, renderer: RendererName | None) -> AnyArray:
    return engine.frame(FrameRequest(renderer=renderer, samples=4)).image


def test_a_large_scene_is_sampled_and_says_so(large: Engine) -> None:
    settle(large)
    status = large.status()
    assert status.state is SessionState.CONVERGED
    assert status.statistics.links == 0
    assert 0.0 < status.error_estimate <= LOOSE.error_tolerance
    assert any("path tracing" in warning and "4 patches" in warning for warning in status.warnings)


def test_a_small_scene_is_linked_and_no_warning_given(engine: Engine) -> None:
    settle(engine)
    assert engine.status().statistics.links > 0
    assert engine.status().warnings == ()


def test_its_frames_show_what_links_would(large: Engine, settled: Engine) -> None:
    first = large.outlook(FrameRequest())
    assert first.drawable
    assert not first.converged
    settle(large)
    assert large.outlook(FrameRequest()).converged, (
        "interpolants are drawn as gouraud, and waited for no longer"
    )
    np.testing.assert_array_equal(drawn(large, None), drawn(large, RendererName.GOURAUD))
    camera = box().cameras["main"]
    truth = PathTracer(large._world.surfaces, large._world.rays).frame(camera, 64, 4)
    truth.run()
    found, linked = (np.abs(drawn(e, RendererName.GOURAUD) - truth.radiance) for e in (large, settled))
    assert found.mean() < 1.5 * linked.mean()
    assert found.mean() < 0.05 * truth.radiance.mean()


def test_gathered_frames_are_refused(large: Engine) -> None:
    with pytest.raises(NotAvailableError, match="too large to link"):
        large.outlook(FrameRequest(renderer=RendererName.GATHER))


def test_probes_know_their_own_error(large: Engine, settled: Engine) -> None:
    positions = np.array([[0.0, 0.0, 0.0], [0.9, -0.9, 0.0], [0.0, 0.0, -5.0]])
    normals = np.tile([0.0, 0.0, 2.0], (3, 1))
    found, expected = large.probe(positions, normals), settled.probe(positions, normals)
    assert np.all(found.error_estimate[:2] < 0.05)
    off = found.illuminance[:2] / expected.illuminance[:2] - 1.0
    assert np.all(np.abs(off) < 4.0 * found.error_estimate[:2] + 0.01)
    assert (found.illuminance[2], found.error_estimate[2]) == (0.0, 1.0), "dark, as far as one can see"


def test_it_is_edited_picked_and_looked_into(large: Engine) -> None:
    settle(large)
    large.apply(edits({"op": "remove", "id": "lamp"}))
    settle(large)
    assert large.status().error_estimate == 0.0
    assert not drawn(large, None).any()
    point = large.pick(CameraChoice(), 24, 24).point
    assert point is not None
    assert not point.has_interpolant
    mesh = OverlayRequest(MeshOverlay(), CameraChoice())
    assert large.is_overlay_ready(mesh, complete=False)
    assert sum(1 for _ in large.overlay(mesh)) >= 1
    with pytest.raises(NotReadyError, match="too large to link"):
        large.is_overlay_ready(OverlayRequest(SamplesOverlay(), CameraChoice()), complete=False)


def test_a_scene_may_outgrow_links_and_shrink_again(
    monkeypatch: pytest.MonkeyPatch, drawing: Drawing
) -> None:
    monkeypatch.setattr(solution, "MOST_LINKED", 3)
    engine = Engine(box(), LOOSE, drawing=drawing)
    assert engine.status().statistics.patches == 4
    for _ in range(3):
        engine.step(0.01)
    engine.apply(edits({"op": "remove", "id": "crate"}))
    settle(engine)
    assert engine.status().statistics.links > 0
    assert engine.status().state is SessionState.CONVERGED
    engine.configure(replace(LOOSE, error_tolerance=0.04))
    settle(engine)
    assert engine.status().state is SessionState.CONVERGED
