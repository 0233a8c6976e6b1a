"""Protocol of a screen that shows the robot's face."""

from enum import StrEnum
from typing import Protocol

from drivers.api.device import Device
from drivers.api.fast_dataclass import dataclass
from drivers.api.marks import command


class Mood(StrEnum):
    """Expression of the face."""

    NEUTRAL = "neutral"
    HAPPY = "happy"
    SAD = "sad"
    SURPRISED = "surprised"
    ASLEEP = "asleep"
    LISTENING = "listening"
    SPEAKING = "speaking"


@dataclass(frozen=True, slots=True)
class ScreenContent:
    """Content of the screen: a mood, a text below the face (or empty), and the opening of the mouth, 0..1."""

    mood: Mood = Mood.NEUTRAL
    text: str = ""
    mouth: float = 0.0


class Screen(Device, Protocol):
    """Face on the robot's own display. All calls return at once, from any thread, and never raise when offline."""

    @command("before")
    def mood(self, mood: Mood) -> None:
        """Set the expression of the face."""
        ...

    @command("before")
    def show(self, text: str) -> None:
        """Show a text below the face; an empty text removes it."""
        ...

    @command("never")
    def mouth(self, opening: float) -> None:
        """Set the opening of the mouth, 0..1; it closes by itself after 0.3 s without a new value."""
        ...

    def content(self) -> ScreenContent:
        """Return the current content."""
        ...
