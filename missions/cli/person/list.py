"""``mission person list``: whom the robot knows, and how surely."""

import json
from datetime import UTC, datetime

import click

from missions.cli.person.asked import camera_of, judged_otherwise, people_for, robot_option, saying_why, tell
from missions.cli.root import SUCCESS
from missions.library.people import Known
from missions.views.columns import in_columns
from perception.elastic import Calibration
from perception.people import KnownPeople


@click.command("list", epilog="Example: mission person list --robot turtlebot2_arm")
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
