"""Values of missions as the texts of XML ports.

A plain value is written as it is, and ``${x}`` as ``{x}``. All others are YAML with a prefix, such as ``yaml: [1 m,
"${x}"]``. The prefix is also used for a text that would read as another value, such as ``yaml: "5"``.
"""

import json
import re
from collections.abc import Mapping

from behaviours.leaf import Argument
from config.diagnostics import InvalidFileError, SourceText
from config.units import parse_quantity
from config.yaml_nodes import Listing, Node, Scalar, compose, plain_value
from config.yaml_nodes import Mapping as Entries
from config.yaml_writer import yaml_word
from missions.language.arguments import TEXT_KINDS
from missions.language.param_types import NAME_TYPES

YAML_PREFIX = "yaml: "
ONE_NAME = re.compile(r"\$\{\s*([A-Za-z_]\w*)\s*\}", re.ASCII)


def flow_text(node: Node) -> str:
    """Return a YAML node as text on one line, in YAML's flow style, with brackets and braces."""
    match node:
        case Listing(items=items):
            return f"[{', '.join(map(flow_text, items))}]"
        case Entries(entries=entries):
            return f"{{{', '.join(f'{_key_text(name)}: {flow_text(value)}' for name, value in entries)}}}"
        case Scalar(value=str(), text=text, quoted=quoted):
            return text if not quoted and parse_quantity(text) is not None else yaml_word(text)
    return node.text or "null"


def _key_text(key: Scalar) -> str:
    return yaml_word(key.text) if isinstance(key.value, str) else key.text


def port_text(node: Node, *, is_text: bool) -> str:
    """Return a YAML node of a mission as the text of a port; ``is_text`` if the argument takes only texts."""
    if not isinstance(node, Scalar) or node.value is None:
        return YAML_PREFIX + flow_text(node)
    if found := ONE_NAME.fullmatch(node.text.strip()):
        return f"{{{found[1]}}}"
    as_plain = plain_value(node.text) if parse_quantity(node.text) is None or not node.quoted else None
    reads_as_another = not is_text and isinstance(node.value, str) and as_plain != node.text
    unclear = is_pointer(node.text) or node.text.startswith(YAML_PREFIX) or node.text != node.text.strip()
    if unclear or reads_as_another or not node.text or not node.text.isprintable():
        return YAML_PREFIX + flow_text(node)
    return node.text


def port_value(text: str, *, is_text: bool) -> str:
    """Return the text of a port as YAML text on one line. Raises ValueError if it has the prefix and is not YAML.

    ``is_text`` is true if the argument takes only texts, so that ``5`` is a text.
    """
    if text.startswith(YAML_PREFIX):
        return flow_text(read_flow(text))
    if is_pointer(text):
        return json.dumps(f"${{{text.strip()[1:-1].strip()}}}", ensure_ascii=False)
    is_word = isinstance(plain_value(text), str) and parse_quantity(text) is None
    return yaml_word(text) if is_text or is_word else " ".join(text.split())


def read_flow(text: str) -> Node:
    """Return the YAML node in the text of a port, after the prefix ``yaml:``. Raises ValueError if it is not YAML."""
    try:
        return compose(SourceText("port", text.removeprefix(YAML_PREFIX)))
    except InvalidFileError as error:
        raise ValueError(f"'{text}' is not YAML") from error


def read_entries(text: str) -> Mapping[str, Node]:
    """Return the values of the mapping in the text of a port, by key; empty if it is not a mapping."""
    try:
        return entries_of(read_flow(text))
    except ValueError:
        return {}


def entries_of(node: Node | None) -> Mapping[str, Node]:
    """Return the values of a YAML mapping by key; empty if ``node`` is not a mapping."""
    return {name.text: value for name, value in node.entries} if isinstance(node, Entries) else {}


def is_text_argument(argument: Argument | None) -> bool:
    """Return whether an argument of a leaf takes only texts, such as names of files."""
    return argument is not None and argument.kind in (*TEXT_KINDS, *NAME_TYPES, "condition")


def is_pointer(value: str) -> bool:
    """Return whether the value of a port names an entry of the blackboard, as ``{x}`` does."""
    text = value.strip().removeprefix("$")  # version 2 wrote ${x}
    return text.startswith("{") and text.endswith("}") and "{" not in text[1:-1] and len(text) > 2
