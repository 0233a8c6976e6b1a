"""What coloured shapes are looked for: plain values."""

from dataclasses import dataclass

BALL, BOX, ANY = "ball", "box", "thing"
"""The shapes: round from every side; with straight edges; whatever it has."""


@dataclass(frozen=True, slots=True)
class Wanted:
    """A coloured shape to look for, and the name that what is found will bear.

    ``colour`` is a name of the palette, ``shape`` one of ``BALL``, ``BOX`` and ``ANY``. ``size`` is its diameter or
    width in metres, where that is known: from it follows how far away it is.
    """

    name: str
    colour: str
    shape: str = ANY
    size: float | None = None
