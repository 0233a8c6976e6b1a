"""Joints from files of other programs: ArbotiX, Interbotix, dynamixel_workbench, LeRobot.

The caller supplies missing data, above all the model of the servos.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from math import degrees, isclose, radians
from pathlib import Path
from typing import Any

from config.diagnostics import Diagnostic, InvalidFileError, Mark, SourceText
from config.foreign_files import read_plain_data
from config.units import quoted_value
from drivers.errors import BadRequest
from drivers.servos.calibration import load_calibration
from drivers.servos.declared import JointKeys, Ticks
from drivers.servos.feetech import FeetechJointKeys
from drivers.servos.lerobot import home_relative, is_wheel
from drivers.servos.models import MODELS, ServoModel

PAIRED_MESSAGE = (
    "joint '{0}' has two servos ({1} and {2}), which have to turn together: such a joint is not driven here, and one "
    "of them alone would work against the other"
)
"""Error message for a joint that is moved by two servos; with the joint's name and the two IDs."""

MAX_SHADOW_ID = 252
"""Largest valid secondary ID of a Dynamixel; a larger value in its register means that it has none."""


@dataclass
class ForeignJoints:
    """Joints by name from a file of another program, with notes on anything that was left out.

    ``calibration`` is the path of the file if it is a LeRobot calibration of Feetech servos; otherwise empty.
    """

    joints: dict[str, JointKeys] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    calibration: str = ""


def foreign_joints(path: Path, form: str, model: str) -> ForeignJoints:
    """Return the joints of a file of another program; all its servos are of ``model``.

    ``form`` is the format of the file, a ``ForeignFile.form`` of config.foreign_files. Raises InvalidFileError with the
    reason if the file cannot be imported.
    """
    found = ForeignJoints()
    try:
        _READERS[form](found, path, read_plain_data(path), MODELS[model])
    except _ImportFailure as error:
        raise InvalidFileError([Diagnostic(SourceText(str(path), ""), Mark(), str(error))]) from error
    except BadRequest as error:
        raise InvalidFileError([Diagnostic(SourceText(str(path), ""), Mark(), str(error), error.hint)]) from error
    if not found.joints:
        raise InvalidFileError([Diagnostic(SourceText(str(path), ""), Mark(), "no joints found")])
    return found


class _ImportFailure(Exception):
    """Raised while a file is read that cannot be imported; the message is the reason."""


def _read_number(joint: str, part: Mapping[str, Any], word: str, default: float | None = None) -> float:
    value = part.get(word, default)
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise _ImportFailure(f"joint '{joint}': '{word}' must be a number, not {value!r}")
    return value


def _read_id(joint: str, part: Mapping[str, Any], word: str) -> int:
    value = _read_number(joint, part, word)
    if value != int(value) or not 0 <= value <= 253:
        raise _ImportFailure(f"joint '{joint}': '{word}' must be an ID from 0 to 253, not {value}")
    return int(value)


def _arbotix(found: ForeignJoints, path: Path, data: Mapping[str, Any], model: ServoModel) -> None:  # noqa: ARG001
    """Read the joints of the ArbotiX driver: angles in degrees, from ``neutral``, the servo's step at angle 0."""
    for name, part in data["joints"].items():
        if part.get("type", "dynamixel") not in ("dynamixel", "calibrated_dynamixel"):
            found.notes.append(f"joint '{name}' is left out: it is a {part['type']}")
            continue
        ticks = _read_number(name, part, "ticks", 1024)
        if ticks != model.last_tick + 1:
            raise _ImportFailure(
                f"joint '{name}' has {ticks:g} steps, an {model.name} {model.last_tick + 1}: name another --model"
            )
        whole = degrees((model.last_tick + 1) * model.tick)
        if not isclose(turn := _read_number(name, part, "range", whole), whole, rel_tol=0.01):
            raise _ImportFailure(
                f"joint '{name}' has a range of {turn:g} deg, an {model.name} {whole:g} deg: name another --model"
            )
        turned = part.get("invert", False) is True
        zero = model.angle(_read_number(name, part, "neutral", ticks // 2))
        half = (model.last_tick + 1) / 2 * model.tick
        lower, upper = (
            radians(_read_number(name, part, word)) if word in part else end
            for word, end in (("min_angle", -half), ("max_angle", half))
        )
        joint = JointKeys(
            id=_read_id(name, part, "id"), written_model=model.name, written_zero=zero, written_reverse=turned
        )
        least, most = joint.reachable_angles
        fastest = max(radians(_read_number(name, part, "max_speed")), 0.02) if "max_speed" in part else joint.speed
        found.joints[name] = replace(joint, limits=(max(lower, least), min(upper, most)), speed=fastest)
    found.notes.append("an ArbotiX board is not an adapter: connect the servos to a U2D2, a USB2AX or the like")


def _interbotix(found: ForeignJoints, path: Path, data: Mapping[str, Any], model: ServoModel) -> None:
    """Read the motors of an Interbotix arm, whose limits are in servo steps.

    A joint with two motors raises an error.
    """
    motors: Mapping[str, Mapping[str, Any]] = data["motors"]
    for word in ("shadows", "sisters"):
        pairs = data.get(word) or {}
        if not isinstance(pairs, Mapping):
            raise _ImportFailure(f"'{word}' must be a mapping by motor, not {quoted_value(pairs)}")
        for name, part in pairs.items():
            others = part.get("shadow_list", part) if isinstance(part, Mapping) else part
            other = next((each for each in _texts_in(others) if each in motors), None)
            if other is not None and name in motors:
                raise _ImportFailure(PAIRED_MESSAGE.format(name, motors[name]["ID"], motors[other]["ID"]))
    _workbench(found, path, motors, model)


def _texts_in(value: Any) -> Iterator[str]:
    """Yield the texts in a nested value of a YAML file."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, list | Mapping):
        for each in value.values() if isinstance(value, Mapping) else value:
            yield from _texts_in(each)


def _workbench(found: ForeignJoints, path: Path, data: Mapping[str, Any], model: ServoModel) -> None:  # noqa: ARG001
    """Read servos that are described by the names and values of their registers, as in dynamixel_workbench."""
    owners = {_read_id(name, part, "ID"): name for name, part in data.items()}
    for name, part in data.items():
        leader = part.get("Secondary_ID", part.get("Shadow_ID", MAX_SHADOW_ID + 1))
        if isinstance(leader, int) and leader <= MAX_SHADOW_ID and leader != part["ID"]:
            raise _ImportFailure(PAIRED_MESSAGE.format(owners.get(leader, "?"), leader, part["ID"]))
        for word in ("Homing_Offset", "Multi_Turn_Offset"):
            if offset := _read_number(name, part, word, 0):
                raise _ImportFailure(
                    f"joint '{name}' has {word} {offset:g}, and joints are driven here that count from the servo's own "
                    f"zero: in a copy of the file take {word} and the limits of '{name}' out"
                )
        if part.get("Operating_Mode", 3) not in (3, 4, 5):
            found.notes.append(f"'{name}' is left out: operating mode {part['Operating_Mode']} is not one of positions")
            continue
        found.joints[name] = JointKeys(
            id=_read_id(name, part, "ID"), written_model=model.name, ticks=_ticks(name, part, model)
        )
        if found.joints[name].ticks is None:
            found.notes.append(
                f"joint '{name}': its limits are not in the file: find them with mission servo calibrate {name}"
            )
        if int(_read_number(name, part, "Drive_Mode", 0)) & 1:
            found.notes.append(
                f"joint '{name}': the servo is reversed (Drive_Mode 1), here its joint is: its drive_mode has to be 0"
            )


_LIMIT_KEYS = (("Min_Position_Limit", "Max_Position_Limit"), ("CW_Angle_Limit", "CCW_Angle_Limit"))


def _ticks(name: str, part: Mapping[str, Any], model: ServoModel) -> Ticks | None:
    """Return the limits of a servo in steps; None if the file has no limits.

    The steps are those of a servo that is not reversed by its register Drive_Mode.
    """
    for words in _LIMIT_KEYS:
        if all(word in part for word in words):
            low, high = (int(_read_number(name, part, word)) for word in words)
            if int(_read_number(name, part, "Drive_Mode", 0)) & 1:
                low, high = (2 * model.centre_tick - step for step in (low, high))
            ends = [min(max(step, 0), model.last_tick) for step in (low, high)]
            if ends[0] == ends[1]:
                raise _ImportFailure(f"joint '{name}': its limits are both {ends[0]}: it could not move")
            return Ticks(init=model.centre_tick, min=ends[0], max=ends[1])
    return None


def _lerobot(found: ForeignJoints, path: Path, data: Mapping[str, Any], model: ServoModel) -> None:
    """Read the motors of a LeRobot calibration; the robot file will refer to this file, which is not copied."""
    if model.protocol != "STS":
        raise _ImportFailure(
            "an arm of Dynamixels that LeRobot calibrated is not driven here: its servos count from elsewhere"
        )
    load_calibration(str(path))
    for name, part in data.items():
        if is_wheel(name):
            found.notes.append(f"motor '{name}' is left out: it drives a wheel")
        else:
            found.joints[name] = FeetechJointKeys(id=part["id"], written_model=model.name)
    found.calibration = home_relative(path.resolve())


_READERS: Mapping[str, Callable[[ForeignJoints, Path, Any, ServoModel], None]] = {
    "arbotix": _arbotix,
    "interbotix": _interbotix,
    "workbench": _workbench,
    "lerobot": _lerobot,
}
"""Functions that read the joints of a file, by the file's form; the form ``ros`` is read by ``ros_joints_of`` instead.
"""
