"""What a gesture joins: in the history of an engine, and in what is recollected of it."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st

from service.journal.documents import EditStep, RedoStep, Step, UndoStep
from service.journal.recollection import Recollection, snapshot_of
from solver.document.edits import MoveEdit
from solver.document.models import TransformDocument
from solver.engine.engine import Engine
from solver.engine.history import NothingToReverseError
from solver.engine.past import Past
from solver.illumination.settings import LightSettings
from tests.engine.scenes import box

SETTINGS = LightSettings(error_tolerance=0.5)

gestures = st.sampled_from([None, "first", "second"])
objects = st.sampled_from(["crate", "lamp"])
steps = st.lists(st.tuples(gestures, objects) | st.sampled_from(["undo", "redo"]), max_size=12)


@settings(max_examples=25)
@given(steps=steps, folded_after=st.integers(0, 12))
def test_what_is_recollected_undoes_as_the_engine_does(
    steps: list[tuple[str | None, str] | str], folded_after: int
) -> None:
    engine = Engine(box(), SETTINGS)
    recollection = Recollection(snapshot_of(Past(box()), SETTINGS))
    written: list[Step] = []
    for number, step in enumerate(steps):
        if number == folded_after:
            recollection = Recollection(Recollection(snapshot_of(Past(box()), SETTINGS), written).snapshot())
            written.clear()
        try:
            match step:
                case "undo":
                    engine.undo()
                    written.append(UndoStep(step="undo"))
                case "redo":
                    engine.redo()
                    written.append(RedoStep(step="redo"))
                case (gesture, name):
                    place = TransformDocument(translation=[0.0, 0.0, 0.01 * (number + 1)])
                    edit = MoveEdit(op="move", id=name, transform=place)
                    engine.apply([edit], gesture=gesture)
                    written.append(EditStep(step="edit", edits=[edit], gesture=gesture))
        except NothingToReverseError:
            continue
    told = Recollection(recollection.snapshot(), written).past()
    other = Engine(told, SETTINGS)
    assert other.revision == engine.revision
    while True:
        places = [[o.transform.matrix.tolist() for o in each.scene] for each in (engine, other)]
        assert places[0] == places[1]
        try:
            engine.undo()
        except NothingToReverseError:
            break
        other.undo()
