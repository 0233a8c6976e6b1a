"""``mission list``: missions, robots and other files that can be used."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from itertools import chain
from pathlib import Path

import click

from behaviours.joint_ranges import JointRanges
from config.controller import load_controller
from config.defaults import unreadable_folders, user_files
from config.diagnostics import InvalidFileError
from config.gesture import load_gait, load_gesture
from config.library import shipped_files
from config.object import load_object
from config.world import load_world
from drivers.api.driver import BrokenDriver
from drivers.api.sections import ArmKeys
from missions.cli.behaviours import list_behaviours
from missions.cli.console import echo
from missions.cli.option_declarations import behaviours_option
from missions.library.drivers import DriverTable, load_robot
from missions.library.shipped import MOTIONS, load_mission, shipped_missions

LISTED_KINDS = (
    *("missions", "motions", "behaviours", "robots", "worlds", "gestures", "gaits", "controllers", "objects"),
    "drivers",
)


@click.command(epilog="Example: mission list gestures")
@click.argument("kind", required=False, type=click.Choice(LISTED_KINDS), metavar="[KIND]")
@click.option("--json", "as_json", is_flag=True, help="Print behaviours as JSON, with all arguments.")
@behaviours_option
def command(kind: str | None, as_json: bool, files: tuple[Path, ...]) -> None:
    """List the files of MissionTree and your own, one line each, and all drivers.

    Motions are the exercises of the TurtleBot course, by number: `mission run 1`. Each gesture is followed by
    the robots that can perform it, and by the arm if a robot has several. `mission show NAME` shows more.
    """
    if kind != "behaviours" and (as_json or files):
        raise click.UsageError("--json and --behaviours are for behaviours: mission list behaviours")
    for each in LISTED_KINDS if kind is None else (kind,):
        if each == "behaviours":
            if kind is not None:
                list_behaviours(files, as_json=as_json)
            continue
        echo(each, "bold")
        for name, summary in chain(_user_entries(each), _entries(each)):
            click.echo(f"  {name:<28} {summary}")


def _entries(kind: str) -> Iterator[tuple[str, str]]:
    if kind == "missions":
        for name in shipped_missions():
            yield name, load_mission(name).summary
        return
    if kind == "motions":
        for number, name in MOTIONS.items():
            yield f"{number}  {name}", load_mission(f"motions/{name}").summary
        return
    if kind == "drivers":
        yield from _drivers()
        return
    if kind == "gestures":
        yield from _gestures()
        return
    for name, path in shipped_files(kind).items():
        yield name, _SUMMARIES[kind](path)


def _user_entries(kind: str) -> Iterator[tuple[str, str]]:
    """Yield the user's own files of a kind; a file with errors is listed with their number."""
    arms = _arms() if kind == "gestures" else {}
    for name, path in user_files(kind).items():
        try:
            able = f" ({_capable_arms(path, arms)})" if kind == "gestures" else ""
            yield name, f"{_SUMMARIES[kind](path)}{able} ({path})"
        except InvalidFileError as error:
            yield name, f"has {len(error.diagnostics)} errors ({path})"
    for message in unreadable_folders(kind):
        click.echo(f"mission: {message}", err=True)


def _gestures() -> Iterator[tuple[str, str]]:
    arms = _arms()
    for name, path in shipped_files("gestures").items():
        yield name, f"{load_gesture(path).summary} ({_capable_arms(path, arms)})"


def _arms() -> dict[str, JointRanges]:
    """Return the joint ranges of the arms of all robots, by robot name; for a second arm "ROBOT on: ARM"."""
    found = {}
    for name, path in (shipped_files("robots") | user_files("robots")).items():
        with suppress(InvalidFileError):  # the list of robots reports it
            for part, section in load_robot(path).sections.items():
                if isinstance(arm := section.keys, ArmKeys):
                    of = "" if part == "arm" else f" on: {part}"
                    found[f"{name}{of}"] = JointRanges(arm.limits, arm.groups)
    return found


def _capable_arms(path: Path, arms: Mapping[str, JointRanges]) -> str:
    """Return as text the names of the ``arms`` whose joint ranges allow the gesture in the file ``path``."""
    poses = [pose for _, pose in load_gesture(path).keyframes]
    return (
        ", ".join(arm for arm, reach in arms.items() if not reach.limit_violations(poses)) or "for none of these robots"
    )


def _drivers() -> Iterator[tuple[str, str]]:
    """Yield each driver by its name in robot files, with its origin or its error."""
    table = DriverTable()
    for part, name, driver in table.iter_drivers():
        if isinstance(driver, BrokenDriver):
            yield f"{part}.{name}", f"cannot be used: {driver}"
            continue
        origin = table.origin(part, name)
        yield f"{part}.{name}", driver.about + (f" (of {origin})" if origin else "")


_SUMMARIES: dict[str, Callable[[Path], str]] = {
    "missions": lambda path: load_mission(str(path)).summary,
    "gestures": lambda path: load_gesture(path).summary,
    "robots": lambda path: load_robot(path).summary,
    "worlds": lambda path: load_world(path).summary,
    "gaits": lambda path: load_gait(path).summary,
    "controllers": lambda path: load_controller(path).summary,
    "objects": lambda path: load_object(path).summary,
}
