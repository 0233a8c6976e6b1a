"""Schema of nodes: behaviours, composites, sub-missions, and the keys beside them."""

from collections.abc import Mapping, Sequence

from behaviours.leaf import Leaf
from missions.language.modifiers import YES_NO_WORDS
from missions.language.nodes import (
    COMPOSITES,
    FOR_EACH,
    MISSION,
    MODIFIERS,
    OTHER_PARENTS,
    OWNED_KEYS,
    SWITCHES,
    WAIT_FOR,
)
from missions.language.parallel_counts import COUNTS
from missions.language.steps import OWNER_OF_KEY, STEP_KEY_HELP
from missions.library.catalogue import sentence, summary
from missions.plugins.schema.values import (
    EXPRESSION,
    HOLE,
    LIST_MEMBER,
    NAME,
    SCALAR,
    Schema,
    Things,
    is_complete_alone,
    leaf_value,
    name_schema,
    quantity_schema,
)

NODE = {"$ref": "#/definitions/node"}
CHILDREN: Schema = {
    "type": "array",
    "items": NODE,
    "minItems": 1,
    "errorMessage": "needs a list of at least one behaviour, each on a line with '- '",
}
RESULTS: Schema = {"type": "object", "propertyNames": NAME, "additionalProperties": EXPRESSION}


def node_definitions(leaves: Mapping[str, type[Leaf]], things: Things) -> Schema:
    """Return the schema definitions of a ``node``, and of all ``behaviours`` by name."""
    behaviours = {word: leaf_value(leaf, things) for word, leaf in leaves.items()} | _composite_schemas(things)
    return {"node": _node(leaves, list(behaviours)), "behaviours": behaviours}


def _node(leaves: Mapping[str, type[Leaf]], words: Sequence[str]) -> Schema:
    """Return the schema of a node: the name of a leaf alone, or a behaviour with the keys beside it.

    ``words`` are the names of all behaviours. Once a node has a behaviour, editors suggest only keys that can stand
    beside it.
    """
    behaviours = {word: {"$ref": f"#/definitions/behaviours/{word}"} for word in words}
    silent = {word: {"allOf": [value], "doNotSuggest": True} for word, value in behaviours.items()}
    modifiers = {
        word: _setting_schema(modifier.takes, modifier.help) for word, modifier in MODIFIERS.items()
    } | _beside_schemas()
    storing = [word for word, leaf in leaves.items() if leaf.output_doc] + [MISSION]
    no_behaviour: Schema = {
        "if": {"type": "object", "propertyNames": {"enum": list(modifiers)}},
        "then": {"type": "string", "errorMessage": "a behaviour is missing here"},
    }
    return {
        "type": ["string", "object"],
        "if": {"type": "object", "anyOf": [{"required": [word]} for word in words]},
        "then": {
            "properties": {**silent, **modifiers},
            "additionalProperties": False,
            "dependencies": {
                **_forbid_second_behaviour(words),
                "as": _require_one_of(storing, f"'as' stands beside what finds something out: {', '.join(storing)}"),
                **{word: [only] for word, only in OWNER_OF_KEY.items()},
                **{word: [owner] for word, (owner, _, _) in OWNED_KEYS.items()},
            },
        },
        "else": {
            "properties": {**behaviours, **modifiers},
            "additionalProperties": False,
            "if": {"type": "string"},
            "then": _word_schema(leaves),
            "else": no_behaviour,
            "defaultSnippets": _SNIPPETS,
        },
    }


def _word_schema(leaves: Mapping[str, type[Leaf]]) -> Schema:
    """Return the schema of a node that is only the name of a leaf, such as `stop`, without arguments."""
    alone = {word: leaf for word, leaf in leaves.items() if is_complete_alone(leaf)}
    return {
        "enum": list(alone),
        "markdownEnumDescriptions": [summary(leaf) for leaf in alone.values()],
        "errorMessage": f"write 'say: Hello', with a colon and a space; alone stand only {', '.join(alone)}",
    }


def _composite_schemas(things: Things) -> dict[str, Schema]:
    """Return the schemas of the values of composites and of ``mission``."""
    lists = {
        word: {"description": f"A list of behaviours: {kind.help}.", **CHILDREN} for word, kind in COMPOSITES.items()
    }
    switch = {
        "type": "object",
        "properties": {
            "on": {"description": "The expression whose value chooses.", **EXPRESSION},
            "cases": {
                "description": "A behaviour for each value.",
                "type": "object",
                "minProperties": 1,
                "additionalProperties": NODE,
            },
            "default": NODE,
        },
        "required": ["on", "cases"],
        "additionalProperties": False,
    }
    text = "Runs another mission as one node: its name in the library, or a path from this file's folder."
    mission = {"description": text, **name_schema(MISSION, things[MISSION], computed=False)}
    switches = {
        word: {"description": f"{sentence(kind.help)} Fails where no case is.", **switch}
        for word, kind in SWITCHES.items()
    }
    wait_for = {"description": sentence(OTHER_PARENTS[WAIT_FOR].help), **NODE}
    return {**lists, **switches, FOR_EACH: _for_each(), WAIT_FOR: wait_for, MISSION: mission}


def _for_each() -> Schema:
    """Return the schema of the value of ``for_each``: its list, the names of its variables, and the node to repeat."""
    return {
        "description": sentence(OTHER_PARENTS[FOR_EACH].help),
        "type": "object",
        "properties": {
            "in": {
                "description": "The list: an expression, or its members.",
                "anyOf": [EXPRESSION, {"type": "array", "items": LIST_MEMBER}],
                "examples": ["places"],
            },
            "as": {"description": "The variable that holds the member.", **NAME},
            "number": {"description": "The variable that holds the number of the member, from 1.", **NAME},
            "do": NODE,
        },
        "required": ["in", "as", "do"],
        "additionalProperties": False,
    }


def _beside_schemas() -> dict[str, Schema]:
    return {
        "name": {"description": sentence(STEP_KEY_HELP["name"]), "type": SCALAR, "pattern": r"\S"},
        "as": {"description": sentence(STEP_KEY_HELP["as"]), **NAME},
        "with": {
            "description": sentence(STEP_KEY_HELP["with"]),
            "type": "object",
            "additionalProperties": {
                "type": [*SCALAR, "null", "array"],
                "items": LIST_MEMBER,
                "errorMessage": "needs one value, or a list",
            },
        },
        "returns": {"description": sentence(STEP_KEY_HELP["returns"]), **RESULTS},
        **{word: _setting_schema(takes, text) for word, (takes, text) in COUNTS.items()},
        **{word: _setting_schema(takes, text) for word, (_, takes, text) in OWNED_KEYS.items()},
    }


def _setting_schema(takes: str, text: str) -> Schema:
    """Return the schema of the value of a modifier, or of another key beside a behaviour.

    ``takes`` describes the form of the value, such as "a duration". ``text`` is the help of the key.
    """
    found: Schema = {"description": f"{sentence(text)} Takes {takes}."}
    match takes:
        case "an expression":
            return found | EXPRESSION
        case "a behaviour" | "a behaviour that moves nothing":
            return found | NODE
        case "a duration":
            return found | quantity_schema("duration", "longer than 0 s", zero=False) | {"examples": ["2 s"]}
        case "a count or forever" | "a count or all":
            word = takes.removeprefix("a count or ")
            message = f"needs a count of 1 or more, or {word}"
            pattern = f"^{word}$|{HOLE}"
            return found | {
                "type": ["integer", "string"],
                "minimum": 1,
                "pattern": pattern,
                "errorMessage": message,
                "examples": [3, word],
            }
        case "a list of numbers":
            return found | {
                "type": ["array", "string"],
                "items": {"type": ["number", "string"], "minimum": 0},
                "pattern": HOLE,
                "errorMessage": "needs a number for each child, such as [2, 1]",
            }
        case "true or an expression":
            limits = {"not": {"enum": [False, *YES_NO_WORDS]}, "errorMessage": "needs true, or an expression"}
            return found | EXPRESSION | {"type": ["boolean", "string"]} | limits
        case words:
            return found | {"enum": [True if word == "true" else word for word in words.split(" or ")]}


def _forbid_second_behaviour(words: Sequence[str]) -> dict[str, Schema]:
    """Return schema dependencies that forbid two behaviours in one node.

    Each behaviour forbids only those later in ``words``, so that two behaviours cause one error, not two.
    """
    return {
        word: {
            "properties": dict.fromkeys(words[place + 1 :], False),
            "errorMessage": f"a second behaviour beside '{word}': begin it with '- ' in a sequence, or indent it",
        }
        for place, word in enumerate(words[:-1])
    }


def _require_one_of(words: Sequence[str], message: str) -> Schema:
    """Return a schema that requires one of the keys ``words`` in a node; ``message`` is the error otherwise."""
    some = {"anyOf": [{"required": [word]} for word in words]}
    return {"if": {"not": some}, "then": {"type": "string", "errorMessage": message}}


_SNIPPETS: list[Schema] = [
    {"label": label, "description": text, "bodyText": "\n    - ".join([f"{word}:", *lines])}
    for label, text, word, lines in (
        ("steps", "One after another.", "sequence", ("say: ${1:Hello}", "wait: ${2:2 s}")),
        ("or else", "The first that succeeds.", "selector", ("face_seen", "say: ${1:Where are you?}")),
        ("at once", "Several at the same time.", "parallel", ("gesture: ${1:hello}", "say: ${2:Hello}")),
        ("until one ends", "One thing, until another has ended.", "race", ("track_face", "wait: ${1:10 s}")),
    )
]
"""Editor snippets of composites with two children.

The children are indented by four spaces, so that a snippet is also valid after "- ".
"""
