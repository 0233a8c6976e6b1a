"""Moments in a record: what is as before stands there once, and each chunk can be read by itself."""

import json

import pytest

from drivers.api import HeadPose, Quality, Reading, Velocity
from drivers.errors import NotConnected
from missions.executive.tick_record import Answer, TickRecord
from missions.plugins.records.recording.tick_codec import TickDecoder, TickEncoder

POSE = Reading(HeadPose(0.1, -0.2), 1.5, Quality.GOOD)
ANSWERS: list[Answer] = [
    ("head", "pose", (), POSE),
    ("sight", "looked", (), None),
    ("base", "heading_at", (1.5,), None),
    ("base", "heading_at", (2.5,), 0.25),
    ("arm", "move", ({"elbow": 0.5}, None), {"elbow": 0.5}),
]


def moment(tick: int, answers: list[Answer]) -> TickRecord:
    return TickRecord("tick", tick, tick / 20, 0.001, 1e-4, answers, ("say (1.2)", 3.5) if tick == 2 else None)


def test_tick_records_round_trip() -> None:
    written, restored = TickEncoder(), TickDecoder()
    for tick in range(1, 5):
        told = moment(tick, list(ANSWERS))
        assert restored.decode(json.loads(written.encode(told))) == told


def test_unchanged_answer_is_not_written_again() -> None:
    written = TickEncoder()
    first, second = (json.loads(written.encode(moment(tick, list(ANSWERS)))) for tick in (1, 2))
    assert [len(answer) for answer in first["answers"]] == [4] * len(ANSWERS)
    assert [len(answer) for answer in second["answers"]] == [3] * len(ANSWERS)


def test_repeated_queries_in_one_tick_keep_their_answers() -> None:
    written, restored = TickEncoder(), TickDecoder()
    turned = Reading(HeadPose(0.3, 0.0), 1.5, Quality.GOOD)
    told = moment(1, [("head", "pose", (), POSE), ("head", "look", (), POSE.value), ("head", "pose", (), turned)])
    for _ in range(2):
        assert restored.decode(json.loads(written.encode(told))) == told


def test_reset_makes_the_next_tick_record_self_contained() -> None:
    written = TickEncoder()
    written.encode(moment(1, list(ANSWERS)))
    written.reset()
    assert TickDecoder().decode(json.loads(written.encode(moment(2, list(ANSWERS))))) == moment(2, list(ANSWERS))


def test_decoder_raises_for_a_missing_earlier_answer() -> None:
    written = TickEncoder()
    written.encode(moment(1, list(ANSWERS)))
    with pytest.raises(LookupError):
        TickDecoder().decode(json.loads(written.encode(moment(2, list(ANSWERS)))))


def test_tick_that_cannot_be_encoded_does_not_affect_the_next() -> None:
    written, restored = TickEncoder(), TickDecoder()
    with pytest.raises(OverflowError):
        written.encode(moment(1, [*ANSWERS, ("base", "drive", (Velocity(10**400, 0.0),), None)]))
    assert restored.decode(json.loads(written.encode(moment(2, list(ANSWERS))))) == moment(2, list(ANSWERS))


def test_an_error_is_an_answer() -> None:
    written, restored = TickEncoder(), TickDecoder()
    told = moment(1, [("base", "drive", (Velocity(0.1, 0.0),), NotConnected("base: gone", hint="plug it in"))])
    for _ in range(2):
        ((part, what, arguments, error),) = restored.decode(json.loads(written.encode(told))).answers
        assert (part, what, arguments) == ("base", "drive", (Velocity(0.1, 0.0),))
        assert isinstance(error, NotConnected)
        assert (str(error), error.hint) == ("base: gone", "plug it in")
