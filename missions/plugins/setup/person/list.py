"""``mission person list``: whom the robot knows, and how surely."""

import json
from datetime import UTC, datetime

import click

from missions.cli.columns import in_columns
from missions.cli.commands import SharingCommand
from missions.cli.names import PERSON
from missions.cli.root import FAILURE, SUCCESS
from missions.library.people import Known, PeopleError
from missions.plugins.setup.person.asked import camera_of, judged_otherwise, people_for, robot_option, saying_why, tell
from perception.elastic import Calibration
from perception.people import KnownPeople

# ``mission person remove``: forget people, and delete their pictures.


@click.command(cls=SharingCommand, epilog="Example: mission person remove Anna")
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


@click.command("list", cls=SharingCommand, epilog="Example: mission person list --robot turtlebot2_arm")
@click.option("--json", "as_json", is_flag=True, help="As one line of JSON.")
@robot_option
@saying_why
def list_people(as_json: bool, robot: str | None) -> int:
    """List the people whom a robot knows, and how surely patches of their faces tell them apart.

    A robot whose method is another is not tried by that.
    """
    people = people_for(robot)
    known = people.known()
    portraits = people.portraits(tell)
    calibration = KnownPeople(portraits).calibration if portraits else None
    if as_json:
        click.echo(json.dumps(_data(known, calibration)))
        return SUCCESS
    if not known:
        click.echo("it knows nobody yet\n  try: mission person add NAME", err=True)
        return SUCCESS
    click.echo(in_columns(("name", "pictures", "since"), [_row(each) for each in known], left=frozenset({"name"})))
    if calibration is not None:
        click.echo(f"\n{_words(calibration)}")
        if otherwise := judged_otherwise(camera_of(robot)):
            click.echo(otherwise)
    return SUCCESS


def _row(known: Known) -> list[str]:
    return [known.name, str(known.pictures), datetime.fromtimestamp(known.since, UTC).astimezone().strftime("%Y-%m-%d")]


def _data(known: list[Known], calibration: Calibration | None) -> dict[str, object]:
    rates = None
    if calibration is not None:
        threshold = round(min(calibration.thresholds.values()), 3)
        rates = {"method": "patches", "threshold": threshold, "refused": calibration.refused,
                 "accepted": calibration.accepted, "looks": calibration.looks}  # fmt: skip
    people = [{"name": each.name, "pictures": each.pictures, "since": each.since} for each in known]
    return {"people": people, "rates": rates}


def _words(calibration: Calibration) -> str:
    """Say how surely it tells people apart, and of how much that was found out."""
    if calibration.refused is None:
        return "how surely it tells them apart cannot be said from so few pictures"
    refused = f"of 100 looks at them {100 * calibration.refused:.0f} take them for nobody"
    if calibration.accepted is None:
        accepted = "what it makes of strangers can only be tried with somebody else in the list"
    else:
        accepted = f"of 100 at strangers {100 * calibration.accepted:.0f} take them for somebody"
    doubt = "all at these very pictures and people: expect worse on other days, and of other strangers"
    return f"{refused},\n{accepted} ({calibration.looks} looks, {doubt})"
