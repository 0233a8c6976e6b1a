"""Words that people bring along from other programs, and ours for them: asked before any likeness of spelling."""

import re
from collections.abc import Collection, Iterable, Mapping

from config.faults import one_of

KEYS: Mapping[str, str] = {
    "robot": "name",
    "world": "name",
    "summary": "description descr desc about",
    "rate": "frequency freq hz tick_rate fps",
    "base": "wheels chassis drive mobile_base",
    "head": "neck pan_tilt pantilt",
    "arm": "arms servos dynamixel manipulator",
    "range": "lidar laser rplidar scanner sonar rangefinder range_finder",
    "camera": "cam webcam cameras",
    "microphone": "mic ears",
    "voice": "speech tts speaker",
    "screen": "display monitor",
    "ros2": "ros ros_2 zenoh rmw nodes",
    "notices": "notifications notify alerts",
    "driver": "type kind class plugin backend",
    "port": "device dev path file serial serial_port com tty usb address",
    "baud": "baudrate baud_rate bitrate bit_rate bps speed",
    "max_speed": "max_velocity max_vel max_linear_velocity max_linear_speed top_speed speed_limit speed velocity",
    "max_turn": "max_angular_velocity max_angular_speed max_rotation max_turn_rate max_turn_speed turn_speed turn_rate "
    "rotation_speed angular_speed angular_velocity",
    "acceleration": "accel acc max_acceleration max_accel",
    "turn_acceleration": "angular_acceleration max_angular_acceleration turn_accel",
    "speed": "velocity vel max_speed max_velocity",
    "limits: [low, high]": "min max lower upper low high min_angle max_angle lower_limit upper_limit range limit",
    "torque": "effort max_torque force max_effort",
    "reverse": "invert inverted reversed flip mirrored",
    "flip": "invert inverted reversed reverse mirrored mirror hflip vflip",
    "rotate": "rotation orientation rotated",
    "trim": "offset",
    "zero": "offset home center centre",
    "id": "servo_id dxl_id motor_id",
    "servo": "pin index channel output",
    "field_of_view": "fov hfov view_angle",
    "width": "resolution size w",
    "height": "resolution size h",
    "source": "device index path url video file port camera",
    "position": "pose location xyz place translation",
    "people": "persons humans faces",
    "room": "map arena",
    "params": "parameters args arguments inputs vars variables",
    "expect": "expected expects assert asserts then",
    "given": "mocks mock setup when",
    "case": "name title test",
    "tests": "mission",
    "cases": "scenarios",
    "behaviours": "behaviors leaves plugins",
}
"""Our keys of files, each with what others call it. A word that a section knows itself is never taken for another."""


def plain_word(word: str) -> str:
    """Return a word in small letters, its parts joined by ``_``: "MaxSpeed" and "max-speed" are "max_speed"."""
    parted = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", word.strip())
    return re.sub(r"[\s-]+", "_", parted).lower()


def ours_for(word: str, table: Mapping[str, str], known: Iterable[str]) -> list[str]:
    """Return what ``word`` is called here: those of ``known`` for which the table has it, in the table's order."""
    known, word = set(known), plain_word(word)
    return [ours for ours, theirs in table.items() if head_of(ours) in known and word in theirs.split()]


def key_meant(word: str, known: Collection[str], table: Mapping[str, str] = KEYS) -> str:
    """Say which key may be meant by ``word``: what it is called here, else the closest, else all there are."""
    if plain_word(word) in known:
        return f"did you mean '{plain_word(word)}'?"
    ours = ours_for(word, table, known)
    return f"write {in_words(ours)}" if ours else one_of(word, known)


def in_words(words: Iterable[str]) -> str:
    """Return "'this' or 'that'"."""
    return " or ".join(f"'{word}'" for word in words)


def head_of(ours: str) -> str:
    """Return the word itself of ours with a value, such as ``invert: true``."""
    return ours.partition(":")[0]
