"""Missions read for the robot that will do them: the one that is named, or the one that a run takes if none is."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path

import click

from behaviours.leaf import Leaf
from config.diagnostics import Diagnostic, InvalidFileError
from config.library import DEFAULT_ROBOT, find_file, shipped_files
from missions.cli.names import ROBOT
from missions.cli.origin import chosen_robot
from missions.language.claims import TargetRobot
from missions.language.plan import Plan
from missions.library.drivers import load_robot
from missions.library.shipped import load_mission, shipped_missions
from missions.library.target import target_of

robot_option = click.option("--robot", type=ROBOT, help="Check that this robot can do it (a name or a file).")


class NotForThisRobotError(InvalidFileError):
    """A mission that is right but for the usual robot; its text says so, and which robot can do it."""

    def __init__(self, faults: Sequence[Diagnostic], name: str, robot: str, able: str) -> None:
        super().__init__(faults)
        cure = f"robot '{able}' can do it: --robot {able}" if able else "for another robot: --robot NAME"
        self.args = (f"{self.args[0]}\n  {name} was checked for the usual robot ({robot}); {cure}",)


def robots_for(robot: str | None) -> list[Path]:
    """Return the file of the robot that is named; for none, the one that a run takes first, then those that ship.

    Raises UnknownNameError, InvalidFileError.
    """
    if robot is not None:
        return [find_file("robots", robot)]
    first = find_file("robots", chosen_robot(None) or DEFAULT_ROBOT)
    return [first, *(file for file in shipped_files("robots").values() if file != first)]


def load_mission_for(
    name: str, params: Mapping[str, str], robots: Sequence[Path], leaves: Mapping[str, type[Leaf]]
) -> tuple[Plan, Path]:
    """Return a mission read for the first of ``robots``, and that robot's file.

    What ships is good where one of the other robots can do it, whose file is returned then. Raises InvalidFileError,
    NotForThisRobotError or UnknownNameError.
    """
    try:
        return load_mission(name, params=params, robot=load_target(robots[0]), leaves=leaves), robots[0]
    except InvalidFileError as error:
        found = _load_for_others(name, params, robots[1:], leaves)
        if found is None:
            raise
        plan, able = found
        if able is None or plan.source.name not in map(str, shipped_missions().values()):
            able_name = "" if able is None else able.stem
            raise NotForThisRobotError(error.diagnostics, name, robots[0].stem, able_name) from None
        return plan, able


def _load_for_others(
    name: str, params: Mapping[str, str], robots: Sequence[Path], leaves: Mapping[str, type[Leaf]]
) -> tuple[Plan, Path | None] | None:
    """Return the plan with the robot among ``robots`` that can do it; None for one that is right but for the robot.

    None where it is wrong whatever the robot, or where there is no other robot.
    """
    if not robots:
        return None
    with suppress(InvalidFileError):
        plan = load_mission(name, params=params, leaves=leaves)
        for path in robots:
            with suppress(InvalidFileError):
                return load_mission(name, params=params, robot=load_target(path), leaves=leaves), path
        return plan, None
    return None


@cache
def load_target(robot: Path) -> TargetRobot:
    """Return what the checker must know of the robot of a file. Raises InvalidFileError."""
    return target_of(load_robot(robot))
