"""What a scene does not need changes nothing beyond the tolerance where it is done all the same."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from solver.engine.drawing import Drawing
from solver.engine.engine import Engine
from solver.engine.requests import CameraChoice, FrameRequest, LayerName, RendererName
from solver.engine.savings import COARSE_LINKS
from solver.engine.status import SessionState, Spared
from solver.geometry.scene import Camera, Scene
from solver.illumination.settings import LightSettings
from solver.transport.settings import Saving
from solver.types import LUMINANCE_WEIGHTS, FloatArray
from tests.redistribution.rooms import crate, room

SETTINGS = LightSettings(error_tolerance=0.05)
FRAME = FrameRequest(CameraChoice(width=48, height=36), RendererName.INTERPOLANT, LayerName.IRRADIANCE)


def scene() -> Scene:
    """A grey room with two crates, one of which hovers."""
    one, other = crate("crate", (0.6, 0.8, 0.0)), crate("box", (2.4, 1.0, 0.4), 0.4)
    camera = Camera(
        np.array([0.3, 0.3, 1.8]), np.array([2.5, 1.8, 0.5]), np.array([0.0, 0.0, 1.0]), 70.0, 48, 36
    )
    return replace(room(0.6).with_object(one).with_object(other), cameras={"main": camera})


class Session:
    """A settled session, and what it shows."""

    def __init__(self, drawing: Drawing, settings: LightSettings) -> None:
        engine = Engine(scene(), settings, drawing=drawing)
        self.engine = engine
        while engine.outlook(FRAME).improving or engine.step(0.1):
            engine.step(0.1)
        self.frame: FloatArray = np.asarray(engine.frame(FRAME).image, dtype=np.float64) @ LUMINANCE_WEIGHTS
        field = engine._solution.field()
        light = field.area * (field.radiosity @ LUMINANCE_WEIGHTS)
        self.flux = np.bincount(field.patch, light)
        self.area = np.bincount(field.patch, field.area)

    def savings(self) -> dict[str, Spared]:
        return {spared.saving: spared for spared in self.engine.status().savings}

    def statistic(self, name: str) -> int:
        return int(getattr(self.engine.status().statistics, name))

    def differs(self, other: Session) -> tuple[float, float]:
        """Relative RMS difference of patches and of pixels."""
        light, there = self.flux / self.area, other.flux / other.area
        of_patches = np.sqrt(self.area @ (light - there) ** 2 / (self.area @ there**2))
        of_pixels = np.sqrt(np.mean((self.frame - other.frame) ** 2) / np.mean(other.frame**2))
        return float(of_patches), float(of_pixels)


@pytest.fixture(scope="module")
def saved(drawing: Drawing) -> Session:
    return Session(drawing, SETTINGS)


def in_full(drawing: Drawing, saving: Saving) -> Session:
    return Session(drawing, replace(SETTINGS, in_full=(saving,)))


def test_the_status_tells_all_savings(saved: Session) -> None:
    told = saved.savings()
    assert set(told) == {*Saving, COARSE_LINKS}
    for spared in told.values():
        assert 0 < spared.spared <= spared.of or spared.saving == Saving.DISCONTINUITIES
        assert 0.0 <= spared.error_estimate <= 0.05
    parts = told[Saving.RAYS].error_estimate, told[COARSE_LINKS].error_estimate
    assert float(np.hypot(*parts)) == pytest.approx(saved.engine.status().error_estimate, rel=1e-9)


def test_one_channel_is_all_that_grey_light_needs(drawing: Drawing, saved: Session) -> None:
    full = in_full(drawing, Saving.CHANNELS)
    assert (saved.statistic("channels"), full.statistic("channels")) == (1, 3)
    assert full.savings()[Saving.CHANNELS].spared == 0
    assert max(saved.differs(full)) < 1e-9


def test_rays_through_empty_shafts_see_nothing(drawing: Drawing, saved: Session) -> None:
    full = in_full(drawing, Saving.SHADOW_TESTS)
    assert full.statistic("rays") > 1.5 * saved.statistic("rays")
    assert full.savings()[Saving.SHADOW_TESTS].spared == 0
    # But for rays along the very plane of the lamp's top, which graze it.
    assert full.statistic("links") == pytest.approx(saved.statistic("links"), rel=0.05)
    assert max(saved.differs(full)) < 0.1 * SETTINGS.error_tolerance


def test_few_rays_are_enough_for_weak_links(drawing: Drawing, saved: Session) -> None:
    full = in_full(drawing, Saving.RAYS)
    assert full.statistic("rays") > 5.0 * saved.statistic("rays")
    assert full.savings()[Saving.RAYS].spared == 0
    assert full.savings()[Saving.RAYS].error_estimate < saved.savings()[Saving.RAYS].error_estimate
    assert max(saved.differs(full)) < SETTINGS.error_tolerance


def test_discontinuities_left_out_are_not_seen(drawing: Drawing, saved: Session) -> None:
    full = in_full(drawing, Saving.DISCONTINUITIES)
    before, after = saved.savings()[Saving.DISCONTINUITIES], full.savings()[Saving.DISCONTINUITIES]
    assert after.spared < before.spared
    assert saved.differs(full)[1] < SETTINGS.interpolation_tolerance


def test_interpolants_that_nobody_sees_change_no_pixel(drawing: Drawing, saved: Session) -> None:
    full = in_full(drawing, Saving.INTERPOLANTS)
    assert full.savings()[Saving.INTERPOLANTS].spared == 0 < saved.savings()[Saving.INTERPOLANTS].spared
    assert np.array_equal(saved.frame, full.frame)


def test_links_kept_coarse_err_by_no_more_than_told(drawing: Drawing, saved: Session) -> None:
    finer = Session(drawing, replace(SETTINGS, error_tolerance=0.0125))
    assert finer.savings()[COARSE_LINKS].of > 2 * saved.savings()[COARSE_LINKS].of
    assert saved.differs(finer)[0] < saved.savings()[COARSE_LINKS].error_estimate


def test_what_is_spared_can_be_changed_in_a_session_at_work(drawing: Drawing, saved: Session) -> None:
    engine = Engine(scene(), SETTINGS, drawing=drawing)
    engine.configure(replace(SETTINGS, in_full=(Saving.CHANNELS,)))
    while engine.step(0.1):
        pass
    assert engine.status().state is SessionState.CONVERGED
    assert engine.status().statistics.channels == 3
    engine.configure(SETTINGS)
    while engine.step(0.1):
        pass
    assert engine.status().statistics.channels == 1
