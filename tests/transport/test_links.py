"""The link table, and the links of a solve: each pair of points has exactly one."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from solver.transport.links import LinkBatch, LinkTable, take_ranges
from solver.types import IntArray
from solver.visibility.shafts import FULL, NONE, PARTIAL
from tests.transport.solving import shelf, solved, state_of

COLUMNS = ("p", "q", "open_exchange", "visibility", "samples", "noise", "kind", "slope_p", "slope_q")


def batch(random: np.random.Generator, n: int) -> LinkBatch:
    counts = random.integers(0, 5, n).astype(np.int32)
    return LinkBatch(
        p=random.integers(0, 100, n).astype(np.int32),
        q=random.integers(0, 100, n).astype(np.int32),
        open_exchange=random.random(n),
        visibility=random.random(n),
        samples=random.integers(0, 64, n).astype(np.int32),
        noise=random.random(n),
        kind=random.integers(0, 3, n).astype(np.int32),
        slope_p=random.random((n, 2)),
        slope_q=random.random((n, 2)),
        residual_p=random.random(n),
        residual_q=random.random(n),
        blocker_count=counts,
        blockers=random.integers(0, 1000, int(counts.sum())).astype(np.int32),
    )


def blockers(table: LinkTable) -> list[list[int]]:
    return [
        table.pool[start : start + count].tolist()
        for start, count in zip(table.blocker_start, table.blocker_count, strict=True)
    ]


def lists(of: LinkBatch) -> list[list[int]]:
    ends = np.cumsum(of.blocker_count)
    return [part.tolist() for part in np.split(of.blockers, ends[:-1])][: len(of.p)]


def rows(of: LinkTable | LinkBatch) -> list[tuple[object, ...]]:
    """Every link with all that is known of it."""
    blocked = blockers(of) if isinstance(of, LinkTable) else lists(of)
    columns = [getattr(of, name).tolist() for name in COLUMNS]
    return [(*map(str, row), str(sorted(block))) for *row, block in zip(*columns, blocked, strict=True)]


@settings(max_examples=20)
@given(
    seed=st.integers(0, 1 << 30), steps=st.lists(st.tuples(st.integers(1, 300), st.floats(0, 1)), max_size=5)
)
def test_table_holds_what_was_put_in_and_not_replaced(seed: int, steps: list[tuple[int, float]]) -> None:
    random = np.random.default_rng(seed)
    table = LinkTable()
    for count, share in steps:
        table.append(batch(random, count))
        before = rows(table)
        gone = np.flatnonzero(random.random(len(table)) < share).astype(np.int32)
        others = [batch(random, 70), batch(random, 1)]
        work = table.replace(gone, others)
        next(work)
        assert rows(table) == before, "nothing changes before it changes in one go"
        for _ in work:
            pass
        kept = [row for k, row in enumerate(before) if k not in set(gone.tolist())]
        assert sorted(rows(table)) == sorted(kept + rows(others[0]) + rows(others[1]))
        stayed = np.delete(np.arange(len(before)), gone)
        stayed = stayed[stayed < len(table)] if len(gone) > 71 else stayed
        for k in stayed[:: max(1, len(stayed) // 50)]:
            assert rows_at(table, k) == before[k], "links that stay keep their places where they can"
    np.testing.assert_array_equal(table.exchange, table.open_exchange * table.visibility)


def rows_at(table: LinkTable, row: int) -> tuple[object, ...]:
    return rows_of(table, np.array([row], dtype=np.int32))[0]


def rows_of(table: LinkTable, which: IntArray) -> list[tuple[object, ...]]:
    columns = {f.name: getattr(table, f.name)[which] for f in fields(LinkBatch) if f.name != "blockers"}
    blockers = take_ranges(table.pool, table.blocker_start[which], table.blocker_count[which])
    return rows(LinkBatch(**columns, blockers=blockers))


@given(seed=st.integers(0, 1 << 30), count=st.integers(1, 400))
def test_overwritten_removed_and_copied(seed: int, count: int) -> None:
    random = np.random.default_rng(seed)
    table = LinkTable()
    table.append(batch(random, count))
    copy, before = table.copy(), rows(table)
    chosen = np.flatnonzero(random.random(count) < 0.5).astype(np.int32)
    table.debt[:] = 7
    fresh = batch(random, len(chosen))
    table.overwrite(chosen, fresh)
    assert rows_of(table, chosen) == rows(fresh)
    assert not table.debt[chosen].any()
    others = np.setdiff1d(np.arange(count), chosen).astype(np.int32)
    assert rows_of(table, others) == [before[k] for k in others]
    table.remove(chosen)
    assert sorted(rows(table)) == sorted(before[k] for k in others)
    assert np.all(table.debt == 7)
    assert rows(copy) == before
    for _ in table.trim():
        pass
    assert sorted(rows(table)) == sorted(before[k] for k in others)
    assert len(table.pool) <= table.blocker_count.sum() + (1 << 12)


def test_stale_blockers_do_not_pile_up() -> None:
    random = np.random.default_rng(1)
    table = LinkTable()
    for _ in range(30):
        table.append(batch(random, 3000))
        for _ in table.replace(np.flatnonzero(random.random(len(table)) < 0.9).astype(np.int32), []):
            pass
    assert len(table.pool) <= max(2 * table.blocker_count.sum(), 1 << 16)
    assert table.nbytes < 4e6


def test_take_ranges() -> None:
    start = np.array([5, 0, 7, 2], dtype=np.int64)
    count: IntArray = np.array([2, 0, 3, 1], dtype=np.int32)
    values = np.arange(10, 30, dtype=np.int32)
    assert take_ranges(values, start, count).tolist() == [15, 16, 17, 18, 19, 12]
    assert len(take_ranges(values, start[:0], count[:0])) == 0


def test_every_pair_of_leaves_has_one_link() -> None:
    """Of any two facing leaves, exactly one link joins the ancestors (or selves) of both."""
    state = state_of(solved(shelf(), 0.1))
    tree, links = state.tree, state.links
    n = len(tree)
    linked = np.zeros((n, n), dtype=np.int64)
    np.add.at(linked, (links.p, links.q), 1)
    np.add.at(linked, (links.q, links.p), 1)
    # Push down: a link of a parent is one of its children.
    for e in range(n):
        if tree.parent[e] >= 0:
            linked[e] += linked[tree.parent[e]]
    for e in range(n):
        if tree.parent[e] >= 0:
            linked[:, e] += linked[:, tree.parent[e]]
    leaf = tree.leaves
    pairs = linked[np.ix_(leaf, leaf)]
    assert pairs.max() == 1
    patch = tree.patch[leaf]
    assert not pairs[patch[:, None] == patch[None]].any()
    heights = np.einsum(
        "pqkx,px->pqk",
        tree.corners[leaf][None] - tree.corners[leaf][:, None, :1],
        tree.patch_normal[patch],
    )
    front = np.all(heights > 1e-6, axis=2)
    assert np.all(pairs[front & front.T] == 1), "leaves that see each other are linked"


def test_exchange_is_at_most_either_area_and_kinds_tell_visibility() -> None:
    state = state_of(solved(shelf()))
    links = state.links
    assert set(np.unique(links.kind)) == {FULL, PARTIAL, NONE}
    smaller = np.minimum(state.tree.area[links.p], state.tree.area[links.q])
    assert np.all(links.open_exchange <= smaller * (1 + 1e-4))
    assert np.all(links.visibility[links.kind == FULL] == 1.0)
    assert np.all(links.visibility[links.kind == NONE] == 0.0)
    assert np.all((links.visibility >= 0.0) & (links.visibility <= 1.0))
    partial = links.kind == PARTIAL
    assert np.all(links.samples[~partial] == 0)
    assert np.all(links.samples[partial] > 0)
    assert np.all(links.blocker_count[partial] > 0)
    assert not links.noise[~partial].any()
