"""A voice that keeps what it says, and eyes that see what a test has set."""

from collections.abc import Sequence

from drivers.clock import ManualClock
from missions.testing.recorders.recorder import CANCEL, Recorder
from perception.api import Box, Face, Marker, Scene, Thing


class RecordedWords:
    """A ``drivers.api.Utterance``; the test sets ``ended``."""

    def __init__(self, voice: "RecordedVoice") -> None:
        self.ended = False
        self._voice = voice

    def done(self) -> bool:
        """True once the test, or a cancellation, has ended it."""
        return self.ended

    def cancel(self) -> None:
        """Keep the cancellation, and end."""
        self.ended = True
        self._voice.keep_anyway(CANCEL)


class RecordedVoice(Recorder):
    """A ``drivers.api.Voice``: keeps each text as it is, and the utterances in ``said``."""

    def __init__(self, clock: ManualClock) -> None:
        super().__init__("voice", clock)
        self.said: list[RecordedWords] = []

    def say(self, text: str) -> RecordedWords:
        """Keep the text."""
        self.keep(text)
        self.said.append(RecordedWords(self))
        return self.said[-1]


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


def face(
    stamp: float, *, number: int = 1, bearing: float = 0.0, drop: float = 0.0, yaw: float = 0.0, pitch: float = 0.0
) -> Face:
    """Return a face that stands still, seen at ``stamp``; angles in radians."""
    return Face(
        number,
        stamp,
        Box(300, 220, 40, 40),
        bearing=bearing,
        drop=drop,
        yaw=yaw,
        pitch=pitch,
        yaw_rate=0.0,
        pitch_rate=0.0,
        distance=1.5,
    )
