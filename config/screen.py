"""The ``screen`` section of a robot file: where the robot shows its face."""

from dataclasses import dataclass

from config.fields import Fields

DRIVERS = ("page", "print")
"""A page for a browser on the robot's own display; or a line on the terminal."""

MOODS = ("neutral", "happy", "sad", "surprised", "asleep", "listening", "speaking")
"""How a face may look, as drivers know it: a test holds the two together."""


@dataclass(frozen=True, slots=True)
class ScreenConfig:
    """A face. ``port`` is where the page is served, on this computer only; None for any that is free.

    ``mood`` is how it looks before a mission says otherwise.
    """

    driver: str = "page"
    port: int | None = None
    mood: str = "neutral"


def read_screen(fields: Fields | None) -> ScreenConfig | None:
    """Read the section."""
    if fields is None:
        return None
    port = fields.integer("port", 0, low=1024, high=65535) if fields.node_of("port") is not None else None
    screen = ScreenConfig(
        driver=fields.choice("driver", DRIVERS, "page"),
        port=port,
        mood=fields.choice("mood", MOODS, "neutral"),
    )
    fields.done()
    return screen
