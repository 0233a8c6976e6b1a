"""``in_turn`` beside a ``selector``, and ``weights`` beside a ``random_selector``: the order of their children."""

from functools import partial

from config.units import NUMBER, Quantity, quoted_value
from config.yaml_nodes import Listing, Mapping, Node, Scalar
from missions.language.check_context import CheckContext
from missions.language.expressions import INVALID_VALUE, Value
from missions.language.kinds import ListKind
from missions.language.lists import untyped_members
from missions.language.nodes import IN_TURN, WEIGHTS

MAX_WEIGHT = 1_000_000
"""Maximum weight of a child, so that sums of weights are exact enough."""

WEIGHTS_HINT = "write weights: [2, 1], a number for each child"

Weights = tuple[float, ...]


def read_order(context: CheckContext, beside: Mapping, children: int) -> dict[str, Value]:
    """Return the values of ``in_turn`` and ``weights`` beside a composite with this number of children."""
    found = {}
    for word, node in beside.entries:
        if word.text == IN_TURN:
            if not isinstance(node, Scalar) or node.value is not True:
                context.fault(node.mark, f"'{IN_TURN}' takes only true")
            found[IN_TURN] = Value(True)
        elif word.text == WEIGHTS:
            found[WEIGHTS] = _read_weights(context, node, children)
    return found


def _read_weights(context: CheckContext, node: Node, children: int) -> Value:
    label, convert = f"'{WEIGHTS}'", partial(_as_weights, children)
    if isinstance(node, Scalar) and "${" in node.text:
        return context.read_value(node, label, convert, ListKind(NUMBER))
    if not isinstance(node, Listing):
        context.fault(node.mark, f"{label} needs a list of numbers", WEIGHTS_HINT)
        return INVALID_VALUE
    try:
        members = untyped_members(node)
    except ValueError as error:
        context.fault(node.mark, f"{label} {error}", f'write weights: "{_computed_list(node)}"')
        return INVALID_VALUE
    return context.convert_constant(node, members, label, convert)


def _computed_list(node: Listing) -> str:
    """Return one expression for a list with expressions among its members."""
    texts = [item.text if isinstance(item, Scalar) else "NUMBER" for item in node.items]
    return f"${{[{', '.join(text.removeprefix('${').removesuffix('}') for text in texts)}]}}"


def _as_weights(children: int, value: object) -> Weights:
    """Return a list from the mission as the weights of a composite's children.

    Raises ValueError unless it has one number for each child, at least one of them above 0.
    """
    if not isinstance(value, list | tuple):
        raise ValueError(f"needs a list of numbers, got {quoted_value(value)}")
    if len(value) != children:
        raise ValueError(f"needs a number for each of its {children} children, got {len(value)}")
    weights = tuple(map(_as_weight, value))
    if not any(weights):
        raise ValueError("needs a number above 0")
    return weights


def _as_weight(value: object) -> float:
    is_quantity = isinstance(value, Quantity) and value.dimension != "share"
    if isinstance(value, bool) or is_quantity or not isinstance(value, int | float):
        raise ValueError(f"needs numbers, got {quoted_value(value)}")
    if not 0 <= value <= MAX_WEIGHT:
        raise ValueError(f"needs numbers from 0 to {MAX_WEIGHT:,}, got {quoted_value(value)}")
    return float(value)
