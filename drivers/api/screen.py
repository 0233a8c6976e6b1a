"""What a behaviour sees of a screen that shows the robot's face."""

from enum import StrEnum
from typing import Protocol

from drivers.api.device import Device
from drivers.api.fast_dataclass import dataclass
from drivers.api.marks import command


class Mood(StrEnum):
    """How a face looks."""

    NEUTRAL = "neutral"
    HAPPY = "happy"
    SAD = "sad"
    SURPRISED = "surprised"
    ASLEEP = "asleep"
    LISTENING = "listening"
    SPEAKING = "speaking"


@dataclass(frozen=True, slots=True)
class ScreenContent:
    """What the screen shows: a mood, words below the face (empty for none), and how far the mouth is open, 0..1."""

    mood: Mood = Mood.NEUTRAL
    text: str = ""
    mouth: float = 0.0


class Screen(Device, Protocol):
    """A face, on the robot's own display. All calls return at once, from any thread, and raise nothing when offline."""

    @command("before")
    def mood(self, mood: Mood) -> None:
        """Look like this from now on."""
        ...

    @command("before")
    def show(self, text: str) -> None:
        """Show words below the face; an empty text takes them away."""
        ...

    @command("never")
    def mouth(self, opening: float) -> None:
        """Open the mouth so far, 0..1, whatever the mood; it shuts by itself when nothing newer comes for 0.3 s."""
        ...

    def content(self) -> ScreenContent:
        """Return what is to be seen now."""
        ...
