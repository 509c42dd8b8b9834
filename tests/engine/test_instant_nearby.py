"""Rays that neighbours share."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from solver.engine.instant.nearby import shared_rays


@given(st.lists(st.integers(0, 3), min_size=1, max_size=60), st.integers(1, 8), st.integers(0, 100))
def test_runs_are_of_one_patch_and_short(patches: list[int], every: int, turn: int) -> None:
    patch = np.array(patches, dtype=np.int32)
    start, asked = shared_rays(patch, every, turn)
    assert (start[0], start[-1]) == (0, len(patch))
    for begin, end, who in zip(start[:-1], start[1:], asked, strict=True):
        assert begin <= who < end <= begin + every
        assert len(set(patch[begin:end])) == 1


@given(st.lists(st.integers(0, 3), min_size=1, max_size=60), st.integers(1, 8))
def test_all_have_their_turn(patches: list[int], every: int) -> None:
    patch = np.array(patches, dtype=np.int32)
    turns = np.concatenate([shared_rays(patch, every, turn)[1] for turn in range(840)])
    counts = np.bincount(turns, minlength=len(patch))
    start = shared_rays(patch, every, 0)[0]
    for begin, end in pairwise(start.tolist()):
        assert np.all(counts[begin:end] == 840 // (end - begin))


def test_a_ray_each_is_no_run() -> None:
    start, asked = shared_rays(np.array([0, 0, 1], dtype=np.int32), 1, 7)
    assert start.tolist() == [0, 1, 2, 3]
    assert asked.tolist() == [0, 1, 2]
