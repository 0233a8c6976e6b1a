"""Places file of a robot: named poses on its map."""

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
"""Regular expression of place names: letters, digits, `-`, `_`, and spaces between them."""


@keys
class PlaceKeys:
    """Keys of one named place on a robot's map."""

    x: float = key("length", help="Metres along the map's x.")
    y: float = key("length", help="Metres along the map's y.")
    heading: float = key("angle", default=0.0, help="Heading, anticlockwise from the map's x.")
    frame: str = key(default="map", help="Frame of the coordinates.")


@keys
class PlacesKeys:
    """Keys of a places file, which names poses on a robot's map."""

    places: Mapping[str, PlaceKeys] = key(default={}, help="Places by name.")


def load_places(path: Path) -> Mapping[str, PlaceKeys]:
    """Read a places file; return an empty mapping without the file. Raises InvalidFileError with all errors."""
    if not path.is_file():
        return {}
    fields = read_fields(path, subject="a file of places")
    found = read_keys(fields, PlacesKeys)
    if fields.diagnostics:
        raise InvalidFileError(fields.diagnostics)
    return found.places


def places_text(places: Mapping[str, PlaceKeys]) -> str:
    """Return ``places`` as the YAML text of a places file."""
    lines = ["places:" if places else "places: {}"]
    for name, it in sorted(places.items()):
        at = f"x: {it.x:.3f} m, y: {it.y:.3f} m, heading: {degrees(it.heading):.1f} deg"
        frame = "" if it.frame == "map" else f", frame: {json.dumps(it.frame)}"
        lines.append(f"  {json.dumps(name, ensure_ascii=False)}: {{{at}{frame}}}")
    return "\n".join(lines) + "\n"
