"""Places by name: a file of them for each robot that finds its way on a map."""

import json
import re
from collections.abc import Mapping
from math import degrees
from pathlib import Path

from config.diagnostics import InvalidFileError
from config.fields import read_fields
from config.section_reader import read_keys
from drivers.api.keys import key, keys

PLACE_NAME = re.compile(r"[\w-]([\w -]{0,38}[\w-])?")
"""Names of places: letters, digits, `-`, `_`, and spaces between them."""


@keys
class PlaceKeys:
    """A place on the map."""

    x: float = key("length", help="Metres along the map's x.")
    y: float = key("length", help="Metres along the map's y.")
    heading: float = key("angle", default=0.0, help="How to stand there, anticlockwise from the map's x.")
    frame: str = key(default="map", help="The frame that this is in.")


@keys
class PlacesKeys:
    """The keys of a file of places."""

    places: Mapping[str, PlaceKeys] = key(default={}, help="The places by name.")


def load_places(path: Path) -> Mapping[str, PlaceKeys]:
    """Read a file of places; none where there is no such file. Raises InvalidFileError with every mistake in it."""
    if not path.is_file():
        return {}
    fields = read_fields(path, subject="a file of places")
    found = read_keys(fields, PlacesKeys)
    if fields.diagnostics:
        raise InvalidFileError(fields.diagnostics)
    return found.places


def places_text(places: Mapping[str, PlaceKeys]) -> str:
    """Return the text of a file of places."""
    lines = ["places:" if places else "places: {}"]
    for name, it in sorted(places.items()):
        at = f"x: {it.x:.3f} m, y: {it.y:.3f} m, heading: {degrees(it.heading):.1f} deg"
        frame = "" if it.frame == "map" else f", frame: {json.dumps(it.frame)}"
        lines.append(f"  {json.dumps(name, ensure_ascii=False)}: {{{at}{frame}}}")
    return "\n".join(lines) + "\n"
