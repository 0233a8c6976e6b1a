"""Colours by name, for drawing and for detection."""

from collections.abc import Mapping
from types import MappingProxyType

COLOURS: Mapping[str, tuple[int, int, int]] = MappingProxyType(
    {
        "red": (200, 40, 40),
        "orange": (235, 120, 20),
        "yellow": (240, 205, 40),
        "green": (40, 150, 60),
        "blue": (40, 80, 190),
        "purple": (125, 55, 155),
        "pink": (240, 130, 175),
        "brown": (123, 84, 52),
        "black": (30, 30, 32),
        "white": (235, 235, 232),
        "grey": (140, 140, 140),
    }
)
"""Red, green and blue (0..255) of each colour in full light."""
