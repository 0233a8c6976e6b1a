"""Schemas of the files other than missions, from the classes that declare their keys."""

from collections.abc import Mapping

from config.cases import JudgedSuiteKeys
from config.controller import ControllerFileKeys
from config.gesture import GestureKeys
from config.move import MoveKeys
from config.object import ObjectKeys
from config.robot import RobotKeys
from config.world import WorldConfig
from drivers.api.gait import GaitKeys
from drivers.api.kinds import KINDS as OF_PARTS
from missions.library.drivers import DriverTable
from missions.plugins.schema.keys import keys_schema
from missions.plugins.schema.robots import further_part_schema, part_schemas
from missions.plugins.schema.values import Schema

FILE_KINDS: Mapping[str, tuple[str, type]] = {
    "tests": ("The tests of a mission.", JudgedSuiteKeys),
    "robots": ("A robot: its parts, where they are plugged in, how far and fast they may go.", RobotKeys),
    "worlds": ("A simulated world: a room, and what is in it.", WorldConfig),
    "gestures": ("A gesture: where joints are, moment after moment.", GestureKeys),
    "gaits": ("A gait: how a humanoid walks, by its steps or by where its soles are.", GaitKeys),
    "moves": ("A move: how the columns of a spreadsheet become a movement of the joints.", MoveKeys),
    "controllers": ("A controller: the rules by which a behaviour tracks.", ControllerFileKeys),
    "objects": ("An object to look for.", ObjectKeys),
}
"""Kinds of files with a schema: a description of the file, and the class that declares its keys."""


DRAFT = "http://json-schema.org/draft-07/schema#"
"""Identifier of the JSON Schema version."""


def file_schema(kind: str) -> Schema:
    """Return the JSON Schema (draft-07) for files of a kind that ``FILE_KINDS`` has, such as "robots"."""
    title, cls = FILE_KINDS[kind]
    schema = keys_schema(cls)
    if kind == "robots":
        parts = part_schemas(DriverTable())
        schema["properties"] |= parts
        schema["additionalProperties"] = {
            "anyOf": [further_part_schema(each, parts[each.name]) for each in OF_PARTS.values() if each.allows_several]
        }
    return {"$schema": DRAFT, "description": title, **schema}
