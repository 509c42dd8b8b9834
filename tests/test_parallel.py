"""Ranges over threads: every index once, nested calls, exceptions."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from threadpoolctl import threadpool_info

from solver.parallel import core_count, run_chunks


@given(st.integers(0, 500), st.integers(1, 100), st.none() | st.integers(1, 50))
def test_every_index_once(count: int, chunk: int, least: int | None) -> None:
    hits = np.zeros(count, dtype=np.int64)

    def work(start: int, stop: int) -> None:
        assert stop - start <= chunk
        hits[start:stop] += 1

    run_chunks(work, count, chunk, least)
    assert np.all(hits == 1)


def test_nested_calls_end_though_all_threads_are_taken() -> None:
    hits = np.zeros((4 * core_count(), 64), dtype=np.int64)

    def outer(start: int, stop: int) -> None:
        for row in range(start, stop):

            def inner(first: int, last: int, row: int = row) -> None:
                hits[row, first:last] += 1

            run_chunks(inner, 64, 4)

    run_chunks(outer, len(hits), 1)
    assert np.all(hits == 1)


@pytest.mark.parametrize("bad", [0, 7])
def test_an_exception_of_a_piece_is_raised_after_all_have_ended(bad: int) -> None:
    hits = np.zeros(8, dtype=np.int64)

    def work(start: int, stop: int) -> None:
        hits[start:stop] += 1
        if start == bad:
            raise ValueError("broken piece")

    with pytest.raises(ValueError, match="broken piece"):
        run_chunks(work, 8, 1)


def test_blas_has_no_threads_that_wait_in_a_loop() -> None:
    # That of scipy, which the project does without, comes when tests ask for it.
    threads = [
        pool["num_threads"]
        for pool in threadpool_info()
        if pool["user_api"] == "blas" and "numpy" in pool["filepath"]
    ]
    assert threads == [1]
