"""Arguments as the file has them, for pictures: "60 deg", not 1.0472."""

from behaviours.leaf import Leaf
from config.marked import Listing, Mapping, Node, Scalar


def written_arguments(leaf: type[Leaf], node: Node | None) -> dict[str, str]:
    """Return the arguments that stand behind a leaf's word, by name; those that are left out are not there."""
    if isinstance(node, Mapping):
        return written_entries(node)
    principal = next((argument.name for argument in leaf.arguments.values() if argument.principal), None)
    if principal is None or node is None or (isinstance(node, Scalar) and node.value is None):
        return {}
    return {principal: as_written(node)}


def written_entries(node: Node | None) -> dict[str, str]:
    """Return names with what is given for each; nothing where there is no mapping."""
    return {name.text: as_written(given) for name, given in node.entries} if isinstance(node, Mapping) else {}


def as_written(node: Node) -> str:
    """Return what a node says, without quotes; lists as ``[a, b]``, mappings as ``{k: v}``, each on one line."""
    if isinstance(node, Listing):
        return f"[{', '.join(map(as_written, node.items))}]"
    if isinstance(node, Mapping):
        return f"{{{', '.join(f'{name}: {value}' for name, value in written_entries(node).items())}}}"
    return node.text
