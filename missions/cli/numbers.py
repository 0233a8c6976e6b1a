"""Click types for numbers in plain digits; Python itself accepts digits of other scripts, and ``nan``."""

import re
from typing import Any

import click

from config.units import EXAMPLES, UNITS, si_value, with_article

_WHOLE = re.compile(r"[-+]?[0-9]+")
_REAL = re.compile(r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?")


class WholeNumber(click.IntRange):
    """A whole number within a range."""

    def get_metavar(self, param: click.Parameter, ctx: click.Context) -> str | None:
        """Return "N", which stands for the number in the help of an option."""
        return "N" if isinstance(param, click.Option) else super().get_metavar(param, ctx)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> int:
        if isinstance(value, str) and _WHOLE.fullmatch(value.strip()) is None:
            self.fail(f"{value!r} is not a whole number.", param, ctx)
        return int(super().convert(value, param, ctx))

    def _describe_range(self) -> str:
        """Return the range for help texts; empty if there are no bounds."""
        return "" if self.min is self.max is None else super()._describe_range()


class RealNumber(click.FloatRange):
    """A number within a range."""

    def get_metavar(self, param: click.Parameter, ctx: click.Context) -> str | None:
        """Return "NUMBER", which stands for the number in the help of an option."""
        return "NUMBER" if isinstance(param, click.Option) else super().get_metavar(param, ctx)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        if isinstance(value, str) and _REAL.fullmatch(value.strip()) is None:
            self.fail(f"{value!r} is not a number.", param, ctx)
        return float(super().convert(value, param, ctx))

    def _describe_range(self) -> str:
        """Return the range for help texts; empty if there are no bounds."""
        return "" if self.min is self.max is None else super()._describe_range()


class QuantityInUnit(RealNumber):
    """A quantity as in missions, such as ``20 deg`` or ``0.35 rad``; a bare number is in ``unit``.

    The bounds and the value are in ``unit``.
    """

    def __init__(self, unit: str, low: float | None = None, high: float | None = None) -> None:
        super().__init__(low, high)
        self._unit = unit
        self._dimension = next(dimension for dimension, units in UNITS.items() if unit in units)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Return the value in ``unit``. Raises click.BadParameter."""
        if isinstance(value, str) and _REAL.fullmatch(value.strip()) is None:
            try:
                value = si_value(value, self._dimension) / UNITS[self._dimension][self._unit]
            except ValueError:
                example = EXAMPLES[self._dimension]
                self.fail(f"{value!r} is not {with_article(self._dimension)}, such as '{example}'.", param, ctx)
        return super().convert(value, param, ctx)
