"""Further parts of the robots of the storm: a second arm, and heads beside their own."""

from collections.abc import Mapping
from random import Random

OTHERS: Mapping[str, str] = {
    "lidar_mast": """
lidar_mast:
  kind: head
  driver: arduino_second
  speed: 90 deg/s
  pan: {servo: 2, limits: [-60 deg, 60 deg]}
  tilt: {servo: 3}
""",
    "mast": """
mast:
  kind: head
  driver: arduino
  port: /dev/mast
  speed: 100 deg/s
  pan: {servo: 0, limits: [-50 deg, 70 deg]}
  tilt: {servo: 1, start: 95, limits: [-40 deg, 30 deg]}
""",
    "right_arm": """
right_arm:
  kind: arm
  driver: feetech
  port: /dev/right_arm
  joints:
    elbow: {id: 1, limits: [-90 deg, 60 deg], speed: 120 deg/s}
    gripper: {id: 2, limits: [0 deg, 80 deg], speed: 150 deg/s}
    wrist_flex: {id: 3, limits: [-40 deg, 40 deg], speed: 90 deg/s}
  groups:
    hand: [gripper, wrist_flex]
""",
}
"""Further parts by their names: a second pan/tilt on the board of an Arduino or on its own, a second arm."""

SHARES = {"lidar_mast": 0.3, "mast": 0.15, "right_arm": 0.4}
"""In how many runs each is there, of those whose robot can have it."""


def others_of(robot: str, chance: Random) -> tuple[str, ...]:
    """Return what a robot has besides: in some runs a second arm, or heads beside its own."""
    drawn = (name for name, share in SHARES.items() if chance.random() < share)
    return tuple(name for name in drawn if name != "lidar_mast" or robot == "turtlebot2_arm")
