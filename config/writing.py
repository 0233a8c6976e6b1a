"""Files that MissionTree itself writes: gestures that were recorded, robots whose joints were imported.

Each is read back before it is handed out, so that nothing is written that its own loader refuses.
"""

import json
import re
from collections.abc import Mapping
from pathlib import Path

from config.arm import JointConfig
from config.faults import Source
from config.gesture import GestureConfig, gesture_of
from config.marked import plain
from config.robot import robot_of


def gesture_text(gesture: GestureConfig, file: str = "gesture") -> str:
    """Return the text of a file that says what ``gesture`` is; a keyframe names the joints that have moved since.

    Angles are written to a millionth of a radian, times to a tenth of a millisecond. Raises InvalidFileError, with
    ``file`` as its name, where that is no gesture file: no keyframe, times that do not rise, more than fits.
    """
    lines = [f"gesture: {_word(gesture.name)}"]
    if gesture.summary.strip():
        lines.append(f"summary: {json.dumps(gesture.summary, ensure_ascii=False)}")
    lines += [f"interpolation: {gesture.interpolation}", "keyframes:"]
    before: dict[str, str] = {}
    for time, positions in gesture.keyframes:
        angles = {joint: f"{_number(angle, 6)} rad" for joint, angle in positions.items()}
        moved = {_word(joint): angle for joint, angle in angles.items() if before.get(joint) != angle}
        lines.append(f"  - {_flow({'at': f'{_number(time, 4)} s'}, moved)}")
        before |= angles
    text = "\n".join(lines) + "\n"
    gesture_of(Source(file, text))
    return text


def robot_text(name: str, joints: Mapping[str, JointConfig], *, port: str, baud: int = 1_000_000) -> str:
    """Return the text of a robot file with nothing but an arm of ``joints``. Raises InvalidFileError if it is none."""
    lines = [
        f"robot: {_word(name)}",
        "",
        "arm:",
        "  driver: dynamixel",
        f"  port: {json.dumps(port)}",
        f"  baud: {baud}",
    ]
    lines += ["  joints:", *(f"    {_word(joint)}: {_joint(config)}" for joint, config in joints.items())]
    text = "\n".join(lines) + "\n"
    robot_of(Source(name, text))
    return text


def write_new(path: Path, text: str) -> None:
    """Write a new file. Raises FileExistsError, in words, where there is one already, and other OSErrors."""
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError as error:
        raise FileExistsError(f"{path} is there already, and is not written over: give another name") from error


def _joint(joint: JointConfig) -> str:
    """Write a joint, in steps of its servo if that is how it came."""
    if joint.ticks is None:
        limits = f"[{_number(joint.lower, 6)} rad, {_number(joint.upper, 6)} rad]"
        way = {"zero": f"{_number(joint.zero, 6)} rad", "limits": limits, "reverse": str(joint.reverse).lower()}
    else:
        way = {"ticks": _flow({key: str(value) for key, value in joint.ticks._asdict().items()})}
    power = {"speed": f"{_number(joint.speed, 6)} rad/s", "torque": f"{_number(100 * joint.torque, 4)} %"}
    return _flow({"id": str(joint.id), "model": joint.model}, way, power)


def _flow(*parts: Mapping[str, str]) -> str:
    """Write mappings as one, on one line."""
    return "{" + ", ".join(f"{key}: {value}" for part in parts for key, value in part.items()) + "}"


def _number(value: float, digits: int) -> str:
    return f"{round(value, digits) + 0.0:.12g}"


def _word(text: str) -> str:
    """Write a name plainly where YAML takes it for a text, else in quotes."""
    return text if re.fullmatch(r"[A-Za-z_]\w*", text) and plain(text) == text else json.dumps(text, ensure_ascii=False)
