"""A controller in words: its rule bases, what they listen to, and what they say."""

import math
from collections.abc import Iterator, Mapping

from behaviours.tracking.fuzzy import Controller
from behaviours.tracking.rules import controllers
from behaviours.tracking.terms import Sets
from config.controller import ControllerConfig

UNITS: Mapping[str, tuple[str, float]] = {
    "error": ("deg", math.degrees(1)),
    "pan": ("deg", math.degrees(1)),
    "rate": ("deg/s", math.degrees(1)),
    "edge": ("px", 1.0),
}
"""The unit in which each input is shown, and how many of these one SI unit is."""

OUTPUT = ("deg/s", math.degrees(1))
"""The same for the outputs: all are rates."""


def lines_about(config: ControllerConfig) -> Iterator[str]:
    """Yield what is in a controller, line by line. Raises ValueError for one that is wrong."""
    yield f"{config.name}: {config.summary}"
    yield "acts on what is foreseen" if config.values.get("predict", True) else "acts on what the newest picture shows"
    fuzzy = controllers(config.values)
    for name, values in config.values.items():
        if name in fuzzy:
            yield ""
            yield from _about(name, fuzzy[name])
        elif isinstance(values, Mapping):
            most = values.get("most", math.inf)
            limit = f", at most {most * OUTPUT[1]:.4g} {OUTPUT[0]}" if most < math.inf else ""
            yield f"\n{name}: {values['p']:g} times the error and {values['d']:g} times its rate{limit}"


def _about(name: str, controller: Controller) -> Iterator[str]:
    method = "Mamdani" if isinstance(controller.output, Sets) else "Sugeno"
    yield f"{name}: {len(controller.rules)} rules, {method}"
    for variable in controller.inputs:
        unit, scale = UNITS[variable.name]
        terms = ", ".join(
            f"{term} {_middle(at.full, at.until) * scale:.4g}"
            for term, at in sorted(variable.terms.items(), key=lambda item: _middle(item[1].full, item[1].until))
        )
        yield f"  {variable.name} ({unit}): {terms}"
    for rule in controller.rules:
        yield f"  {rule}"


def _middle(full: float, until: float) -> float:
    """Return the middle of where a term is fully true; of a shoulder, where that begins."""
    if math.isinf(full):
        return until
    return full if math.isinf(until) else (full + until) / 2
