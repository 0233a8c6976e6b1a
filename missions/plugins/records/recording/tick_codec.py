"""Encoding of tick records, in which an unchanged reply is not repeated.

Of an unchanged reply only the query is written. Each chunk of the file starts without known replies. So a chunk can be
decoded without those before it, and a lost chunk affects no other.
"""

from collections.abc import Mapping
from functools import lru_cache
from typing import Any, get_args

from missions.codec import number
from missions.executive.tick_record import Answer, TickKind, TickRecord
from missions.plugins.records.recording.tagged_values import dumps, from_json, tag_value, untag_value
from missions.plugins.records.recording.validation import check_time

TICK_KINDS = frozenset(get_args(TickKind))
"""Values of the field ``kind`` of a tick record."""

QUESTION_LENGTH = 3
"""Number of elements of the encoded query; an encoded reply that has not changed consists of the query only."""


class TickEncoder:
    """Encoder of tick records, which remembers the last reply to each query, and writes it only if it has changed."""

    def __init__(self) -> None:
        self._last_answers: dict[bytes, bytes] = {}

    def reset(self) -> None:
        """Encode the next reply to every query in full."""
        self._last_answers.clear()

    def encode(self, tick_record: TickRecord) -> bytes:
        """Return a tick record as the bytes of a message."""
        fields = {
            "t": tick_record.t,
            "kind": tick_record.kind,
            "tick": tick_record.tick,
            "late": number(tick_record.late),
            "spent": number(tick_record.spent),
            "overheld": tick_record.overheld,
        }
        try:
            answers = b",".join(self._encode_answer(*answer) for answer in tick_record.answers)
        except Exception:
            self.reset()  # the message is not written, so its replies are unknown to the decoder
            raise
        return dumps(fields)[:-1] + b',"answers":[' + answers + b"]}"

    def _encode_answer(self, part: str, what: str, arguments: tuple[object, ...], value: object) -> bytes:
        question = _question(part, what, arguments) if arguments else _cached_question(part, what)
        encoded = dumps(tag_value(value))
        if self._last_answers.get(question) == encoded:
            return question
        self._last_answers[question] = encoded
        return question[:-1] + b"," + encoded + b"]"


def _question(part: str, what: str, arguments: tuple[object, ...]) -> bytes:
    return dumps([part, what, [tag_value(each) for each in arguments]])


@lru_cache(maxsize=256)
def _cached_question(part: str, what: str) -> bytes:
    """Return an encoded query without arguments; cached, since a run repeats the same few in every tick."""
    return _question(part, what, ())


class TickDecoder:
    """Decoder of tick records, which remembers the last reply to each query.

    Messages must be decoded in the order in which they were written.
    """

    def __init__(self) -> None:
        self._last_answers: dict[Any, object] = {}

    def decode(self, data: Mapping[str, Any]) -> TickRecord:
        """Return the tick record of a message. Raises LookupError, TypeError or ValueError for invalid messages."""
        overheld, kind = data["overheld"], data["kind"]
        if kind not in TICK_KINDS:
            raise ValueError(f"{kind!s:.40} is not a tick kind")
        return TickRecord(
            kind,
            from_json(data["tick"], int),
            data["t"],
            check_time(data["late"]),
            check_time(data["spent"]),
            [self._decode_answer(answer) for answer in data["answers"]],
            None if overheld is None else (overheld[0], overheld[1]),
        )

    def _decode_answer(self, data: list[Any]) -> Answer:
        question = dumps(data[:QUESTION_LENGTH])
        if len(data) > QUESTION_LENGTH:
            self._last_answers[question] = untag_value(data[QUESTION_LENGTH])
        return data[0], data[1], tuple(untag_value(each) for each in data[2]), self._last_answers[question]
