"""Being at a fleet for a command of a terminal."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import click

from config.fleet import FleetKeys, load_fleet
from missions.service.fleet.operator import Operator, operating
from missions.service.task import TaskError

FLEET = click.option("--fleet", "name", metavar="NAME", help="Which fleet; else that of fleet.yaml, or `home`.")
AS_JSON = click.option("--json", "as_json", is_flag=True, help="As JSON, for programs.")


def fleet_of(name: str | None) -> FleetKeys:
    """Return the fleet of the user's file, under another name where one is given."""
    found = load_fleet()
    return found if name is None else replace(found, fleet=name)


@contextmanager
def at(name: str | None) -> Iterator[Operator]:
    """Give an operator of a fleet while this is entered; say what is wrong in words."""
    try:
        with operating(fleet_of(name)) as operator:
            yield operator
    except TaskError as error:
        hint = f"\n  try: {error.hint}" if error.hint else ""
        raise click.ClickException(f"{error}{hint}") from error
