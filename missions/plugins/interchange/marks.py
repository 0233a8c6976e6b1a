"""Marks of exported nodes: data for an import, in a place that every editor of BehaviorTree.CPP keeps.

In memory, they are attributes of an element that begin with an underscore, such as ``MARK``. A schema or an editor may
refuse these in a file. So in the file, the mark of a node stands in brackets before its name, as in
``name="[retry] dock"``, with a value in quotes if there is one: ``name="[fail: 'no way']"``.
"""

import re
from collections import Counter
from collections.abc import Mapping

from missions.language.nodes import MISSION, SWITCHES, WAIT_FOR
from missions.plugins.interchange.node_kinds import (
    CASES,
    COUNTS,
    FILLER,
    MARK,
    NUMBER,
    PREPARED,
    REASON,
    UNSKIPPED,
)
from missions.plugins.interchange.xml_reader import Element, walk_elements

FAIL = "fail"
VALUES: Mapping[str, str] = {FAIL: REASON, "parallel": COUNTS, MISSION: NUMBER, **dict.fromkeys(SWITCHES, CASES)}
"""Attribute that holds the value of a mark, by its word."""

MARKS = (
    *(FAIL, "parallel", MISSION, *SWITCHES, WAIT_FOR, UNSKIPPED, FILLER, PREPARED, "race", "wait_until", "set"),
    *("while", "until", "for", "retry", "repeat"),
)
MARKED_NAME = re.compile(rf"\[(?:({'|'.join(MARKS)})(?:: '((?:[^']|'')*)')?)?\](?: (.*))?", re.DOTALL)
"""Name with a mark: word, value and the step's own name. An empty mark stands before a name that begins with ``[``."""


def write_marks(tree: Element) -> None:
    """Move the marks of an exported tree to the names of its nodes."""
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


def read_marks(tree: Element) -> None:
    """Restore the marks of the nodes of a tree from their names."""
    for element in walk_elements(tree):
        _read_mark(element)


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
