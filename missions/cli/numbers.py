"""Numbers on the command line: in plain digits. Python alone would take those of every script, and ``nan``."""

import re
from typing import Any

import click

_WHOLE = re.compile(r"[-+]?[0-9]+")
_REAL = re.compile(r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?")


class Whole(click.IntRange):
    """A whole number within a range."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> int:
        """Return it. Raises click.BadParameter."""
        if isinstance(value, str) and _WHOLE.fullmatch(value.strip()) is None:
            self.fail(f"{value!r} is not a whole number.", param, ctx)
        return int(super().convert(value, param, ctx))

    def _describe_range(self) -> str:
        """Return the bounds as help texts have them; nothing where there are none."""
        return "" if self.min is self.max is None else super()._describe_range()


class Real(click.FloatRange):
    """A number within a range."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Return it. Raises click.BadParameter."""
        if isinstance(value, str) and _REAL.fullmatch(value.strip()) is None:
            self.fail(f"{value!r} is not a number.", param, ctx)
        return float(super().convert(value, param, ctx))

    def _describe_range(self) -> str:
        """Return the bounds as help texts have them; nothing where there are none."""
        return "" if self.min is self.max is None else super()._describe_range()
