"""Something that a voice with a thread of its own says or plays, and how far that has come."""

from collections.abc import Callable, Sequence
from pathlib import Path
from threading import Event

from drivers.api import Manner, MouthShape, Priority


class SpokenWords:
    """A ``drivers.api.Utterance``: a text, or the file at ``path``. ``ended`` is set once it was heard or cancelled.

    ``drop`` takes it out of its voice.
    """

    def __init__(
        self, drop: "Callable[[SpokenWords], None]", text: str, manner: Manner, priority: Priority, path: Path | None
    ) -> None:
        self.text = text
        self.manner = manner
        self.priority = priority
        self.path = path
        self.ended = Event()
        self.cancelled = False
        self.seconds = 0.0
        self.shapes: Sequence[MouthShape] = ()
        self._drop = drop
        self._started: float | None = None

    def done(self) -> bool:
        """True once it was heard to the end, or cancelled."""
        return self.ended.is_set()

    def cancel(self) -> None:
        """Fall silent now."""
        self._drop(self)

    @property
    def started(self) -> float | None:
        """When its first sample was heard; of a program that plays by itself, when that was started."""
        return self._started

    @property
    def mouth(self) -> Sequence[MouthShape]:
        """How the mouth moves with it."""
        return () if self._started is None else self.shapes

    @property
    def end(self) -> float:
        """When it will have been heard."""
        return (self._started or 0.0) + self.seconds

    def begin(self, at: float, seconds: float) -> None:
        """Note that it is heard from ``at`` on."""
        self._started, self.seconds = at, seconds

    def forget(self) -> None:
        """Forget a beginning that came to no end: it waits again."""
        if not self.done():
            self._started = None
