"""When a view moves, and how coarse its frames are then."""

from __future__ import annotations

from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from service.streaming.pacing import LADDER, STILL, Pace


def test_one_change_is_no_motion_and_two_in_a_row_are() -> None:
    pace = Pace()
    pace.touch(10.0)
    assert not pace.is_moving(10.0)
    assert pace.until_rest(10.0) is None
    pace.touch(10.0 + 0.9 * STILL)
    assert pace.is_moving(10.0 + 0.9 * STILL)
    assert pace.is_moving(10.0 + 1.8 * STILL)
    assert not pace.is_moving(10.0 + 2.0 * STILL)
    pace.touch(20.0)
    assert not pace.is_moving(20.0), "after a rest, one change is no motion again"


@given(st.lists(st.floats(0.001, 10.0), max_size=30))
def test_slow_frames_become_coarser_and_quick_ones_finer(times: list[float]) -> None:
    pace = Pace()
    for seconds in times:
        before = LADDER.index(pace.coarseness)
        pace.took(seconds)
        step = LADDER.index(pace.coarseness) - before
        assert step in {-1, 0, 1}
        assert step <= 0 or seconds > 0.08
        assert step >= 0 or seconds < 0.05


def test_no_step_of_the_ladder_turns_a_quick_frame_into_a_slow_one() -> None:
    pixels = [rung.scale**2 for rung in LADDER]
    assert pixels == sorted(pixels, reverse=True)
    assert max(finer / coarser for finer, coarser in pairwise(pixels)) < 2.5
