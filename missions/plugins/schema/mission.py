"""Schema of mission files, for the available leaves and library names."""

from collections import Counter
from collections.abc import Callable
from collections.abc import Mapping as Named
from pathlib import Path

from behaviours.leaf import Leaf
from config.controller import load_controller
from config.gesture import load_gait, load_gesture
from config.library import KIND_KEYS, shipped_files
from config.yaml_nodes import Mapping, Scalar, compose, read_source
from missions.language.mission_body import IF_INTERRUPTED, PROPERTIES, PROPERTY_FORMS
from missions.language.nodes import MISSION
from missions.language.param_types import LIST_TYPE, PARAM_TYPES
from missions.library.catalogue import sentence
from missions.library.shipped import shipped_missions
from missions.plugins.schema.nodes import NODE, RESULTS, node_definitions
from missions.plugins.schema.values import HOLE, NAME, SCALAR, Schema, Things

_LOADERS: Named[str, Callable[[Path], object]] = {
    "gesture": load_gesture,
    "gait": load_gait,
    "controller": load_controller,
}


OTHER_KIND_KEYS = (*(key for key in KIND_KEYS if key != "mission"), "move")
"""Top-level keys that show that a file is not a mission, but a robot, world or other file."""


def mission_schema(leaves: Named[str, type[Leaf]], things: Things) -> Schema:
    """Return the JSON Schema (draft-07) of missions that use these ``leaves``.

    ``things`` are the names of gestures, missions and other files that the missions may use, by kind.
    """
    return {
        "$schema": "http://json-schema.org/draft-07/schema#",
        "description": "A mission of MissionTree: what a robot should do, as a behaviour tree.",
        "type": "object",
        # A file pattern such as *.yaml includes tests, robots and worlds too, which have their own schemas.
        "if": {"not": {"required": ["mission"]}, "anyOf": [{"required": [key]} for key in OTHER_KIND_KEYS]},
        "else": _body(),
        "defaultSnippets": [_NEW_MISSION_SNIPPET],
        "definitions": node_definitions(leaves, things),
    }


def _body() -> Schema:
    """Return the schema of the keys of a mission file."""
    text = {"type": SCALAR, "pattern": r"\S"}
    return {
        "properties": {
            "mission": {"description": "The mission's name.", **text},
            "summary": {"description": "What it does, in a line.", **text},
            "params": {
                "description": "What the caller may set, each with its default: `patience: 60 s`.",
                "type": "object",
                "propertyNames": NAME,
                "additionalProperties": _param(),
            },
            "if_interrupted": {
                "description": "What happens to the mission as a task after an interruption.",
                "enum": list(IF_INTERRUPTED),
            },
            "tree": NODE,
            "returns": {
                "description": "What it hands back to a mission that runs it: names and expressions.",
                **RESULTS,
            },
            "properties": _properties(),
        },
        "required": ["mission", "tree"],
        "additionalProperties": False,
    }


def shipped_things() -> dict[str, dict[str, str]]:
    """Return by kind the names and summaries of the shipped gestures, moves, gaits, controllers and missions."""
    found = {
        kind: {name: str(getattr(load(path), "summary", "")) for name, path in shipped_files(f"{kind}s").items()}
        for kind, load in _LOADERS.items()
    }
    return {**found, "move": found["gesture"], MISSION: _missions()}


def _missions() -> dict[str, str]:
    """Return MissionTree's missions by their shortest unique names. Only their summaries are read."""
    files = shipped_missions()
    short = Counter(path.stem for path in files.values())
    return {path.stem if short[path.stem] == 1 else name: _summary(path) for name, path in files.items()}


def _summary(path: Path) -> str:
    root = compose(read_source(path))
    found = root.get("summary") if isinstance(root, Mapping) else None
    return found.text if isinstance(found, Scalar) else ""


def _param() -> Schema:
    """Return the schema of a param: a plain default, or the long form."""
    default = {
        "type": [*SCALAR, "null"],
        "pattern": rf"^(?![\s\S]*{HOLE})",
        "patternErrorMessage": "the default of a param cannot be calculated: write a plain value",
    }
    bound = {"type": ["string", "number"]}
    value = {"type": SCALAR, "pattern": default["pattern"]}
    mapping = {"type": [*SCALAR, "object"], "pattern": default["pattern"], "additionalProperties": value}
    plain = {**default, "items": mapping, "type": [*default["type"], "array"]}
    types = [each for each in PARAM_TYPES if each != LIST_TYPE]
    limits = {
        "choices": {"description": "The words to choose from.", "type": "array", "items": value, "minItems": 1},
        "low": {"description": "The lowest value it may have.", **bound},
        "high": {"description": "The highest value it may have.", **bound},
    }
    entry = {
        "type": ["string", "object"],
        "properties": {"type": {"enum": types}, **limits},
        "additionalProperties": False,
        "if": {"type": "string"},
        "then": {"enum": types},
    }
    return {
        **plain,
        "type": [*plain["type"], "object"],
        "properties": {
            "default": {"description": "Its value where the caller gives none.", **plain},
            "type": {"description": "What it is; told by its default where there is one.", "enum": list(PARAM_TYPES)},
            "of": {
                "description": "What the members of a list are: a type, or the types of the values in a mapping.",
                "anyOf": [{"enum": types}, {"type": "object", "additionalProperties": entry, "minProperties": 1}],
            },
            "help": {"description": "What it is for.", "type": SCALAR},
            **limits,
        },
        "additionalProperties": False,
        "anyOf": [{"not": {"type": "object"}}, *({"required": [key]} for key in ("default", "type", "choices", "of"))],
    }


def _properties() -> Schema:
    """Return the schema of the ``properties`` of a mission: a list of mappings with one key, whose value is a text."""
    kinds = {
        word: {"description": sentence(text), "type": "string", "pattern": pattern}
        for word, (text, pattern) in PROPERTIES.items()
    }
    return {
        "description": "What the mission promises of itself, for `mission verify` to prove.",
        "type": "array",
        "items": {
            "type": "object",
            "properties": kinds,
            "additionalProperties": False,
            "minProperties": 1,
            "maxProperties": 1,
            "defaultSnippets": [{"label": form, "bodyText": form} for form in PROPERTY_FORMS],
        },
    }


_NEW_MISSION_SNIPPET: Schema = {
    "label": "a new mission",
    "description": "A name, a summary, and a tree with a first behaviour.",
    "body": {
        "mission": "${1:my_mission}",
        "summary": "${2:What it does.}",
        "tree": {"sequence": [{"say": "${3:Hello}"}]},
    },
}
