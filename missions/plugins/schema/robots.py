"""Schema and reference of robot files: a section for each kind of part, with the keys of each driver."""

from collections.abc import Collection, Iterable

from drivers.api.driver import BrokenDriver, Driver
from drivers.api.keys import Key, declared_keys
from drivers.api.kinds import KINDS, PartKind
from missions.library.drivers import DriverTable
from missions.plugins.schema.keys import bounds_text, format_default, keys_schema, value_text
from missions.plugins.schema.values import Schema

# Keys of files as Markdown tables, from the classes that declare them.

COLUMNS = ("key", "takes", "bounds", "default", "what it does")


def robot_reference(table: DriverTable, among: Collection[tuple[str, str]] | None = None) -> str:
    """Return the keys of drivers as Markdown, by kind of part.

    ``among`` limits it to these drivers, each as (kind of part, name); None means all drivers.
    """
    parts = []
    for kind in KINDS.values():
        drivers: dict[type, list[Driver]] = {}
        for of, name, driver in table.iter_drivers():
            if of == kind.name and not isinstance(driver, BrokenDriver) and (among is None or (of, name) in among):
                drivers.setdefault(driver.keys, []).append(driver)
        parts += [
            f"## {kind.name}",
            kind.about + (f" `driver` may be left out: `{kind.default_driver}`." if kind.default_driver else ""),
        ]
        for cls, those in drivers.items():
            parts += ["\n".join(f"- `driver: {each.name}`: {each.about}" for each in those), keys_table(cls)]
    return "\n\n".join(parts)


def keys_table(cls: type, apart: Collection[type] = ()) -> str:
    """Return a Markdown table of the keys that a class declares; a key of a section is named ``section.key``.

    Sections that a class in ``apart`` declares are left out, since they have a table of their own.
    """
    return markdown_table(COLUMNS, _rows(cls, "", apart))


def _rows(of: type, within: str, apart: Collection[type]) -> Iterable[tuple[str, ...]]:
    for key in declared_keys(of):
        word = "*NAME*" if key.form == "rest" else key.word
        default = "must be given" if key.required else markdown_code(shown) if (shown := format_default(key)) else ""
        yield markdown_code(within + word), value_text(key), bounds_text(key), default, key.help
        for path, cls in _sections(key, key.word):
            yield from () if cls in apart else _rows(cls, f"{within}{path}.", apart)


def _sections(key: Key, path: str) -> Iterable[tuple[str, type]]:
    """Yield each section that a key contains, as its path and the class that declares its keys."""
    if key.of is not None:
        yield path, key.of
    for each in key.options:
        yield from _sections(each, path)
    if key.inner is not None:
        yield from _sections(key.inner, f"{path}.{'NAME' if key.form == 'named' else 'N'}")


def markdown_table(head: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> str:
    """Return a table in Markdown."""
    lines = [head, tuple("---" for _ in head), *rows]
    return "\n".join(f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in line)} |" for line in lines)


def markdown_code(text: str) -> str:
    """Return ``text`` as inline code in Markdown."""
    return f"`{text}`"


def part_schemas(table: DriverTable) -> dict[str, Schema]:
    """Return for each kind of part the schema of its section in a robot file.

    Drivers that cannot be imported are left out.
    """
    found: dict[str, list[Driver]] = {kind: [] for kind in KINDS}
    for kind, _, driver in table.iter_drivers():
        if not isinstance(driver, BrokenDriver):
            found[kind].append(driver)
    return {kind: _section_schema(KINDS[kind], drivers) for kind, drivers in found.items()}


def further_part_schema(kind: PartKind, section: Schema) -> Schema:
    """Return the schema of an additional part of a kind, such as a second arm.

    It is the schema ``section`` of the first part, with the additional key ``kind``.
    """
    word: Schema = {"description": "Of which kind of part this is one more.", "const": kind.name}
    choices = [
        {**each, "then": _with_word(each["then"], word)} if "then" in each else each
        for each in section.get("allOf", [])
    ]
    more = {"allOf": choices} if choices else {}
    return {**_with_word(section, word), **more, "required": ["kind", *section["required"]]}


def _with_word(schema: Schema, word: Schema) -> Schema:
    return {**schema, "properties": {"kind": word, **schema["properties"]}}


def _section_schema(kind: PartKind, drivers: list[Driver]) -> Schema:
    """Return the schema of the section of a part, with the keys of the driver that the section names.

    A section without the key ``driver`` has the keys of the default driver.
    """
    names = [driver.name for driver in drivers]
    description = "What drives it." + (
        f" Without it: {kind.default_driver}." if kind.default_driver else " It must be given."
    )
    word: Schema = {"description": description, "enum": names}
    whole = {driver.name: _with_driver(keys_schema(driver.keys), word) for driver in drivers}
    if len(drivers) == 1:
        (only,) = whole.values()
        required = [] if kind.default_driver else ["driver"]
        return {"description": kind.about, **only, "required": [*required, *only["required"]]}
    choices = [
        {
            "if": {
                "properties": {"driver": {"const": name}},
                "required": [] if name == kind.default_driver else ["driver"],
            },
            "then": schema,
        }
        for name, schema in whole.items()
    ]
    required = [] if kind.default_driver else ["driver"]
    return {"description": kind.about, "type": "object", "properties": {"driver": word}, "required": required} | {
        "allOf": choices
    }


def _with_driver(schema: Schema, word: Schema) -> Schema:
    return {**schema, "properties": {"driver": word, **schema["properties"]}}
