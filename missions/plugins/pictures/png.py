"""Our SVG pictures as PNG, for papers, slides and chats. Needs the extra ``plots``: resvg, and Matplotlib for its font.

No font of the machine is used: the same picture gives the same PNG everywhere.
"""

from math import sqrt
from pathlib import Path
from xml.etree import ElementTree as ET

PLOTS_MISSING = "a picture needs Matplotlib\n  try: pip install 'missiontree[plots]'"
"""The error message for plots without the extra."""

DEFAULT_ZOOM = 2.0
"""Pixels of a PNG to a unit of the SVG."""

MAX_PIXELS = 40_000_000
"""A larger picture is drawn smaller: drawing takes seconds, and many programs do not open more."""

FONTS = ("DejaVuSans.ttf", "DejaVuSans-Bold.ttf")


def png(svg: str, *, zoom: float = DEFAULT_ZOOM) -> bytes:
    """Return ``svg`` as a PNG, ``zoom`` times as large. Raises ImportError without the extra ``plots``."""
    from matplotlib import get_data_path  # noqa: PLC0415 - an extra, and slow to import
    from resvg_py import svg_to_bytes  # noqa: PLC0415 - an extra

    folder = Path(get_data_path()) / "fonts" / "ttf"
    fonts = [str(folder / name) for name in FONTS]
    return svg_to_bytes(svg_string=svg, zoom=min(zoom, max_zoom(svg)), skip_system_fonts=True, font_files=fonts)


def max_zoom(svg: str) -> float:
    """Return how many times as large a picture can be drawn."""
    root = ET.fromstring(svg)  # noqa: S314 - our own picture
    return sqrt(MAX_PIXELS / (float(root.attrib["width"]) * float(root.attrib["height"])))
