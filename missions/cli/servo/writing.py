"""Robot files that MissionTree itself writes, of joints that were imported: read back before they are handed out."""

import json
from collections.abc import Mapping
from dataclasses import asdict

from config.faults import Source
from config.writing import flow, number, word
from drivers.dynamixel.declared import JointKeys
from missions.library.drivers import robot_of


def robot_text(
    name: str,
    joints: Mapping[str, JointKeys],
    *,
    port: str,
    baud: int = 1_000_000,
    arm: str = "arm",
    calibration: str = "",
) -> str:
    """Return the text of a robot file with an ``arm`` of ``joints`` alone; with a ``calibration`` they are Feetech's.

    Raises InvalidFileError if it is none.
    """
    lines = [
        f"robot: {word(name)}",
        "",
        f"{arm}:",
        *([] if arm == "arm" else ["  kind: arm"]),
        f"  driver: {'feetech' if calibration else 'dynamixel'}",
        f"  port: {json.dumps(port)}",
        f"  baud: {baud}",
        *([f"  calibration: {json.dumps(calibration)}"] if calibration else []),
    ]
    lines += ["  joints:", *(f"    {word(joint)}: {_joint(config)}" for joint, config in joints.items())]
    text = "\n".join(lines) + "\n"
    robot_of(Source(name, text))
    return text


def _joint(joint: JointKeys) -> str:
    """Write a joint, in steps of its servo if that is how it came."""
    if joint.ticks is None and joint.limits is None:
        return flow({"id": str(joint.id), "model": joint.model})
    if joint.ticks is None:
        limits = f"[{number(joint.lower, 6)} rad, {number(joint.upper, 6)} rad]"
        way = {"zero": f"{number(joint.zero, 6)} rad", "limits": limits, "reverse": str(joint.reverse).lower()}
    else:
        way = {"ticks": flow({key: str(value) for key, value in asdict(joint.ticks).items()})}
    power = {"speed": f"{number(joint.speed, 6)} rad/s", "torque": f"{number(100 * joint.torque, 4)} %"}
    return flow({"id": str(joint.id), "model": joint.model}, way, power)
