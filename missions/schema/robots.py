"""The schema of robot files: a section for each kind of part, with the keys of each driver that there is."""

from drivers.api.driver import BrokenDriver, Driver
from drivers.api.kinds import KINDS, Kind
from missions.library.drivers import Table
from missions.schema.keys import keys_schema
from missions.schema.values import Schema


def part_schemas(table: Table) -> dict[str, Schema]:
    """Return what the section of each kind of part may hold; a driver that cannot be used is left out."""
    found: dict[str, list[Driver]] = {kind: [] for kind in KINDS}
    for kind, _, driver in table.all():
        if not isinstance(driver, BrokenDriver):
            found[kind].append(driver)
    return {kind: _section(KINDS[kind], drivers) for kind, drivers in found.items()}


def of_kind(kind: Kind, section: Schema) -> Schema:
    """Return what the section of one more part of a kind may hold: what a ``section`` of it may, and its ``kind``."""
    word: Schema = {"description": "Of which kind of part this is one more.", "const": kind.name}
    choices = [
        {**each, "then": _with_word(each["then"], word)} if "then" in each else each
        for each in section.get("allOf", [])
    ]
    more = {"allOf": choices} if choices else {}
    return {**_with_word(section, word), **more, "required": ["kind", *section["required"]]}


def _with_word(schema: Schema, word: Schema) -> Schema:
    return {**schema, "properties": {"kind": word, **schema["properties"]}}


def _section(kind: Kind, drivers: list[Driver]) -> Schema:
    """Return what a section may hold: the keys of the driver that it names, or of the usual one."""
    names = [driver.name for driver in drivers]
    told = "What drives it." + (f" Without it: {kind.usual}." if kind.usual else " It must be given.")
    word: Schema = {"description": told, "enum": names}
    whole = {driver.name: _with_driver(keys_schema(driver.keys), word) for driver in drivers}
    if len(drivers) == 1:
        (only,) = whole.values()
        required = [] if kind.usual else ["driver"]
        return {"description": kind.about, **only, "required": [*required, *only["required"]]}
    choices = [
        {
            "if": {"properties": {"driver": {"const": name}}, "required": [] if name == kind.usual else ["driver"]},
            "then": schema,
        }
        for name, schema in whole.items()
    ]
    required = [] if kind.usual else ["driver"]
    return {"description": kind.about, "type": "object", "properties": {"driver": word}, "required": required} | {
        "allOf": choices
    }


def _with_driver(schema: Schema, word: Schema) -> Schema:
    return {**schema, "properties": {"driver": word, **schema["properties"]}}
