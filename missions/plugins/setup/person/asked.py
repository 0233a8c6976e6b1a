"""What the commands of ``mission person`` share: whose people are meant, and saying what cannot be done."""

import functools
from collections.abc import Callable
from typing import Any

import click

from config.library import find
from drivers.api.senses import CameraKeys
from missions.cli.commands import shared_option
from missions.cli.names import ROBOT
from missions.cli.root import FAILURE
from missions.library.drivers import load_robot
from missions.library.people import People, PeopleError, people_of

robot_option = shared_option(
    "--robot", type=ROBOT, help="Whose people: those in the folder that its file names. Without it: yours."
)


def camera_of(robot: str | None) -> CameraKeys | None:
    """Return the camera section of a robot's file; None without a robot. Raises click.UsageError for a blind one."""
    if robot is None:
        return None
    camera = load_robot(find("robots", robot)).camera
    if camera is None:
        raise click.UsageError(f"{robot} has no camera")
    return camera


def judged_otherwise(camera: CameraKeys | None) -> str:
    """Return what to say where a robot recognises people by another method than these commands; else nothing."""
    method = "patches" if camera is None else camera.identity.method
    return (
        ""
        if method == "patches"
        else f"judged by patches, while the robot's method is {method}: that is not tried here"
    )


def people_for(robot: str | None) -> People:
    """Return the people whom a robot knows, the user's own without one."""
    return people_of(camera_of(robot))


def saying_why(command: Callable[..., int]) -> Callable[..., int]:
    """Make a command say what cannot be done with pictures of people, and fail."""

    @functools.wraps(command)
    def wrapped(*arguments: Any, **named: Any) -> int:
        try:
            return command(*arguments, **named)
        except PeopleError as error:
            tell(error)
            return FAILURE

    return wrapped


def tell(error: PeopleError) -> None:
    """Print what cannot be done, and what to type next."""
    click.echo(f"mission: {error}" + (f"\n  try: {error.hint}" if error.hint else ""), err=True)
