"""Servos of a new robot that LeRobot, or another program, has calibrated: its file, or their limits, are taken over."""

from collections.abc import Mapping
from typing import Any

from config.units import written
from drivers.dynamixel.bus import At
from drivers.dynamixel.models import MODELS
from drivers.errors import DriverError
from drivers.feetech.declared import FeetechKeys
from drivers.feetech.lerobot import Calibrated, calibration_of, is_wheel
from missions.cli.robot.dialogue import Dialogue
from missions.cli.robot.parts import Part
from missions.cli.robot.servos import opened

REGISTERS = ("position_offset", "min_position", "max_position")
"""The registers that calibrating changes, in the order of ``Calibrated``."""

FROM_FILE = ("limits", "zero", "reverse", "ticks")
"""Keys of a joint that a calibration file stands for."""


def take_calibration(talk: Dialogue, arm: str, part: Part, path: str, *, patience: float) -> None:
    """Offer the calibration file that the servos of an ``arm`` (its name) come from. Only reads."""
    held = _held(talk, arm, part, path, patience)
    found = calibration_of(held) if held else None
    if found is None:
        return
    file, names = found
    question = f"LeRobot has calibrated the {arm} ({file}): shall its calibration be used?"
    if not talk.confirm(f"{arm} calibration", question, default=True):
        return
    known = {joint["id"]: joint for joint in part.section.get("joints", {}).values()}
    part.section["joints"] = {
        name: {"id": number} | {key: it for key, it in known.get(number, {}).items() if key not in FROM_FILE}
        for number, name in names.items()
        if not is_wheel(name)
    }
    part.section = {"calibration": file, **part.section}
    groups = part.section.get("groups", {})
    if not all(joint in names.values() for group in groups.values() for joint in group):
        del part.section["groups"]


def take_limits(talk: Dialogue, arm: str, part: Part, path: str, *, patience: float) -> None:
    """Take over the limits of servos that were calibrated, and whose file is not on this computer. Only reads."""
    held = _held(talk, arm, part, path, patience)
    if not held or "calibration" in part.section:
        return
    talk.tell(
        f"servos of the {arm} were calibrated by another program: their limits are taken over as they are",
        "  its file is better, if you have it: `calibration: FILE` in the robot file",
    )
    models = {number: model for number, model, _ in part.units}
    for joint in part.section["joints"].values():
        if joint["id"] in held and "ticks" not in joint:
            model, limits = MODELS[models[joint["id"]]], held[joint["id"]]
            way = -1 if joint.get("reverse") else 1
            ends = sorted(model.angle(end) * way for end in (limits.low, limits.high))
            joint.pop("zero", None)
            joint["limits"] = [written(end, "angle") for end in ends]


def _held(talk: Dialogue, arm: str, part: Part, path: str, patience: float) -> Mapping[int, Calibrated]:
    """Return what calibrating has set in the servos, by ID; nothing for servos as delivered, or of another make."""
    if part.driver.keys is not FeetechKeys or not part.units:
        return {}
    found: dict[str, Any] = talk.measured(f"{arm} calibrated", lambda: _read(talk, part, path, patience))
    held = {int(number): Calibrated(*values) for number, values in found.items()}
    plain = Calibrated(0, 0, MODELS["STS3215"].last)
    return held if any(values != plain for values in held.values()) else {}


def _read(talk: Dialogue, part: Part, path: str, patience: float) -> dict[str, list[int]]:
    """Read the registers of all servos whose model is driven; of none where one does not answer."""
    found = {}
    try:
        with opened(path, int(part.section.get("baud", 1_000_000)), patience) as bus:
            for number, name, _ in part.units:
                if name in MODELS:
                    table = MODELS[name].table
                    found[str(number)] = [bus.read(At(number, "STS"), table[register]) for register in REGISTERS]
    except DriverError as error:
        talk.tell(f"whether the servos were calibrated is not known: {error}")
        return {}
    return found
