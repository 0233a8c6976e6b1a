"""XML of py_trees 2.6: its composites and decorators, in the names and ports of BehaviorTree.CPP."""

from missions.plugins.interchange.node_kinds import PY_TREES_KINDS
from missions.plugins.interchange.xml_reader import Element, walk_elements

BTCPP_FORMAT = "BTCPP_format"


def is_py_trees(root: Element) -> bool:
    """Return whether a file is one of py_trees: its own attributes, decorators or imports show it."""
    if BTCPP_FORMAT in root.attributes:
        return False
    names = {name.lower() for name in PY_TREES_KINDS}
    return any(
        element.tag.lower() in names
        or (element.tag.lower() == "import" and "src" in element.attributes)
        or (element.tag.lower() in ("sequence", "selector", "fallback") and "memory" in element.attributes)
        or (element.tag.lower() == "parallel" and "policy" in element.attributes)
        or (element.tag.lower() == "timeout" and "duration" in element.attributes)
        for element in walk_elements(root)
    )


def adapt_py_trees(root: Element) -> None:
    """Rename nodes and ports: a reactive composite has ``memory`` false there, a parallel has a ``policy``."""
    root.attributes[BTCPP_FORMAT] = "4"
    for element in walk_elements(root):
        tag, attributes = element.tag.lower(), element.attributes
        if tag in ("sequence", "selector", "fallback"):
            reactive = "" if attributes.pop("memory", "true").lower() == "true" else "Reactive"
            element.tag = f"{reactive}{'Sequence' if tag == 'sequence' else 'Fallback'}"
        elif tag == "parallel":
            policy = attributes.pop("policy", "success_on_one").lower()
            attributes["success_count"] = "-1" if policy == "success_on_all" else "1"
        elif tag == "timeout" and "duration" in attributes:
            attributes["msec"] = _milliseconds(attributes.pop("duration"))


def _milliseconds(seconds: str) -> str:
    try:
        return f"{float(seconds) * 1000:.12g}"
    except ValueError:
        return seconds
