"""A voice that keeps what it says, eyes that see and ears that hear what a test has set."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, ClassVar, TypeVar

from drivers.api import DEFAULT_STYLE, Device, Health, MouthShape, Priority, Quality, Reading, SpeechStyle, Voice
from drivers.api.marks import members
from drivers.clock import ManualClock
from drivers.errors import NotConnected
from perception.api import Box, Face, Marker, Scene, Thing, Words

# The spy behind each recorder, and the words in which a test says what it should have kept.

T = TypeVar("T")
C = TypeVar("C")

STOP, HOLD, RELAX, REST, CANCEL, RECOVER = "stop", "hold", "relax", "rest", "cancel", "recover"
LATCH, ENABLE = "latch", "enable"
"""The commands without a value, as recorders keep them; with joints, as a tuple: ``(HOLD, "elbow")``."""

OFFLINE_ERROR = NotConnected("the cable is out", hint="plug it in")


def good(value: T) -> Reading[T]:
    """Return a fresh reading."""
    return Reading(value, 0.0, Quality.GOOD)


def stale(value: T) -> Reading[T]:
    """Return a reading from too long ago."""
    return Reading(value, 0.0, Quality.STALE)


def none() -> Reading[T]:
    """Return the reading of what was never measured."""
    return Reading(None, 0.0, Quality.NONE)


class Spy:
    """A part that keeps its commands: ``trouble`` is raised by every command that may raise, which is not kept.

    A command of the ``protocol`` that no method here is written for is kept as its name, or as a tuple of its name and
    arguments: ``("chirp", 0.5)``. A question or property that none is written for raises NotConnected until the test
    sets it.
    """

    protocol: ClassVar[type] = Device

    def __init__(self, name: str, clock: ManualClock) -> None:
        self.name = name
        self.clock = clock
        self.commands: list[object] = []
        self.times: list[float] = []
        self.trouble: Exception | None = None

    def record(self, command: C) -> C:
        """Keep a command, or raise the trouble."""
        if self.trouble is not None:
            raise self.trouble
        return self.record_always(command)

    def record_always(self, command: C) -> C:
        """Keep a command that is safe in any state."""
        self.commands.append(command)
        self.times.append(self.clock.now())
        return command

    def open(self) -> None:
        """Do nothing."""

    def rest(self) -> None:
        """Keep that it was told to rest."""
        self.record_always(REST)

    def close(self) -> None:
        """Do nothing."""

    def health(self) -> Health:
        """Say that it is there, unless it is in trouble."""
        return Health(self.trouble is None, str(self.trouble or ""))

    def __getattr__(self, name: str) -> Any:
        """Return a member of the protocol for which there is no method."""
        member = members(self.protocol).get(name)
        if member is None:
            raise AttributeError(f"{type(self).__name__} has no {name!r}")
        if member.command is not None:
            return lambda *given, **named: self._record_call(name, *given, *named.values())
        unknown = NotConnected(f"{self.name}: no test has set its {name}", hint=f"set bench.{self.name}.{name}")
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
    """A ``drivers.api.Utterance`` that began when it was asked for; the test sets ``ended``, and ``cancelled``."""

    mouth: Sequence[MouthShape] = ()

    def __init__(self, voice: "RecordedVoice") -> None:
        self.ended = self.cancelled = False
        self.started: float | None = voice.clock.now()
        self._voice = voice

    def done(self) -> bool:
        """True once the test, or a cancellation, has ended it."""
        return self.ended

    def cancel(self) -> None:
        """Keep the cancellation, and end."""
        self.cancelled = self.cancelled or not self.ended
        self.ended = True
        self._voice.record_always(CANCEL)


class RecordedVoice(Spy):
    """A ``drivers.api.Voice``: keeps each text as it is, with its manner and priority where those are not the usual.

    Of a sound it keeps the path; the utterances are in ``said``.
    """

    protocol = Voice

    def __init__(self, clock: ManualClock) -> None:
        super().__init__("voice", clock)
        self.said: list[RecordedUtterance] = []

    def say(
        self, text: str, manner: SpeechStyle = DEFAULT_STYLE, priority: Priority = Priority.NORMAL
    ) -> RecordedUtterance:
        """Keep the text."""
        usual = manner == DEFAULT_STYLE and priority is Priority.NORMAL
        self.record(text if usual else (text, manner, priority))
        self.said.append(RecordedUtterance(self))
        return self.said[-1]

    def play(self, path: Path, priority: Priority = Priority.NORMAL) -> RecordedUtterance:
        """Keep the path."""
        self.record(path if priority is Priority.NORMAL else (path, priority))
        self.said.append(RecordedUtterance(self))
        return self.said[-1]

    def speaking(self) -> RecordedUtterance | None:
        """Return the first that has not ended."""
        return next((words for words in self.said if not words.ended), None)


class RecordedSight:
    """A ``perception.api.Sight``: the test sets ``seen``, ``searched`` and ``shown``."""

    def __init__(self) -> None:
        self.seen: Sequence[Face] = ()
        self.found: Sequence[Thing] = ()
        self.marked: Sequence[Marker] = ()
        self.searched: float | None = 0.0
        self.shown: Scene | None = None

    def faces(self) -> Sequence[Face]:
        """Return what the test has set."""
        return self.seen

    def things(self) -> Sequence[Thing]:
        """Return what the test has set."""
        return self.found

    def markers(self) -> Sequence[Marker]:
        """Return what the test has set."""
        return self.marked

    def looked(self) -> float | None:
        """Return what the test has set."""
        return self.searched

    def scene(self) -> Scene | None:
        """Return what the test has set."""
        return self.shown


class RecordedHearing:
    """A ``perception.api.Hearing``: the test sets ``understood``, ``unknown`` and ``heard_until``, or has words said.

    It hears until now, where the test has not set another time.
    """

    def __init__(self, clock: ManualClock) -> None:
        self.understood: tuple[Words, ...] = ()
        self.unknown: tuple[Words, ...] = ()
        self.heard_until: float | None = None
        self.loudness = -90.0
        self._clock = clock

    def say(self, phrase: str, *, seconds: float = 0.5, accepted: bool = True) -> Words:
        """Have somebody say a phrase, from ``seconds`` ago until now; or something that is only near to it."""
        now, number = self._clock.now(), len(self.understood) + len(self.unknown) + 1
        words = Words(number, phrase, now - seconds, now, 3.0 if accepted else -3.0)
        if accepted:
            self.understood = (words, *self.understood)
        else:
            self.unknown = (words, *self.unknown)
        return words

    def words(self) -> Sequence[Words]:
        """Return what the test has set."""
        return self.understood

    def refused(self) -> Sequence[Words]:
        """Return what the test has set."""
        return self.unknown

    def listened(self) -> float | None:
        """Return what the test has set, else now."""
        return self._clock.now() if self.heard_until is None else self.heard_until

    def level(self) -> float:
        """Return what the test has set."""
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
    """Return a face that stands still, seen at ``stamp``; angles in radians."""
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
