"""A mission as it is offered to somebody who may run it: read with the leaves beside it, and its params for a form."""

from math import isfinite

from config.units import UNITS, written
from missions.language.document import declared_params
from missions.language.params import Param
from missions.language.plan import Plan
from missions.language.values import shown
from missions.library.shipped import behaviour_files, find_mission, load_mission
from missions.library.things import THINGS
from missions.library.vocabulary import vocabulary


def load_with_own(name: str) -> Plan:
    """Return a mission, with the leaves in files beside it. Raises InvalidFileError or UnknownNameError."""
    return load_mission(name, leaves=vocabulary(behaviour_files(name), given=()))


def params_of(name: str) -> list[dict[str, object]]:
    """Return the params of a mission as a form has them. Raises InvalidFileError or UnknownNameError."""
    leaves = vocabulary(behaviour_files(name), given=())
    return [_param(each) for each in declared_params(find_mission(name), leaves, THINGS).values()]


def _param(param: Param) -> dict[str, object]:
    """Return a param as a form has it."""
    kind = param.type
    told: dict[str, object] = {
        "name": param.name,
        "kind": kind.kind,
        "default": None if not param.known else shown(param.default),
        "help": param.help,
    }
    if kind.kind != kind.of:
        told["of"] = kind.of
    if kind.of in UNITS:
        told["units"] = list(UNITS[kind.of])
    if kind.choices:
        told["choices"] = list(kind.choices)
    for side, bound in (("low", kind.low), ("high", kind.high)):
        if isfinite(bound):
            told[side] = written(bound, kind.of) if kind.of in UNITS else f"{bound:g}"
    return told
