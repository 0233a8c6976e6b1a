"""World of one run: a world file with the drawn values of that run."""

from collections.abc import Iterable
from copy import deepcopy
from random import Random
from typing import Any

import yaml

from config.diagnostics import SourceText
from config.yaml_nodes import Listing, Mapping, Node, compose
from missions.plugins.testing.sweep.parameters import find_parameter
from missions.plugins.testing.sweep.people import PlainMapping
from missions.plugins.testing.sweep.variation import DrawnValue, Variation


def plain_world(source: SourceText) -> PlainMapping:
    """Return a world file as plain lists, mappings and values. Raises InvalidFileError if it is not a mapping."""
    found: PlainMapping = _plain_value(compose(source))
    return found


def vary_world(world: PlainMapping, draws: Iterable[tuple[Variation, DrawnValue]], seed: int) -> str:
    """Return the text of a world file: ``world`` with the drawn values of a run. Raises ValueError.

    The order of the variations does not matter.
    """
    world = deepcopy(world)
    knobs = [(find_parameter(variation.name), variation, value) for variation, value in draws]
    for knob, variation, value in sorted(knobs, key=lambda each: each[0].rank):
        knob.apply(world, value, Random(f"more of {variation.name} in run {seed}"))  # noqa: S311 - no secret
    return yaml.safe_dump(world, sort_keys=False, default_flow_style=None, allow_unicode=True, width=100)


def _plain_value(node: Node) -> Any:
    if isinstance(node, Listing):
        return [_plain_value(item) for item in node.items]
    if isinstance(node, Mapping):
        return {key.text: _plain_value(value) for key, value in node.entries}
    # YAML cannot write the class of numbers without a unit.
    return float(node.value) if isinstance(node.value, float) else node.value
