"""State of a replay: current time, replay speed, and the action of each key."""

from bisect import bisect_left, bisect_right
from collections.abc import Callable, Mapping, Sequence

from missions.executive.events import Event
from missions.plugins.records.recording.run_record import RunRecord
from missions.trees.states import TIME_TOLERANCE

JUMP_TIME = 5.0
"""Seconds skipped by an arrow key."""

SPEEDS = (0.125, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0)
"""Playback speeds that the arrow keys select, relative to real time."""

KEY_HELP = "space play  ←→ jump  ↑↓ speed  , . tick  f F failure  / n N search  0-9 tenth  q quit"

BACKSPACE_KEYS = ("\x7f", "\b")


class RecordPlayer:
    """Position and speed of a replay, and its keys; ``time`` is in seconds of the run.

    ``note`` is the message about the last key, ``typing`` the search text while the user types it.
    """

    def __init__(self, record: RunRecord, *, at: float = 0.0, speed: float = 1.0) -> None:
        self.playing = True
        self.speed = speed
        self.note = ""
        self.typing: str | None = None
        self.start = 0.0 if record.cut_start is None else record.cut_start
        self.end = max(record.end_time, self.start)
        self._record = record
        self._ticks = [moment.t for moment in record.tick_records]
        self._failures = [failure.t for failure in record.failures()]
        self._matches: Sequence[Event] = ()
        self.time = self._clamp(at)
        self._keys: Mapping[str, Callable[[], None]] = {
            " ": self._play_or_pause,
            "left": lambda: self._go_to(self.time - JUMP_TIME),
            "right": lambda: self._go_to(self.time + JUMP_TIME),
            "up": lambda: self._change_speed(faster=True),
            "down": lambda: self._change_speed(faster=False),
            ".": lambda: self._jump(self._ticks, "tick"),
            ",": lambda: self._jump(self._ticks, "tick", back=True),
            "f": lambda: self._jump(self._failures, "failure"),
            "F": lambda: self._jump(self._failures, "failure", back=True),
            "/": self._begin_search,
            "n": lambda: self._jump([event.t for event in self._matches], "event with that text"),
            "N": lambda: self._jump([event.t for event in self._matches], "event with that text", back=True),
        }

    def advance(self, seconds: float) -> None:
        """Advance playback by ``seconds`` of real time; pauses at the end of the record."""
        if self.playing:
            self.time = self._clamp(self.time + seconds * self.speed)
            self.playing = self.time < self.end

    def press(self, key: str) -> bool:
        """Handle a key press of the user; return False to quit."""
        if self.typing is not None:
            self._type_key(key)
            return True
        if key in ("q", "end"):
            return False
        self.note = ""
        if key.isascii() and key.isdigit():
            self.time = self.start + (self.end - self.start) * int(key) / 10
        elif key in self._keys:
            self._keys[key]()
        return True

    def _go_to(self, time: float) -> None:
        self.time = self._clamp(time)

    def _begin_search(self) -> None:
        self.typing = ""

    def _clamp(self, time: float) -> float:
        return min(max(time, self.start), self.end)

    def _play_or_pause(self) -> None:
        self.playing = not self.playing
        if self.playing and self.time >= self.end:
            self.time = self.start

    def _change_speed(self, *, faster: bool) -> None:
        others = [each for each in SPEEDS if (each > self.speed if faster else each < self.speed)]
        if others:
            self.speed = others[0 if faster else -1]

    def _jump(self, times: Sequence[float], what: str, *, back: bool = False) -> None:
        """Move playback to the next (with ``back``, the previous) one of the rising ``times``, and pause.

        Without such a time, show the note that there is no ``what``, such as "failure".
        """
        if back:
            place = bisect_left(times, self.time - TIME_TOLERANCE) - 1
        else:
            place = bisect_right(times, self.time + TIME_TOLERANCE)
        if 0 <= place < len(times):
            self.time, self.playing = self._clamp(times[place]), False
        else:
            self.note = f"no {what} {'before' if back else 'after'} this time"

    def _type_key(self, key: str) -> None:
        """Handle a key press while the user types a search text."""
        text = self.typing or ""
        if key in ("escape", "end"):
            self.typing = None
        elif key == "enter":
            self.typing = None
            self._matches = self._record.search(text) if text else ()
            self._jump([event.t for event in self._matches], f"'{text}'")
        elif key in BACKSPACE_KEYS:
            self.typing = text[:-1]
        elif len(key) == 1 and key.isprintable():
            self.typing = text + key
