"""The parts that the schemas of messages are made of."""

Schema = dict[str, object]
"""A JSON Schema."""


def of(kind: str, about: str = "", **more: object) -> Schema:
    """Return what a value of a kind of JSON is."""
    return ({"description": about} if about else {}) | {"type": kind} | more


def text(about: str = "") -> Schema:
    """Return a text."""
    return of("string", about)


def number(about: str = "") -> Schema:
    """Return a finite number."""
    return of("number", about)


def whole(about: str = "", **bounds: int) -> Schema:
    """Return a whole number."""
    return of("integer", about, **bounds)


def flag(about: str) -> Schema:
    """Return true or false."""
    return of("boolean", about)


def or_null(schema: Schema) -> Schema:
    """Return what may be null, too."""
    kinds = schema["type"] if isinstance(schema["type"], list) else [schema["type"]]
    return schema | {"type": [*kinds, "null"]}


def real(about: str) -> Schema:
    """Return a number that need not be finite."""
    pattern = {"pattern": "^(nan|-?inf)$"}
    return {"description": f'{about} Not finite: "nan", "inf" or "-inf".', "type": ["number", "string"], **pattern}


def choice(about: str, *words: str) -> Schema:
    """Return one of some words."""
    return {"description": about, "enum": [*words]}


def listing(about: str, items: Schema, **more: object) -> Schema:
    """Return a list."""
    return of("array", about, items=items, **more)


def named(about: str, each: Schema) -> Schema:
    """Return values under names of their own."""
    return of("object", about, additionalProperties=each)


def opened(about: str, /, **members: Schema) -> Schema:
    """Return an object that may have other members too."""
    return of("object", about, properties=members, required=[*members])


def closed(about: str, /, **members: Schema) -> Schema:
    """Return an object that has no other members."""
    return opened(about, **members) | {"additionalProperties": False}


def numbers(about: str, names: str) -> Schema:
    """Return an object of numbers that have a letter each."""
    return opened(about, **{name: number() for name in names})


TIME = number("Seconds of the run.")
"""When, in every message of ours."""
