"""``mission person remove``: forget people, and delete their pictures."""

import click

from missions.cli.names import PERSON
from missions.cli.person.asked import people_for, robot_option, saying_why
from missions.cli.root import FAILURE, SUCCESS
from missions.library.people import PeopleError


@click.command(epilog="Example: mission person remove Anna")
@click.argument("names", type=PERSON, nargs=-1, required=True, metavar="NAMES...")
@click.option("--yes", is_flag=True, help="Do not ask.")
@robot_option
@saying_why
def remove(names: tuple[str, ...], yes: bool, robot: str | None) -> int:
    """Forget people: their pictures are deleted, and there is nothing else of them."""
    people = people_for(robot)
    unknown = [name for name in names if people.find(name) is None]
    if unknown:
        known = ", ".join(each.name for each in people.known()) or "nobody"
        told = f"nobody is called '{', '.join(unknown)}'; nothing was deleted; known: {known}"
        raise PeopleError(told, hint="mission person list")
    if not yes and not click.confirm(f"Delete all pictures of {', '.join(names)}?"):
        return FAILURE
    for name in dict.fromkeys(people.find(name) or name for name in names):
        click.echo(f"{name}: {people.remove(name)} pictures deleted")
        if (people.where / name).exists():
            click.echo(f"{people.where / name} stays: there is something else in it", err=True)
    return SUCCESS
