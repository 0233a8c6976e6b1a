"""Marks of exported nodes and trees: data for an import, in places that every editor of BehaviorTree.CPP keeps.

In memory, they are attributes of an element that begin with an underscore, such as ``MARK``. A schema or an editor may
refuse these in a file. So in the file, the mark of a node stands in brackets before its name, as in
``name="[retry] dock"``, with a value in quotes if there is one: ``name="[fail: 'no way']"``. The data of a tree are the
``description`` of its declaration in ``TreeNodesModel``.
"""

import re
from collections import Counter
from collections.abc import Iterable, Mapping

from config.yaml_nodes import Mapping as Entries
from config.yaml_nodes import Scalar
from config.yaml_writer import yaml_word
from missions.language.nodes import MISSION, SWITCHES, WAIT_FOR
from missions.plugins.interchange.node_kinds import (
    CASES,
    COUNTS,
    FILLER,
    INTERRUPTED,
    MARK,
    NUMBER,
    PARAMS,
    PREPARED,
    PROPERTIES,
    REASON,
    RETURNS,
    SUMMARY,
    UNSKIPPED,
)
from missions.plugins.interchange.xml_reader import Element, walk_elements
from missions.plugins.interchange.yaml_ports import YAML_PREFIX, flow_text, read_flow

FAIL = "fail"
VALUES: Mapping[str, str] = {FAIL: REASON, "parallel": COUNTS, MISSION: NUMBER, **dict.fromkeys(SWITCHES, CASES)}
"""Attribute that holds the value of a mark, by its word."""

MARKS = (
    *(FAIL, "parallel", MISSION, *SWITCHES, WAIT_FOR, UNSKIPPED, FILLER, PREPARED, "race", "wait_until", "set"),
    *("while", "until", "for", "retry", "repeat"),
)
MARKED_NAME = re.compile(rf"\[(?:({'|'.join(MARKS)})(?:: '((?:[^']|'')*)')?)?\](?: (.*))?", re.DOTALL)
"""Name with a mark: word, value and the step's own name. An empty mark stands before a name that begins with ``[``."""

HEADER: Mapping[str, str] = {
    MISSION: MARK,
    "summary": SUMMARY,
    "params": PARAMS,
    "returns": RETURNS,
    "properties": PROPERTIES,
    "if_interrupted": INTERRUPTED,
}
"""Attributes of a ``BehaviorTree`` element that hold top-level keys of a mission, by key."""


def write_marks(tree: Element, model: Element) -> None:
    """Move the marks of an exported tree to the names of its nodes and to its declaration ``model``."""
    data = dict[str, str]()
    for key, attribute in HEADER.items():
        if (text := tree.attributes.pop(attribute, None)) is not None:
            data[key] = text.removeprefix(YAML_PREFIX) if text.startswith(YAML_PREFIX) else yaml_word(text)
    text = f"{{{', '.join(f'{key}: {value}' for key, value in data.items())}}}"
    model.children.append(Element("description", {}, model.source, model.line, text=YAML_PREFIX + text))
    names = Counter[str]()
    for element in walk_elements(tree):
        if element.tag == "SubTree" and (name := element.attributes.get("name")):
            names[name] += 1
            if names[name] > 1:
                element.attributes |= {MARK: MISSION, NUMBER: str(names[name])}
        _write_mark(element)


def _write_mark(element: Element) -> None:
    attributes = element.attributes
    word = attributes.pop(MARK, FAIL if REASON in attributes else "")
    name = attributes.get("name", "")
    if not word and not name.startswith("["):
        return
    value = attributes.pop(VALUES[word], "") if word in VALUES else ""
    quoted = value.replace("'", "''")
    mark = f"[{word}: '{quoted}']" if value else f"[{word}]"
    attributes.pop("name", None)
    first = {"ID": attributes.pop("ID")} if "ID" in attributes else {}
    element.attributes = {**first, "name": f"{mark} {name}" if name else mark, **attributes}


def read_marks(trees: Iterable[Element], models: Iterable[Element]) -> None:
    """Restore the attributes of the nodes of ``trees``, and of the trees that ``models`` declare, from their marks."""
    descriptions = {model.attributes.get("ID", ""): description_of_model(model) for model in models}
    for tree in trees:
        text = descriptions.get(tree.attributes.get("ID", ""), "")
        if text.startswith(YAML_PREFIX):
            _read_header(tree, text)
        for element in walk_elements(tree):
            _read_mark(element)


def description_of_model(model: Element) -> str:
    """Return the description in the declaration of a node or a tree; empty without one."""
    return next((each.text.strip() for each in model.children if each.tag == "description"), "")


def _read_header(tree: Element, text: str) -> None:
    try:
        found = read_flow(text)
    except ValueError:
        return
    entries = found.entries if isinstance(found, Entries) and found.get(MISSION) is not None else []
    for key, node in entries:
        if key.text in HEADER:
            value = node.text if isinstance(node, Scalar) else YAML_PREFIX + flow_text(node)
            tree.attributes[HEADER[key.text]] = value


def _read_mark(element: Element) -> None:
    found = MARKED_NAME.fullmatch(element.attributes.get("name", ""))
    if found is None:
        return
    word, value, name = found[1], found[2], found[3]
    del element.attributes["name"]
    if name:
        element.attributes["name"] = name
    if word and word != FAIL:
        element.attributes[MARK] = word
    if word in VALUES and value:
        element.attributes[VALUES[word]] = value.replace("''", "'")
