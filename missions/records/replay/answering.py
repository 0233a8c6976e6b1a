"""A robot that answers out of a record: no device is behind it, and nothing moves."""

from collections.abc import Callable, Collection, Mapping, Sequence
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any

from behaviours.robot import Other, Robot
from drivers.api import (
    AS_USUAL,
    Device,
    Manner,
    MouthShape,
    Priority,
    Utterance,
)
from drivers.api.kinds import KINDS
from drivers.api.marks import members, no_answer
from missions.executive.asked import protocol_of
from missions.executive.speaking import unusual
from missions.records.replay.memory import Memory

Groups = Mapping[str, tuple[str, ...]]
"""Groups of joints."""

NOTHING: Mapping[str, tuple[str, Groups]] = MappingProxyType({})

LETTER_TIME = 0.06
"""Seconds that a letter takes to say, where nobody knows how long it took."""

SOUND_TIME = 1.0
"""The same for a sound."""


def answering(
    parts: Collection[str],
    memory: Memory,
    now: Callable[[], float],
    *,
    eye: tuple[float, float, float],
    groups: Groups,
    others: Mapping[str, tuple[str, Groups]] = NOTHING,
) -> Robot:
    """Return a robot of these parts that answers out of ``memory``; ``now`` tells the time of the record.

    ``others`` are the kinds of further parts, with the groups of the joints of those that are arms.
    """
    fields: dict[str, Any] = {}
    further = {
        name: Other(kind, Answering(name, protocol_of(kind), memory, name), its)
        for name, (kind, its) in others.items()
        if name in parts
    }
    for kind in KINDS.values():
        if kind.name == "voice" and kind.name in parts:
            fields["voice_part"] = AnsweringVoice(memory, now)
        elif kind.name in parts:
            fields[f"{kind.field}_part"] = Answering(kind.name, protocol_of(kind.field), memory, kind.field)
    return Robot(**fields, eye=eye, groups=groups, others=further)


class Answering:
    """A part with any ``protocol`` that answers out of ``memory``, behind its proxy; see ``drivers.api.marks``.

    A command that is not as it was then is answered as its mark says: of a velocity, with what is within the limits.
    ``part`` is its name in answers.
    """

    def __init__(self, name: str, protocol: type, memory: Memory, part: str) -> None:
        self.name = name
        self._part = part
        self._memory = memory
        self._properties = {each.name for each in members(protocol).values() if each.kind == "property"}
        for each in members(protocol).values():
            match each.kind:
                case "reading" | "question":
                    setattr(self, each.name, partial(memory.ask, self._part, each.name))
                case "command" if each.command is not None:
                    setattr(self, each.name, partial(self._do, each.name, each.command.otherwise))

    def open(self) -> None:
        """Do nothing: there is nothing to open."""

    def close(self) -> None:
        """Do nothing: there is nothing to close."""

    def __getattr__(self, name: str) -> Any:
        """Return a property as it was then."""
        if name not in self._properties:
            raise AttributeError(f"{self.name} has no {name}")
        return self._memory.ask(self._part, name)

    def _do(self, what: str, otherwise: Callable[..., object], *given: object, **named: object) -> Any:
        """Return what came of a command then; a proxy gives all its arguments, in the protocol's order."""
        arguments = (*given, *named.values())
        return self._memory.command(self._part, what, partial(otherwise, self, *arguments), *arguments)


class AnsweringVoice(Answering):
    """A voice that is as long about its words as it was then."""

    def __init__(self, memory: Memory, now: Callable[[], float]) -> None:
        super().__init__("voice", Device, memory, "voice")
        self._now = now

    def say(self, text: str, manner: Manner = AS_USUAL, priority: Priority = Priority.NORMAL) -> Utterance:
        """Say nothing; what comes back is done when it was then, or after about the time that other words take."""
        return self._said(self._do("say", no_answer, text, *unusual(manner, priority)), LETTER_TIME * len(text))

    def play(self, path: Path, priority: Priority = Priority.NORMAL) -> Utterance:
        """Play nothing, as ``say`` does."""
        _, otherwise = unusual(AS_USUAL, priority)
        return self._said(self._do("play", no_answer, str(path), otherwise), SOUND_TIME)

    def speaking(self) -> Utterance | None:
        """What was heard then."""
        number: int | None = self._memory.ask("voice", "speaking")
        return None if number is None else _Recalled(self._memory, number)

    def _said(self, number: int | None, seconds: float) -> Utterance:
        return _Guessed(self._now, seconds) if number is None else _Recalled(self._memory, number)


class _Recalled:
    """Words that were said then, by their number."""

    def __init__(self, memory: Memory, number: int) -> None:
        self._number = number
        self._ask = partial(memory.ask, "voice")
        self._memory = memory

    def done(self) -> bool:
        """See drivers.api.Utterance."""
        return bool(self._ask("done", self._number))

    def cancel(self) -> None:
        """See drivers.api.Utterance."""
        self._memory.command("voice", "cancel", no_answer, self._number)

    @property
    def cancelled(self) -> bool:
        """See drivers.api.Utterance."""
        return bool(self._ask("cancelled", self._number))

    @property
    def started(self) -> float | None:
        """See drivers.api.Utterance."""
        found: float | None = self._ask("started", self._number)
        return found

    @property
    def mouth(self) -> Sequence[MouthShape]:
        """See drivers.api.Utterance."""
        found: Sequence[MouthShape] = self._ask("mouth", self._number)
        return found


class _Guessed:
    """Words that nobody said: they begin at once, and are done after some ``seconds``."""

    mouth: Sequence[MouthShape] = ()
    cancelled = False

    def __init__(self, now: Callable[[], float], seconds: float) -> None:
        self.started: float | None = now()
        self._now = now
        self._until = now() + seconds

    def done(self) -> bool:
        """See drivers.api.Utterance."""
        return self._now() >= self._until

    def cancel(self) -> None:
        """See drivers.api.Utterance."""
        self.cancelled = self.cancelled or not self.done()
        self._until = self._now()
