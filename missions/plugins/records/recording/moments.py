"""Moments as messages: an answer that is as it was before is not written out again.

Of such an answer only the question stands there. What "before" is begins anew with every chunk of the file, so each
chunk can be read without those before it, and one that is lost takes nothing else along.
"""

from collections.abc import Mapping
from functools import lru_cache
from typing import Any, get_args

from missions.codec import number
from missions.executive.tick_record import Answer, Kind, TickRecord
from missions.plugins.records.recording.faults import seconds
from missions.plugins.records.recording.tagged_values import dumps, from_json, tagged, untagged

KINDS = frozenset(get_args(Kind))
"""What moments there are."""

SAME = 3
"""As long is an answer of which only the question is written."""


class Shortened:
    """Writes moments."""

    def __init__(self) -> None:
        self._before: dict[bytes, bytes] = {}

    def forget(self) -> None:
        """Write the next answer to every question in full."""
        self._before.clear()

    def written(self, moment: TickRecord) -> bytes:
        """Return a moment as the bytes of a message."""
        fields = {
            "t": moment.t,
            "kind": moment.kind,
            "tick": moment.tick,
            "late": number(moment.late),
            "spent": number(moment.spent),
            "overheld": moment.overheld,
        }
        try:
            answers = b",".join(self._answer(*answer) for answer in moment.answers)
        except Exception:
            self.forget()  # none of its answers will stand there
            raise
        return dumps(fields)[:-1] + b',"answers":[' + answers + b"]}"

    def _answer(self, part: str, what: str, arguments: tuple[object, ...], value: object) -> bytes:
        question = _question(part, what, arguments) if arguments else _plain(part, what)
        told = dumps(tagged(value))
        if self._before.get(question) == told:
            return question
        self._before[question] = told
        return question[:-1] + b"," + told + b"]"


def _question(part: str, what: str, arguments: tuple[object, ...]) -> bytes:
    return dumps([part, what, [tagged(each) for each in arguments]])


@lru_cache(maxsize=256)
def _plain(part: str, what: str) -> bytes:
    """Return a question without arguments: a run asks the same few in every tick."""
    return _question(part, what, ())


class Restored:
    """Reads moments, in the order in which they were written."""

    def __init__(self) -> None:
        self._before: dict[Any, object] = {}

    def read(self, data: Mapping[str, Any]) -> TickRecord:
        """Return the moment of a message. Raises LookupError, TypeError or ValueError for what is none."""
        overheld, kind = data["overheld"], data["kind"]
        if kind not in KINDS:
            raise ValueError(f"{kind!s:.40} is no kind of moment")
        return TickRecord(
            kind,
            from_json(data["tick"], int),
            data["t"],
            seconds(data["late"]),
            seconds(data["spent"]),
            [self._answer(answer) for answer in data["answers"]],
            None if overheld is None else (overheld[0], overheld[1]),
        )

    def _answer(self, data: list[Any]) -> Answer:
        question = dumps(data[:SAME])
        if len(data) > SAME:
            self._before[question] = untagged(data[SAME])
        return data[0], data[1], tuple(untagged(each) for each in data[2]), self._before[question]
