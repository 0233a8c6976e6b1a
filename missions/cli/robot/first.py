"""What a robot may do first: proposed to who has made one, or has made one this computer's."""

from collections.abc import Mapping, Sequence
from contextlib import suppress

from config.faults import InvalidFileError
from config.library import UnknownNameError
from config.robot import RobotConfig
from missions.library.shipped import load_mission
from missions.library.target import target_of

FIRST: Sequence[tuple[str, Mapping[str, str]]] = (
    ("greet", {}),
    ("square_3m", {}),
    ("wave", {}),
    ("wave", {"gesture": "hello"}),
    ("wave", {"gesture": "arm_wave"}),
    ("look_around", {}),
)
"""Missions with params, of which the first that a robot can do is proposed."""


def able(config: RobotConfig) -> str:
    """Return a mission that the robot can do, as it is typed; empty where it can do none of the first."""
    for mission, params in FIRST:
        with suppress(InvalidFileError, UnknownNameError):
            load_mission(mission, params=params, robot=target_of(config))
            return " ".join([mission, *(f"--param {name}={value}" for name, value in params.items())])
    return ""
