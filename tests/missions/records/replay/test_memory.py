"""What a record answers, to whom and in which order; and which node of today is which of then."""

import pytest

from drivers.errors import DeviceFault
from missions.plugins.records.replay.recorded_answers import NoRecordedAnswerError, RecordedAnswers, RecordedCommand
from missions.plugins.records.replay.status_comparison import NodePlace, pair_nodes


class Heard:
    """What a memory tells."""

    def __init__(self) -> None:
        self.unheard: list[str] = []
        self.otherwise: list[tuple[str, str | None, str | None]] = []
        self.memory = RecordedAnswers(on_unanswered=self.unheard.append, on_different_command=self._otherwise)

    def _otherwise(self, part: str, then: RecordedCommand | None, now: RecordedCommand | None) -> None:
        self.otherwise.append((part, None if then is None else str(then), None if now is None else str(now)))


def test_a_question_is_answered_in_order_and_then_as_the_last_time() -> None:
    memory = Heard().memory
    memory.begin_tick([("head", "pose", (), 1), ("head", "look", ("there",), None), ("head", "pose", (), 2)])
    assert [memory.answer("head", "pose") for _ in range(3)] == [1, 2, 2]
    memory.end_tick()
    memory.begin_tick([])
    assert memory.answer("head", "pose") == 2


def test_nan_command_matches_the_recorded_one() -> None:
    heard = Heard()
    heard.memory.begin_tick([("base", "drive", (float("nan"),), DeviceFault("cannot drive at nan"))])
    with pytest.raises(DeviceFault, match="nan"):
        heard.memory.command("base", "drive", lambda: None, float("nan"))
    assert heard.otherwise == []


def test_unasked_answer_is_kept_for_later_ticks() -> None:
    memory = Heard().memory
    memory.begin_tick([("ranger", "scan", (), "far")])
    memory.end_tick()
    memory.begin_tick([])
    assert memory.answer("ranger", "scan") == "far"


def test_query_with_argument_gets_its_own_answer_or_the_newest() -> None:
    memory = Heard().memory
    memory.begin_tick([("voice", "done", (1,), True), ("voice", "done", (2,), False)])
    assert memory.answer("voice", "done", 2) is False
    assert memory.answer("voice", "done", 1) is True
    assert memory.answer("voice", "done", 3) is True


def test_an_error_is_an_answer() -> None:
    memory = Heard().memory
    memory.begin_tick(
        [("base", "state", (), DeviceFault("base: too hot")), ("base", "drive", (1,), DeviceFault("base: no"))]
    )
    with pytest.raises(DeviceFault, match="too hot"):
        memory.answer("base", "state")
    with pytest.raises(DeviceFault, match="no"):
        memory.command("base", "drive", lambda: None, 1)


def test_none_is_an_answer() -> None:
    heard = Heard()
    heard.memory.begin_tick([("sight", "looked", (), None)])
    assert heard.memory.answer("sight", "looked") is None
    assert heard.unheard == []


def test_query_without_recorded_answer_is_reported() -> None:
    heard = Heard()
    heard.memory.begin_tick([])
    with pytest.raises(NoRecordedAnswerError, match="no recorded reply"):
        heard.memory.answer("arm", "states")
    assert heard.unheard == ["arm.states"]


def test_different_missing_and_extra_commands_are_reported() -> None:
    heard = Heard()
    memory = heard.memory
    memory.begin_tick([("base", "drive", (1,), "yes"), ("base", "stop", (None,), None)])
    assert memory.command("base", "drive", lambda: "guessed", 1) == "yes"
    assert heard.otherwise == []
    memory.end_tick()
    assert heard.otherwise == [("base", "stop()", None)]
    memory.begin_tick([("base", "drive", (1,), "yes")])
    assert memory.command("base", "drive", lambda: "guessed", 2) == "guessed"
    assert memory.command("base", "drive", lambda: "guessed", 3) == "guessed"
    memory.end_tick()
    assert heard.otherwise[1:] == [("base", "drive(1)", "drive(2)"), ("base", None, "drive(3)")]


def tree(*words: str) -> list[NodePlace]:
    """Return the places of nodes, each a kind and perhaps a name, with the keys 0, 1 and so on."""
    split = [(word.partition(" ")[0], word.rpartition(" ")[2]) for word in words]
    return [NodePlace(str(key), kind, name, "", 0) for key, (kind, name) in enumerate(split)]


@pytest.mark.parametrize(
    ("now", "pairs"),
    [
        (["sequence", "look", "say hello"], {"0": "0", "1": "1", "2": "2"}),
        (["sequence", "log", "look", "say hello"], {"0": "0", "1": "2", "2": "3"}),
        (["selector", "sequence", "look", "say hello"], {"0": "1", "1": "2", "2": "3"}),
        (["sequence", "say hello"], {"0": "0", "2": "1"}),
        (["sequence", "look", "say goodbye"], {"0": "0", "1": "1", "2": "2"}),
        (["sequence", "look", "gesture"], {"0": "0", "1": "1"}),
        (["race"], {}),
    ],
)
def test_nodes_are_known_again(now: list[str], pairs: dict[str, str]) -> None:
    assert pair_nodes(tree("sequence", "look", "say hello"), tree(*now)) == pairs
