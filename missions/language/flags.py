"""Which expressions are true or false, as far as that is known without running them."""

import ast
from collections.abc import Mapping

from missions.language.expressions import Expression
from missions.language.spelling import WORDS
from missions.language.values import Value

FLAGS = frozenset(
    f"{part}.{member}"
    for part, members in {
        "base": ("bumper", "cliff", "wheel_drop", "docked", "stopped"),
        "battery": ("charging", "low", "critical"),
        "face": ("seen", "undecided"),
    }.items()
    for member in members
)
"""The state that is true or false."""


def is_flag(value: Value, params: Mapping[str, object]) -> bool:
    """Say whether a value is surely true or false; ``params`` are those that are known."""
    if isinstance(value.template, Expression):
        return _is_flag(value.template.tree, params)
    return isinstance(value.constant, bool)


def _is_flag(node: ast.expr, params: Mapping[str, object]) -> bool:
    match node:
        case ast.Compare() | ast.BoolOp() | ast.UnaryOp(op=ast.Not()) | ast.Constant(value=bool()):
            return True
        case ast.Name(id=name):
            return isinstance(WORDS.get(name), bool) or isinstance(params.get(name), bool)
        case ast.Attribute(value=ast.Name(id=part), attr=member):
            return f"{part}.{member}" in FLAGS
        case ast.IfExp(body=body, orelse=orelse):
            return _is_flag(body, params) and _is_flag(orelse, params)
    return False
