"""Checks of a run request before any device or file is opened.

They also find names of people that the robot does not know, so that these are reported before it moves.
"""

import shlex
from collections.abc import Iterator

import click

from behaviours.sight import FacePerceptLeaf
from config.diagnostics import did_you_mean
from missions.language.plan import Plan, Step
from missions.request import RunRequest, contradictions
from missions.runner import parts_with_ports, requested_robot
from perception.api import UNKNOWN


def check_people(request: RunRequest, plan: Plan) -> None:
    """Raise click.UsageError if the mission, or a param, names a person that the robot does not know.

    A name that is only computed during the run is not checked. A simulated robot knows the people of its world. If that
    world has no known person, a message is printed and no error raised, so that an empty house can be simulated.
    """
    names_in_mission = list(dict.fromkeys(_person_names(plan.tree)))
    if not names_in_mission:
        return
    world = request.world_file() if request.simulation is not None and request.camera is None else None
    known = _known_people(request) if world is None else [person.name for person in world.people if person.known]
    same = {name.casefold() for name in known}
    unknown = [name for name in names_in_mission if name.casefold() not in same]
    names = " or ".join(f"'{name}'" for name in unknown)
    if world is not None and not known:
        click.echo(f"no known person in world '{world.name}': the robot will not find {names}", err=True)
    elif unknown:
        where = "" if world is None else f" in world '{world.name}'"
        cure = f"mission person add {shlex.quote(unknown[0])}" if world is None else "--world NAME, where they are"
        hint = did_you_mean(unknown[0], known) or f"try: {cure}"
        raise click.UsageError(f"no person{where} is called {names}; known: {', '.join(known) or 'none'}\n  {hint}")


def _person_names(tree: Step) -> Iterator[str]:
    """Yield the names of people that the mission's behaviours look for, except names computed during the run."""
    for step in tree.walk():
        if step.leaf is not None and issubclass(step.leaf, FacePerceptLeaf) and "name" in step.arguments:
            name = step.arguments["name"].constant
            if isinstance(name, str) and name and name.casefold() != UNKNOWN:
                yield name


def _known_people(request: RunRequest) -> list[str]:
    """Return the people that a robot with a real camera knows. Raises click.UsageError for unreadable pictures."""
    # Imported only if a mission looks for a person by name: the detectors are slow to import.
    from missions.library.people import PeopleError, people_of  # noqa: PLC0415

    camera = requested_robot(request).camera
    if camera is None:
        return []
    try:
        return [each.name for each in people_of(camera).known_people() if each.pictures]
    except PeopleError as error:
        raise click.UsageError(f"{error}\n  try: {error.hint}") from error


def check_request(request: RunRequest) -> None:
    """Raise click.UsageError for options that contradict each other or have no effect."""
    for why in contradictions(request, _option_text, parts_with_ports):
        raise click.UsageError(why)


def _option_text(name: str, value: str = "") -> str:
    """Return an option as the user types it."""
    return f"--{name} {value}".rstrip()
