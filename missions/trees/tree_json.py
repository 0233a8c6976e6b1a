"""Drawings as JSON, and back: for other programs, for pages and records, and for a view of a running mission."""

from collections.abc import Mapping
from typing import Any

from missions.codec import CodecError, Rules, decode, definitions, encode, object_schema
from missions.trees.drawing import Drawing

FORMAT = "missiontree-tree/1"
"""The format of such a file; its number grows with each change that a reader has to know."""

RULES = Rules()


def to_json(drawing: Drawing) -> dict[str, object]:
    """Return a drawing as plain JSON, as ``schema`` describes it."""
    return {"format": FORMAT, **encode(drawing, RULES)}


def from_json(data: Mapping[str, object]) -> Drawing:
    """Return the drawing that ``to_json`` wrote. Raises ValueError that says what is wrong with other data."""
    found = data.get("format")
    if found != FORMAT:
        raise ValueError(f"no tree dump that can be read here: its format is {found!r}, not {FORMAT!r}")
    try:
        return decode(Drawing, {name: value for name, value in data.items() if name != "format"}, RULES)
    except CodecError as error:
        raise ValueError(f"tree dump: {error}") from error


def schema() -> dict[str, Any]:
    """Return the JSON Schema of tree dumps, which says what each member means."""
    form = {"const": FORMAT, "description": "The format of this file."}
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "The tree of a MissionTree mission, as pictures show it",
        **object_schema(Drawing, RULES, format=form),
        "$defs": definitions(Drawing, RULES),
    }
