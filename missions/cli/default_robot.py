"""Missions loaded for the named robot, or for the one that a run would use."""

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

robot_option = click.option("--robot", type=ROBOT, help="Robot to check for (name or file).")


class NotForThisRobotError(InvalidFileError):
    """A mission that is correct but cannot run on the default robot.

    The message names a robot that can run it, if there is one.
    """

    def __init__(self, faults: Sequence[Diagnostic], name: str, robot: str, able: str) -> None:
        super().__init__(faults)
        run = f"`mission run {name} --robot {able} --simulate`"
        cure = f"robot '{able}' can do it: {run}" if able else "for another robot: --robot NAME"
        self.args = (f"{self.args[0]}\n  {name} was checked for the default robot ({robot}); {cure}",)


def robots_for(robot: str | None) -> list[Path]:
    """Return the file of the named robot; without a name, the default robot first, then the others of MissionTree.

    Raises UnknownNameError, InvalidFileError.
    """
    if robot is not None:
        return [find_file("robots", robot)]
    first = find_file("robots", chosen_robot(None) or DEFAULT_ROBOT)
    return [first, *(file for file in shipped_files("robots").values() if file != first)]


def load_mission_for(
    name: str, params: Mapping[str, str], robots: Sequence[Path], leaves: Mapping[str, type[Leaf]]
) -> tuple[Plan, Path]:
    """Load a mission for the first of ``robots``; return the plan and the file of the robot for which it was checked.

    A mission of MissionTree that the first robot cannot do is checked for the others in turn. Raises InvalidFileError,
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
    """Return the plan of a mission, and the first of ``robots`` that can do it, or None for the robot if none can.

    Return None if ``robots`` is empty, or if the mission has errors that do not depend on the robot.
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
    """Return the robot of the file ``robot`` as the mission checker describes it. Raises InvalidFileError."""
    return target_of(load_robot(robot))
