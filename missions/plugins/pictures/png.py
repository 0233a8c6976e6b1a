"""SVG drawings as PNG. Needs the extra ``plots``: resvg, and Matplotlib for its font.

No fonts of the machine are used, so the PNG is the same everywhere.
"""

from math import sqrt
from pathlib import Path
from xml.etree import ElementTree as ET

PLOTS_MISSING = "a picture needs Matplotlib\n  try: pip install 'missiontree[plots]'"
"""Error message if the extra ``plots`` is not installed."""

DEFAULT_ZOOM = 2.0
"""Pixels of a PNG per unit of the SVG."""

MAX_PIXELS = 40_000_000
"""Maximum number of pixels; larger drawings are scaled down, since many programs do not open larger ones."""

FONTS = ("DejaVuSans.ttf", "DejaVuSans-Bold.ttf")


def png(svg: str, *, zoom: float = DEFAULT_ZOOM) -> bytes:
    """Return ``svg`` as a PNG, scaled by ``zoom``. Raises ImportError without the extra ``plots``."""
    from matplotlib import get_data_path  # noqa: PLC0415 - an extra, and slow to import
    from resvg_py import svg_to_bytes  # noqa: PLC0415 - an extra

    folder = Path(get_data_path()) / "fonts" / "ttf"
    fonts = [str(folder / name) for name in FONTS]
    return svg_to_bytes(svg_string=svg, zoom=min(zoom, max_zoom(svg)), skip_system_fonts=True, font_files=fonts)


def max_zoom(svg: str) -> float:
    """Return the zoom with which the PNG of a drawing has ``MAX_PIXELS`` pixels."""
    root = ET.fromstring(svg)  # noqa: S314 - our own drawing
    return sqrt(MAX_PIXELS / (float(root.attrib["width"]) * float(root.attrib["height"])))
