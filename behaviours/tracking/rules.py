"""The rules to follow by: what a controller file holds, each part worked out to a surface that is quick to read.

A PD controller, the textbook's answer, is among them to compare the fuzzy ones with.
"""

import math
from collections.abc import Callable, Mapping
from typing import Any

from behaviours.tracking.fuzzy import Controller
from drivers.api.quick import dataclass

KEYS = ("p", "d", "most")


@dataclass(frozen=True, slots=True)
class ProportionalDerivative:
    """A rate (rad/s) of ``p`` (1/s) times the error (radians) plus ``d`` times its rate (rad/s), ``most`` at most."""

    p: float
    d: float
    most: float = math.inf

    @classmethod
    def from_mapping(cls, name: str, mapping: Mapping[str, object]) -> "ProportionalDerivative":
        """Make it of plain SI values: ``p``, ``d`` and perhaps ``most``.

        Raises ValueError, as ``name``, for a value that is no number of 0 or more, and for any other key.
        """
        if unknown := mapping.keys() - set(KEYS):
            raise ValueError(f"{name}: a PD controller has no '{min(unknown)}'; known are: {', '.join(KEYS)}")
        found: dict[str, float] = {}
        for key, value in mapping.items():
            if isinstance(value, bool) or not isinstance(value, int | float) or not value >= 0:
                raise ValueError(f"{name}: '{key}' needs a number of 0 or more, not {value!r}")
            found[key] = float(value)
        if missing := {"p", "d"} - found.keys():
            raise ValueError(f"{name}: a PD controller needs '{min(missing)}'")
        return cls(**found)

    def __call__(self, error: float, rate: float) -> float:
        """Return the rate for an error and how fast it changes. Raises ValueError for NaN."""
        asked = self.p * error + self.d * rate
        if math.isnan(asked):
            raise ValueError("a value is not a number (NaN)")
        return min(max(asked, -self.most), self.most)


ERROR, RATE, PAN, EDGE = "error", "rate", "pan", "edge"

INPUTS: Mapping[str, tuple[str, ...]] = {
    "pan": (ERROR, RATE, EDGE),
    "tilt": (ERROR, RATE),
    "base": (PAN, ERROR, RATE, EDGE),
    "turn": (ERROR, RATE, EDGE),
}
"""The rule bases that there are, and the inputs that each may use."""


@dataclass(frozen=True, slots=True)
class Law:
    """A control law: a number out of some of the inputs, picked by name and handed to a ``surface`` in that order."""

    inputs: tuple[str, ...]
    surface: Callable[..., float]

    def __call__(self, known: Mapping[str, float]) -> float:
        """Return the output for inputs by name. Raises ValueError for NaN, KeyError for an input that is missing."""
        return self.surface(*[known[name] for name in self.inputs])


@dataclass(frozen=True, slots=True)
class RuleBases:
    """The rules to follow by; all outputs are rates in rad/s.

    ``pan`` and ``tilt`` turn the head's aim. ``base`` turns the base of a robot that has a head, ``turn`` that of one
    whose camera sits on the base. None leaves its axis still.

    With ``predict``, ``error`` (radians) is from the aim to where the target will be when the command acts, and
    ``rate`` (rad/s) the target's own, as seen from the base. Without, both are what the newest picture shows: how far
    the target is off the camera's axis, and how fast that changes from picture to picture. ``pan`` (radians) is where
    the head looks; ``edge`` the left edge of a face's box, in pixels of the picture, as the course's tracker had it.
    """

    pan: Law | None = None
    tilt: Law | None = None
    base: Law | None = None
    turn: Law | None = None
    predict: bool = True

    @classmethod
    def from_mapping(cls, mapping: Mapping[str, Any]) -> "RuleBases":
        """Make them of plain SI values: up to four rule bases, and ``predict``.

        A rule base is fuzzy (see ``Controller.from_mapping``), or ``{p, d, most}`` for a PD controller of error and
        rate. Raises ValueError for one that is wrong, for another name or input, and for nothing to turn by.
        """
        rest = dict(mapping)
        predict = rest.pop("predict", True)
        if not isinstance(predict, bool):
            raise ValueError(f"'predict' needs true or false, not {predict!r}")
        if unknown := rest.keys() - INPUTS.keys():
            raise ValueError(f"'{min(unknown)}' is none of the rule bases {', '.join(INPUTS)}, nor 'predict'")
        if not rest.keys() & {"pan", "turn"}:
            raise ValueError("needs 'pan' to turn a head by, or 'turn' to turn a base by, or both")
        return cls(**{name: _law(name, found) for name, found in rest.items()}, predict=predict)


def controllers(mapping: Mapping[str, Any]) -> dict[str, Controller]:
    """Return the fuzzy rule bases among the values of a controller file, by name. Raises as ``RuleBases`` does."""
    return {
        name: Controller.from_mapping(name, found)
        for name, found in mapping.items()
        if isinstance(found, Mapping) and "inputs" in found
    }


def _law(name: str, found: object) -> Law:
    mapping = found if isinstance(found, Mapping) else {}
    if "p" in mapping:
        law = Law((ERROR, RATE), ProportionalDerivative.from_mapping(name, mapping))
    else:
        controller = Controller.from_mapping(name, mapping)
        law = Law(tuple(variable.name for variable in controller.inputs), controller.tabulate())
    if unknown := [given for given in law.inputs if given not in INPUTS[name]]:
        raise ValueError(f"{name}: there is no input '{unknown[0]}' for it; there are {', '.join(INPUTS[name])}")
    return law
