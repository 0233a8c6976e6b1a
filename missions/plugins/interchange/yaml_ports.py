"""Values of missions as ports: the text itself, ``{x}`` for ``${x}``, and ``yaml: ...`` for all others.

``yaml: [1 m, "${x}"]`` holds a list or a mapping, and texts that would read as something else: ``yaml: "5"``.
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
from missions.plugins.interchange.foreign_trees import is_pointer

YAML_PREFIX = "yaml: "
ONE_NAME = re.compile(r"\$\{\s*([A-Za-z_]\w*)\s*\}", re.ASCII)


def flow_text(node: Node) -> str:
    """Return a node in YAML's flow style, on one line."""
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
    """Return the value of a port for a value of a mission; ``is_text`` if the argument takes only texts."""
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
    """Return a port's value as YAML in flow style. Raises ValueError if it is not well-formed."""
    if text.startswith(YAML_PREFIX):
        return flow_text(read_flow(text))
    if is_pointer(text):
        return json.dumps(f"${{{text.strip()[1:-1].strip()}}}", ensure_ascii=False)
    is_word = isinstance(plain_value(text), str) and parse_quantity(text) is None
    return yaml_word(text) if is_text or is_word else text


def read_flow(text: str) -> Node:
    """Return the node in a value with the prefix. Raises ValueError if it is not well-formed."""
    try:
        return compose(SourceText("port", text.removeprefix(YAML_PREFIX)))
    except InvalidFileError as error:
        raise ValueError(f"'{text}' is not YAML") from error


def read_entries(text: str) -> Mapping[str, Node]:
    """Return the entries of a mapping in a value with the prefix; empty if it is none."""
    try:
        found = read_flow(text)
    except ValueError:
        return {}
    return {name.text: value for name, value in found.entries} if isinstance(found, Entries) else {}


def is_text_argument(argument: Argument | None) -> bool:
    """Return whether an argument takes only texts."""
    return argument is not None and argument.kind in (*TEXT_KINDS, *NAME_TYPES, "condition")
