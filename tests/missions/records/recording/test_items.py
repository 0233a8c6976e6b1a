"""What goes from a run to its writer, and what of it the writer never imports."""

import copyreg
import subprocess
import sys

import pytest
from py_trees.common import Status

from config.units import Quantity
from drivers.api import HeadPose
from drivers.errors import NoReply
from missions.executive.events import NodeChanged, VariableSet
from missions.plugins.records.recording.items import EVENT_TOPICS, OpaqueValue, pack_items, unpack_items


class Mine:
    """What a user keeps in a variable."""

    def __init__(self, secret: int) -> None:
        self.secret = secret


class Row(list[int]):
    """A list of the user's own."""


class Table(dict[str, int]):
    """A dictionary of the user's own."""


class Group(set[int]):
    """A set of the user's own."""


def test_values_of_drivers_come_back_and_events_with_their_fields() -> None:
    pose, event = unpack_items(
        pack_items([HeadPose(0.1, 0.2), NodeChanged(0.5, 3, "1.2", "say", "say", 4, "running", "")])
    )
    assert pose == HeadPose(0.1, 0.2)
    assert isinstance(event, OpaqueValue)
    assert type(event).__name__ == "NodeChanged"
    assert vars(event) == {
        "t": 0.5,
        "tick": 3,
        "node": "1.2",
        "name": "say",
        "kind": "say",
        "line": 4,
        "status": "running",
        "reason": "",
    }


def test_errors_come_back_whatever_libraries_have_registered_for_pickling(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(copyreg.dispatch_table, NoReply, lambda error: (Mine, (len(str(error)),)))
    (error,) = unpack_items(pack_items([NoReply("head: silent", hint="wait")]))
    assert (type(error), str(error), error.hint) == (NoReply, "head: silent", "wait")


def test_of_a_value_of_the_user_the_name_remains() -> None:
    values = [Mine(7), Status.RUNNING, Quantity(0.5, "length", "50 cm"), Row([1, 2]), Row([3]), Table(a=1), Group({1})]
    found = [vars(each)["value"] for each in unpack_items(pack_items([_set(value) for value in values]))]
    mine, status, length, *holders = found
    assert [str(each) for each in holders] == ["<Row>", "<Row>", "<Table>", "<Group>"]
    assert str(mine) == "<Mine>"
    assert str(status) == "<Status>"
    assert length == 0.5


def _set(value: object) -> VariableSet:
    return VariableSet(1.0, 2, "", "x", value)


def test_writer_process_imports_no_run_modules() -> None:
    program = "import sys, missions.plugins.records.recording.writer_process; print(*sys.modules)"
    heard = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert not {"py_trees", "cv2", "click", "behaviours", "yaml"} & set(heard.stdout.split())


def test_every_event_is_recorded_or_contained_in_another_message() -> None:
    contained = {"Started", "Ticked", "PerceptSeen"}
    from missions.executive import events  # noqa: PLC0415 - only what it is made of is asked for

    kinds = {kind.__name__ for kind in events.Event.__subclasses__()}
    assert kinds == contained | set(EVENT_TOPICS)
