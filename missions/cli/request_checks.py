"""Whether what a user asks of a run makes sense, before anything is opened or written.

So with people whom a mission looks for by name: the robot knows them before it moves, not after a vain search.
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
    """Raise click.UsageError for names in the mission, or in its params, that are nobody's whom the robot knows.

    What a variable holds is not known yet. A simulated robot knows the people of its world; where it knows nobody at
    all, that is only told, for a house whose people are out can be simulated.
    """
    wanted = list(dict.fromkeys(_person_names(plan.tree)))
    if not wanted:
        return
    world = request.world_file() if request.simulation is not None and request.camera is None else None
    known = _known_people(request) if world is None else [person.name for person in world.people if person.known]
    same = {name.casefold() for name in known}
    unknown = [name for name in wanted if name.casefold() not in same]
    names = " or ".join(f"'{name}'" for name in unknown)
    if world is not None and not known:
        click.echo(f"the robot knows nobody in world '{world.name}', so it will not find {names}", err=True)
    elif unknown:
        where = "" if world is None else f" in world '{world.name}'"
        cure = f"mission person add {shlex.quote(unknown[0])}" if world is None else "--world NAME, where they are"
        hint = did_you_mean(unknown[0], known) or f"try: {cure}"
        raise click.UsageError(f"nobody{where} is called {names}; known: {', '.join(known) or 'nobody'}\n  {hint}")


def _person_names(tree: Step) -> Iterator[str]:
    """Yield the names that behaviours look for, as far as they are known now: of nobody in particular there is none."""
    for step in tree.walk():
        if step.leaf is not None and issubclass(step.leaf, FacePerceptLeaf) and "name" in step.arguments:
            name = step.arguments["name"].constant
            if isinstance(name, str) and name and name.casefold() != UNKNOWN:
                yield name


def _known_people(request: RunRequest) -> list[str]:
    """Return whom a robot with a true camera knows. Raises click.UsageError where their pictures cannot be read."""
    # What looks at people is imported where a mission looks for somebody by name.
    from missions.library.people import PeopleError, people_of  # noqa: PLC0415

    camera = requested_robot(request).camera
    if camera is None:
        return []
    try:
        return [each.name for each in people_of(camera).known_people() if each.pictures]
    except PeopleError as error:
        raise click.UsageError(f"{error}\n  try: {error.hint}") from error


def check_request(request: RunRequest) -> None:
    """Raise click.UsageError for options that contradict each other, or could only be ignored."""
    for why in contradictions(request, _option_text, parts_with_ports):
        raise click.UsageError(why)


def _option_text(name: str, value: str = "") -> str:
    """Return how an option is typed."""
    return f"--{name} {value}".rstrip()
