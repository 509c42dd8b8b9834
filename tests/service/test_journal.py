"""The journal: what is written is there again, and a session recollected from it stands as it stood."""

from __future__ import annotations

import asyncio
import sqlite3
import threading
from collections.abc import Awaitable, Callable, Iterator
from pathlib import Path
from typing import Any, TypeVar

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from service.journal import recollection, store
from service.journal.documents import (
    ConfigureStep,
    EditStep,
    RedoStep,
    Step,
    UndoStep,
    read_snapshot,
    read_step,
    text_of,
)
from service.journal.journal import Journal
from service.journal.recollection import Recollection, snapshot_of
from service.journal.store import JournalError, Kept, KeyedAnswer, Stands, Store, Whole
from solver.document.conversion import document_of
from solver.document.limits import SceneLimits
from solver.document.settings import SettingsDocument
from solver.engine import history
from solver.engine.engine import Engine
from solver.engine.history import NothingToReverseError
from solver.engine.past import Past
from solver.illumination.settings import LightSettings
from tests.engine.acting import edits
from tests.engine.scenes import box

T = TypeVar("T")

LOOSE = LightSettings(error_tolerance=0.5)
KEPT = Kept("a", "ann", "box", 1, b"{}", 5.0)


def move(x: float) -> dict[str, Any]:
    return {"op": "move", "id": "crate", "transform": {"translation": [x, 0.5, 0.5]}}


def turn(x: float) -> dict[str, Any]:
    matrix = [1, 0, 0, x, 0, 0, -1, 0.5, 0, 1, 0, 0.5, 0, 0, 0, 1]
    return {"op": "move", "id": "crate", "transform": {"matrix": matrix}}


def paint(grey: float) -> dict[str, Any]:
    return {"op": "set_material", "id": "floor", "material": {"reflectance": [grey] * 3}}


def with_journal(directory: Path | None, work: Callable[[Journal], Awaitable[T]]) -> T:
    async def run() -> T:
        journal = Journal(directory)
        journal.open()
        try:
            return await work(journal)
        finally:
            await journal.close()

    return asyncio.run(run())


def stands(revision: int) -> Stands:
    return Stands(revision, None, 6.0)


def test_what_is_written_is_there_again(tmp_path: Path) -> None:
    async def write(journal: Journal) -> None:
        await journal.run(lambda s: s.begin(KEPT, b"snapshot"))
        await asyncio.gather(
            *(
                journal.run(lambda s, n=n: s.append("a", f"{n}".encode(), stands(n)))  # type: ignore[misc]
                for n in range(2, 102)
            )
        )

    async def read(journal: Journal) -> tuple[Whole, list[Kept]]:
        return await journal.run(lambda s: (s.whole("a"), s.sessions()))

    with_journal(tmp_path, write)
    whole, kept = with_journal(tmp_path, read)
    assert whole.snapshot == b"snapshot"
    assert whole.steps == tuple(f"{n}".encode() for n in range(2, 102))
    assert kept == [Kept("a", "ann", "box", 101, b"{}", 6.0)]


def test_what_fails_takes_nothing_else_with_it() -> None:
    async def run(journal: Journal) -> None:
        held = threading.Event()
        waiting = asyncio.create_task(journal.run(lambda s: held.wait()))
        begun = asyncio.create_task(journal.run(lambda s: s.begin(KEPT, b"snapshot")))

        def half(tables: Store) -> None:
            tables.append("a", b"half", stands(2))
            tables.append("nobody", b"no", stands(2))

        failing = asyncio.create_task(journal.run(half))
        await asyncio.sleep(0.05)
        held.set()
        assert await waiting
        await begun
        with pytest.raises(JournalError):
            await failing
        assert (await journal.run(lambda s: s.whole("a"))).steps == ()

    with_journal(None, run)


def test_nothing_stays_of_what_is_forgotten() -> None:
    async def run(journal: Journal) -> None:
        await journal.run(lambda s: s.begin(KEPT, b"snapshot"))
        told = KeyedAnswer("key", b"digest", b"answer")
        await journal.run(lambda s: s.append("a", b"step", stands(2), told))
        assert await journal.run(lambda s: s.answer("a", "key")) == told
        await journal.run(lambda s: s.forget("a"))
        with pytest.raises(JournalError):
            await journal.run(lambda s: s.whole("a"))
        await journal.run(lambda s: s.begin(KEPT, b"other"))
        assert await journal.run(lambda s: s.whole("a")) == Whole(b"other", (), 0)
        assert await journal.run(lambda s: s.answer("a", "key")) is None

    with_journal(None, run)


def test_a_fold_that_comes_too_late_does_nothing() -> None:
    async def run(journal: Journal) -> None:
        await journal.run(lambda s: s.begin(KEPT, b"old"))
        await journal.run(lambda s: s.append("a", b"1", stands(2)))
        last = (await journal.run(lambda s: s.whole("a"))).last
        await journal.run(lambda s: s.append("a", b"2", stands(3)))
        await journal.run(lambda s: s.fold("a", b"folded", last))
        assert await journal.run(lambda s: s.whole("a")) == Whole(b"folded", (b"2",), last + 1)
        await journal.run(lambda s: s.replace(KEPT, b"restored"))
        await journal.run(lambda s: s.fold("a", b"late", last + 1))
        assert await journal.run(lambda s: s.whole("a")) == Whole(b"restored", (), 0)

    with_journal(None, run)


def test_only_so_many_answers_are_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(store, "KEPT_ANSWERS", 2)

    async def run(journal: Journal) -> None:
        await journal.run(lambda s: s.begin(KEPT, b""))
        for key in "xyz":
            told = KeyedAnswer(key, b"", b"")
            await journal.run(lambda s, told=told: s.append("a", b"", stands(2), told))  # type: ignore[misc]
        found = [await journal.run(lambda s, key=key: s.answer("a", key)) for key in "xyz"]  # type: ignore[misc]
        assert [answer is not None for answer in found] == [False, True, True]

    with_journal(None, run)


def test_a_directory_belongs_to_one_service(tmp_path: Path) -> None:
    async def run(_: Journal) -> None:
        with pytest.raises(JournalError, match="another service"):
            Journal(tmp_path).open()

    with_journal(tmp_path, run)


def test_tables_of_another_format_are_left_alone(tmp_path: Path) -> None:
    (tmp_path / "d").mkdir()
    file = tmp_path / "d" / "sessions.sqlite3"
    tables = sqlite3.connect(file)
    tables.execute("PRAGMA user_version = 7")
    tables.close()
    with pytest.raises(JournalError, match="format is 7"):
        Journal(tmp_path / "d").open()
    file.write_bytes(b"no tables at all" * 1000)
    with pytest.raises(JournalError, match="cannot be kept"):
        Journal(tmp_path / "d").open()
    (tmp_path / "file").touch()
    with pytest.raises(JournalError, match="cannot be kept"):
        Journal(tmp_path / "file").open()


def told(engine: Engine) -> list[tuple[int, int, str, str]]:
    return [(entry.entry, entry.revision, entry.op, entry.id) for entry in engine.log()]


@settings(deadline=None, max_examples=25)
@given(
    st.lists(st.sampled_from(["paint", "move", "turn", "undo", "redo", "configure"]), max_size=12),
    st.integers(0, 12),
    st.sampled_from([2, 1000]),
)
def test_a_session_is_recollected_as_it_stood(deeds: list[str], cut: int, kept: int) -> None:
    """Wherever the steps are folded into a snapshot, and however many batches are kept."""
    with pytest.MonkeyPatch().context() as patch:
        patch.setattr(history, "KEPT", kept)
        patch.setattr(recollection, "KEPT", kept)
        engine = Engine(box(), LOOSE)
        written = [read_step(text_of(step)) for step in lived(engine, deeds)]
        origin = snapshot_of(Past(box()), LOOSE)
        folded = read_snapshot(text_of(Recollection(origin, written[:cut]).snapshot()))
        found = Recollection(folded, written[cut:])
        risen = Engine(found.past(), found.settings)
        assert (risen.revision, risen.settings) == (engine.revision, engine.settings)
        assert told(risen) == told(engine)
        assert document_of(risen.scene) == document_of(engine.scene)
        for reverse in ("redo", "undo"):
            while taken(engine, reverse):
                assert taken(risen, reverse)
                assert document_of(risen.scene) == document_of(engine.scene)
            assert not taken(risen, reverse)
        assert told(risen) == told(engine)


def lived(engine: Engine, deeds: list[str]) -> Iterator[Step]:
    """The steps that the engine takes."""
    for number, deed in enumerate(deeds):
        match deed:
            case "undo":
                if taken(engine, deed):
                    yield UndoStep(step="undo")
            case "redo":
                if taken(engine, deed):
                    yield RedoStep(step="redo")
            case "configure":
                changes = SettingsDocument(error_tolerance=0.5 - 0.01 * number)
                engine.configure(changes.changes_to(engine.settings))
                yield ConfigureStep(step="configure", settings=changes)
            case _:
                batch = edits({"paint": paint, "move": move, "turn": turn}[deed](0.01 * number))
                engine.apply(batch)
                yield EditStep(step="edit", edits=list(batch))


def taken(engine: Engine, reverse: str) -> bool:
    """Whether there was anything to undo or redo."""
    try:
        getattr(engine, reverse)()
    except NothingToReverseError:
        return False
    return True


def test_a_snapshot_limits_nothing_more_than_a_scene() -> None:
    past = Past(box(), batches=(tuple(edits(paint(0.1))),))
    again = Recollection(read_snapshot(text_of(snapshot_of(past, LOOSE)))).past()
    _, scene = again.history(SceneLimits())
    assert scene.object("floor").material.reflectance.tolist() == [0.1] * 3
