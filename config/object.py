"""Objects to look for: a phrase such as "big red box", or a file with name, colour, shape and size."""

from dataclasses import dataclass
from pathlib import Path

from config.colours import COLOURS
from config.diagnostics import InvalidFileError, did_you_mean
from config.fields import read_fields
from config.section_reader import read_keys
from config.units import quantity_text, quoted_value
from drivers.api.keys import key, keys

HUES = ("red", "orange", "yellow", "green", "blue", "purple", "pink")
"""Colours that are distinct from those of a room: brown is that of wood and skin; grey, black and white of walls."""

SHAPES = {
    "ball": "ball",
    "sphere": "ball",
    "box": "box",
    "cube": "box",
    "block": "box",
    "object": "thing",
    "thing": "thing",
}
"""Shape by the noun of a phrase: "ball" (round from every side), "box" (straight edges), or "thing" (either)."""

FORMS = {"round": "ball", "square": "box"}
"""Shapes of objects by the adjective before "object" or "thing" in a phrase."""

SIZES = {"small": 0.1, "big": 0.3}
"""Width of an object in metres by the adjective in a phrase: "small" as an apple, "big" as a crate."""

PHRASE_EXAMPLES = "such as 'red ball', 'big blue box' or 'yellow round object'"


@keys
class ObjectKeys:
    """Keys of an object file: name, colour, shape and size of an object to look for."""

    object: str = key(help="Name.")
    summary: str = key(default="", help="Description in a line.")
    colour: str = key(among=HUES, help="Colour.")
    shape: str = key(default="thing", among=("ball", "box", "thing"), help="Shape; `thing` is either.")
    size: float | None = key("length", default=None, low=0.02, high=2.0, help="Diameter or width, if it is known.")


@dataclass(frozen=True, slots=True)
class ObjectConfig:
    """Object to look for: ``shape`` is "ball", "box" or "thing" (either); ``size`` in metres, None if unknown."""

    name: str
    summary: str
    colour: str
    shape: str
    size: float | None


def load_object(path: Path) -> ObjectConfig:
    """Read an object file. Raises InvalidFileError with all errors."""
    fields = read_fields(path, subject="an object file")
    found = read_keys(fields, ObjectKeys)
    if fields.diagnostics:
        raise InvalidFileError(fields.diagnostics)
    return ObjectConfig(found.object, found.summary, found.colour, found.shape, found.size)


def read_phrase(text: str) -> ObjectConfig:
    """Return the object of ``[small|big] COLOUR [round|square] [ball|box|object...]``. Raises ValueError otherwise."""
    words = text.lower().split()
    name = " ".join(words)
    size = SIZES[words.pop(0)] if words and words[0] in SIZES else None
    if not words or words[0] not in HUES:
        raise ValueError(_missing_colour_error(words, text))
    colour = words.pop(0)
    form = FORMS[words.pop(0)] if words and words[0] in FORMS else "thing"
    shape = SHAPES[words.pop(0)] if words and words[0] in SHAPES else "thing"
    if words:
        known = [*SHAPES, *(FORMS if form == "thing" else ())]
        raise ValueError(
            f"{quoted_value(text)}: '{words[0]}' is not a shape; {did_you_mean(words[0], known) or PHRASE_EXAMPLES}"
        )
    if "thing" not in (form, shape) and form != shape:
        raise ValueError(f"{quoted_value(text)}: is it a ball or a box?")
    return ObjectConfig(name, _summary(colour, size), colour, form if shape == "thing" else shape, size)


def _missing_colour_error(words: list[str], text: str) -> str:
    if not words:
        return f"{quoted_value(text)}: which colour? {PHRASE_EXAMPLES}"
    if words[0] in COLOURS:
        colours = ", ".join(HUES)
        return f"{quoted_value(text)}: {words[0]} things cannot be distinguished from a room; colours are: {colours}"
    hint = did_you_mean(words[0], [*HUES, *SIZES]) or f"colours are: {', '.join(HUES)}"
    return f"{quoted_value(text)}: '{words[0]}' is not a colour; {hint}"


def _summary(colour: str, size: float | None) -> str:
    return f"Anything {colour}" + ("" if size is None else f", {quantity_text(size, 'length')} across")
