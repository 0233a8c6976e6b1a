"""The robot's face in a record: how it looked at any time."""

from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import replace

from drivers.api import Image, Mood, Shown
from drivers.screen.expression import expression
from drivers.screen.frame import frame
from missions.executive.events import CommandSent
from missions.records.recording.read import Record


class RecordedFace:
    """Knows what the screen of a record showed: as it was told to, and as it was when it was asked."""

    def __init__(self, record: Record) -> None:
        changes: list[tuple[float, Shown | Mapping[str, object]]] = [
            (event.t, event.values)
            for event in record.events
            if isinstance(event, CommandSent) and event.to == "screen"
        ]
        changes += [
            (moment.t, value)
            for moment in record.moments
            for part, what, _, value in moment.answers
            if (part, what) == ("screen", "shown") and isinstance(value, Shown)
        ]
        self._states: list[tuple[float, Shown]] = []
        state = Shown()
        for time, change in sorted(changes, key=lambda each: each[0]):
            if isinstance(change, Shown):
                state = change
            elif "mood" in change:
                state = replace(state, mood=Mood(str(change["mood"])))
            elif "show" in change:
                state = replace(state, text=str(change["show"]))
            self._states.append((time, state))

    def __bool__(self) -> bool:
        """Whether there is a face in the record."""
        return bool(self._states)

    def at(self, time: float, size: tuple[int, int]) -> Image:
        """Return the face as an image of ``size`` (width, height): (height, width, 3) BGR."""
        place = bisect_right(self._states, time, key=lambda state: state[0]) - 1
        shown = self._states[place][1] if place >= 0 else Shown()
        return frame(expression(shown, time), shown.text, size)
