"""Recorders of voice, sight and hearing: they record commands, and return values set by a test."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, ClassVar, TypeVar

from drivers.api import DEFAULT_STYLE, Device, Health, MouthShape, Priority, Quality, Reading, SpeechStyle, Voice
from drivers.api.marks import members
from drivers.clock import ManualClock
from drivers.errors import NotConnected
from perception.api import Box, Face, Marker, Scene, Thing, Words

# Base class of the recorders, and helpers for expected commands.

T = TypeVar("T")
C = TypeVar("C")

STOP, HOLD, RELAX, REST, CANCEL, RECOVER = "stop", "hold", "relax", "rest", "cancel", "recover"
LATCH, ENABLE = "latch", "enable"
"""Recorded forms of commands without a value; with joints, a tuple: ``(HOLD, "elbow")``."""

OFFLINE_ERROR = NotConnected("the cable is out", hint="plug it in")


def good(value: T) -> Reading[T]:
    """Return a reading of ``value`` with good quality."""
    return Reading(value, 0.0, Quality.GOOD)


def stale(value: T) -> Reading[T]:
    """Return a reading of ``value`` that is too old: its quality is stale."""
    return Reading(value, 0.0, Quality.STALE)


def none() -> Reading[T]:
    """Return a reading without a value, as from a sensor that has not measured yet."""
    return Reading(None, 0.0, Quality.NONE)


class Spy:
    """A part that records its commands.

    If the test sets the exception ``trouble``, commands that can fail raise it instead. A command of the ``protocol``
    that has no method in the class is recorded as its name, or as a tuple of its name and arguments: ``("chirp",
    0.5)``. A query or property that has no method raises NotConnected until the test sets a value.
    """

    protocol: ClassVar[type] = Device

    def __init__(self, name: str, clock: ManualClock) -> None:
        self.name = name
        self.clock = clock
        self.commands: list[object] = []
        self.times: list[float] = []
        self.trouble: Exception | None = None

    def record(self, command: C) -> C:
        """Record a command and return it; raise the exception ``trouble`` instead if the test has set it."""
        if self.trouble is not None:
            raise self.trouble
        return self.record_always(command)

    def record_always(self, command: C) -> C:
        """Record a command and return it, even if ``trouble`` is set."""
        self.commands.append(command)
        self.times.append(self.clock.now())
        return command

    def open(self) -> None:
        """Do nothing."""

    def rest(self) -> None:
        """Record that the part was brought to rest."""
        self.record_always(REST)

    def close(self) -> None:
        """Do nothing."""

    def health(self) -> Health:
        """Return the health: connected unless in trouble."""
        return Health(self.trouble is None, str(self.trouble or ""))

    def __getattr__(self, name: str) -> Any:
        """Return a recording method for a command of the protocol that has no method here.

        A query raises NotConnected when it is called, and a property when it is read.
        """
        member = members(self.protocol).get(name)
        if member is None:
            raise AttributeError(f"{type(self).__name__} has no {name!r}")
        if member.command is not None:
            return lambda *given, **named: self._record_call(name, *given, *named.values())
        unknown = NotConnected(f"{self.name}: its {name} is not set", hint=f"set bench.{self.name}.{name}")
        if member.kind == "property":
            raise unknown
        return _raise_always(unknown)

    def _record_call(self, name: str, *arguments: object) -> None:
        self.record((name, *arguments) if arguments else name)


def _raise_always(error: NotConnected) -> Callable[..., object]:
    def ask(*_: object) -> object:
        raise error

    return ask


class RecordedUtterance:
    """A ``drivers.api.Utterance`` that has begun; the test sets ``ended`` and ``cancelled``."""

    mouth: Sequence[MouthShape] = ()

    def __init__(self, voice: "RecordedVoice") -> None:
        self.ended = self.cancelled = False
        self.started: float | None = voice.clock.now()
        self._voice = voice

    def done(self) -> bool:
        """Whether the utterance has ended or was cancelled."""
        return self.ended

    def cancel(self) -> None:
        """Record the cancellation; the utterance then counts as ended."""
        self.cancelled = self.cancelled or not self.ended
        self.ended = True
        self._voice.record_always(CANCEL)


class RecordedVoice(Spy):
    """A ``drivers.api.Voice`` that records each text, with style and priority if they are not the defaults.

    For a sound file it records the path. ``said`` has all utterances, in order.
    """

    protocol = Voice

    def __init__(self, clock: ManualClock) -> None:
        super().__init__("voice", clock)
        self.said: list[RecordedUtterance] = []

    def say(
        self, text: str, manner: SpeechStyle = DEFAULT_STYLE, priority: Priority = Priority.NORMAL
    ) -> RecordedUtterance:
        usual = manner == DEFAULT_STYLE and priority is Priority.NORMAL
        self.record(text if usual else (text, manner, priority))
        self.said.append(RecordedUtterance(self))
        return self.said[-1]

    def play(self, path: Path, priority: Priority = Priority.NORMAL) -> RecordedUtterance:
        self.record(path if priority is Priority.NORMAL else (path, priority))
        self.said.append(RecordedUtterance(self))
        return self.said[-1]

    def speaking(self) -> RecordedUtterance | None:
        """Return the first utterance that has not ended; None if all have ended."""
        return next((words for words in self.said if not words.ended), None)


class RecordedSight:
    """A ``perception.api.Sight`` whose percepts are set by the test.

    ``seen`` are the faces, ``found`` the objects and ``marked`` the markers. ``searched`` is the time of the last
    searched picture, ``shown`` the scene.
    """

    def __init__(self) -> None:
        self.seen: Sequence[Face] = ()
        self.found: Sequence[Thing] = ()
        self.marked: Sequence[Marker] = ()
        self.searched: float | None = 0.0
        self.shown: Scene | None = None

    def faces(self) -> Sequence[Face]:
        """Return the faces set by the test."""
        return self.seen

    def things(self) -> Sequence[Thing]:
        """Return the objects set by the test."""
        return self.found

    def markers(self) -> Sequence[Marker]:
        """Return the markers set by the test."""
        return self.marked

    def looked(self) -> float | None:
        """Return the time of the last search set by the test."""
        return self.searched

    def scene(self) -> Scene | None:
        """Return the scene set by the test."""
        return self.shown


class RecordedHearing:
    """A ``perception.api.Hearing``: the test sets ``understood``, ``unknown`` and ``heard_until``, or calls ``say``.

    Unless the test sets ``heard_until``, it has listened until now.
    """

    def __init__(self, clock: ManualClock) -> None:
        self.understood: tuple[Words, ...] = ()
        self.unknown: tuple[Words, ...] = ()
        self.heard_until: float | None = None
        self.loudness = -90.0
        self._clock = clock

    def say(self, phrase: str, *, seconds: float = 0.5, accepted: bool = True) -> Words:
        """Add a phrase spoken from ``seconds`` ago until now; with ``accepted=False``, one that was not recognised."""
        now, number = self._clock.now(), len(self.understood) + len(self.unknown) + 1
        words = Words(number, phrase, now - seconds, now, 3.0 if accepted else -3.0)
        if accepted:
            self.understood = (words, *self.understood)
        else:
            self.unknown = (words, *self.unknown)
        return words

    def words(self) -> Sequence[Words]:
        """Return the recognised phrases."""
        return self.understood

    def refused(self) -> Sequence[Words]:
        """Return the phrases that were not recognised."""
        return self.unknown

    def listened(self) -> float | None:
        """Return ``heard_until``, the time until which it has listened; now if the test has not set it."""
        return self._clock.now() if self.heard_until is None else self.heard_until

    def level(self) -> float:
        """Return the sound level set by the test."""
        return self.loudness


def face(
    stamp: float,
    *,
    number: int = 1,
    bearing: float = 0.0,
    elevation: float = 0.0,
    yaw: float = 0.0,
    pitch: float = 0.0,
) -> Face:
    """Return a face at rest seen at ``stamp``; angles in radians."""
    return Face(
        number,
        stamp,
        Box(300, 220, 40, 40),
        bearing=bearing,
        elevation=elevation,
        yaw=yaw,
        pitch=pitch,
        yaw_rate=0.0,
        pitch_rate=0.0,
        distance=1.5,
    )
