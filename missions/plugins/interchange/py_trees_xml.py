"""Reader of the XML of py_trees 2.6: changes its nodes to the names and ports that BehaviorTree.CPP gives them."""

from missions.plugins.interchange.node_kinds import PY_TREES_KINDS
from missions.plugins.interchange.xml_reader import Element, walk_elements

BTCPP_FORMAT = "BTCPP_format"


def is_py_trees(root: Element) -> bool:
    """Return whether an XML file was written for py_trees, and not for BehaviorTree.CPP.

    Decorators, includes or attributes that only py_trees has show it.
    """
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
    """Change the elements below ``root`` from py_trees to BehaviorTree.CPP, in place.

    In py_trees, a reactive composite has the attribute ``memory="false"``, a Parallel has a ``policy``, and a Timeout
    has a ``duration`` in seconds.
    """
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
