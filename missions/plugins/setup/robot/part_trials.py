"""Trials while a robot file is created: directions and trims of the head, pictures of the camera."""

from collections.abc import Mapping
from math import degrees, radians
from typing import Any

from config.robot import RobotConfig, Section
from config.units import si_value
from drivers.api import HeadPose
from drivers.api.driver import DriverContext, resolve_name
from drivers.api.secrets import without_secrets
from drivers.clock import SystemClock
from drivers.errors import DriverError
from drivers.head.keys import TwoServoKeys
from drivers.servos.declared import NeckKeys
from missions.plugins.setup.head_connection import DEFAULT_HEAD, open_head
from missions.plugins.setup.robot.dialogue import Dialogue
from missions.plugins.setup.robot.parts import RobotPart

STEP_ANGLE = radians(5)
"""Angle in radians by which a trial moves the head."""


def try_head(
    talk: Dialogue,
    parts: Mapping[str, RobotPart],
    config: RobotConfig,
    ports: Mapping[str, str],
    *,
    name: str = DEFAULT_HEAD,
    reachable: bool = False,
) -> None:
    """Move the head ``name`` by 5 degrees, if the user agrees, to find its directions and trims.

    It is moved only if its ports are in ``ports``, or if it is ``reachable`` without a serial port, as on I2C.
    """
    if not isinstance(config.sections[name].keys, TwoServoKeys | NeckKeys):
        return
    if not talk.has_answer(f"{name} tried"):
        talk.forget_answers("tried ")
        question = f"may the {name} move by 5 degrees, to find its left? hands off"
        if not (ports or reachable) or not talk.ask_consent(f"{name} moves", question):
            return
    answers = talk.measure_once(f"{name} tried", lambda: _try_axes(talk, config, ports, name))
    for axis in ("pan", "tilt"):
        _apply_corrections(parts, parts[name], axis, turned=answers[f"{axis} turned"], trim=answers[f"{axis} trim"])


def _try_axes(talk: Dialogue, config: RobotConfig, ports: Mapping[str, str], name: str) -> dict[str, Any]:
    """Move a head and ask the user; return for each axis whether it is reversed, and its trim."""
    answers: dict[str, Any] = {}
    with open_head(config, ports, head=name) as bench:
        bench.look(HeadPose(0.0, 0.0))
        for axis, way, pose in (
            ("pan", "to ITS left", HeadPose(STEP_ANGLE, 0.0)),
            ("tilt", "down", HeadPose(0.0, STEP_ANGLE)),
        ):
            bench.look(pose)
            answers[f"{axis} turned"] = not talk.ask_yes_no(f"tried {axis} way", f"did it turn {way}?", default=True)
            bench.look(HeadPose(0.0, 0.0))
        for axis in ("pan", "tilt"):
            side = "left" if axis == "pan" else "down"
            question = f"by how many degrees is it askew in {axis} now? positive is {side}"
            askew = talk.ask_text(f"tried {axis} askew", question, "0", lambda said: si_value(f"{said} deg", "angle"))
            answers[f"{axis} trim"] = -si_value(f"{askew} deg", "angle")
    return answers


def _apply_corrections(
    parts: Mapping[str, RobotPart], head: RobotPart, axis: str, *, turned: bool, trim: float
) -> None:
    """Write the direction and trim of a head's axis into the robot file's sections.

    If a joint of the arm moves the axis, a reversed direction is written to this joint, otherwise to the head.
    """
    section = dict(head.section[axis])
    if turned and "joint" in section:
        joints = parts["arm"].section["joints"]
        joint = dict(joints[section["joint"]])
        joint["reverse"] = not joint.get("reverse", False)
        parts["arm"].section["joints"] = {**joints, section["joint"]: joint}
    elif turned:
        section["flip"] = not section.get("flip", False)
    if trim:
        trim = -trim if section.get("flip", False) else trim  # a trim has the servo's own direction
        before = si_value(section["trim"], "angle") if "trim" in section else 0.0
        section["trim"] = f"{round(degrees(before + trim), 1) + 0.0:g} deg"
    head.section[axis] = section


def try_camera(talk: Dialogue, camera: Section) -> None:
    """Look through the camera, if the user agrees, and print problems of its pictures."""
    number, question = 0, f"test camera {without_secrets(str(camera.keys.source))}?"
    while not talk.yes and talk.ask_yes_no(f"picture {number}", question, default=number == 0):
        problems = talk.measure_once(f"picture {number} told", lambda: _camera_problems(camera))
        talk.print(*(problems or ["  its pictures are good"]))
        if not problems:
            return
        number, question = number + 1, "test again?"


def _camera_problems(camera: Section) -> list[str]:
    """Return problems of the pictures with hints; empty if they are good."""
    try:
        found = list(resolve_name(camera.driver.checkup)(camera.keys, DriverContext(SystemClock())))
    except DriverError as error:
        return [f"  {error}", f"    try: {error.hint}"]
    bad = [each for each in found if each.verdict != "ok"]
    return [line for each in bad for line in (f"  {each.message}", f"    try: {each.fix}")]
