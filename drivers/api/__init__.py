"""What a behaviour sees of a robot: small protocols and value types, nothing of any bus.

SI units and radians throughout, with the axes of REP 103: x forward, y left, z up, anticlockwise positive.
So a positive pan looks left, and a positive tilt (about y) looks *down*.

Every device starts without its hardware: ``open`` starts looking for it, ``health`` says whether it is there, and
it reconnects by itself. Commands to a device that is offline raise ``drivers.errors.NotConnected``.
So all commands may be made in a tick: they take one exchange on the wire at most, a few milliseconds, while the
hardware answers. The exception are joints, which confirm hold, relax, and a move that first makes them stiff, one by
one: each that answers costs two or three exchanges, each that has just fallen silent up to six time-outs (6 ms each,
22 with an adapter that holds replies back). ``rest`` and ``close`` take what they need.
"""

from drivers.api.base import (
    BASE_RADIUS,
    FALLEN,
    PERFORMED,
    Base,
    BaseLimits,
    BaseState,
    DockBeam,
    DockSignals,
    Lamp,
    Odometers,
    Pose2D,
    Posture,
    Sides,
    Tune,
)
from drivers.api.device import (
    Away,
    Curbed,
    Device,
    DeviceStatus,
    Health,
    Latching,
    Quality,
    Reading,
    Report,
    ignore,
)
from drivers.api.head import HEAD_ACCELERATION, Head, HeadLimits, HeadPose
from drivers.api.joints import Coupling, Gesture, Interpolation, JointLimits, Joints, JointState, Keyframe
from drivers.api.measures import Angle, Angles, Duration, Image, Length, Ranges, Samples
from drivers.api.ros2 import GoalState, Progress, Ros2
from drivers.api.screen import Mood, Screen, Shown
from drivers.api.sensors import (
    SOUND_RATE,
    Attitude,
    Camera,
    CameraFrame,
    Guardable,
    Imu,
    Microphone,
    Ranger,
    RangeScan,
    Sound,
    Witnessed,
    wrapped,
)
from drivers.api.steering import COMMAND_LIFE, STILL, Reflexes, Source, Steered, Steering, Velocity, is_guarded
from drivers.api.voice import AS_USUAL, Manner, Mouth, MouthShape, Priority, Utterance, Voice

__all__ = [
    "AS_USUAL",
    "BASE_RADIUS",
    "COMMAND_LIFE",
    "FALLEN",
    "HEAD_ACCELERATION",
    "PERFORMED",
    "SOUND_RATE",
    "STILL",
    "Angle",
    "Angles",
    "Attitude",
    "Away",
    "Base",
    "BaseLimits",
    "BaseState",
    "Camera",
    "CameraFrame",
    "Coupling",
    "Curbed",
    "Device",
    "DeviceStatus",
    "DockBeam",
    "DockSignals",
    "Duration",
    "Gesture",
    "GoalState",
    "Guardable",
    "Head",
    "HeadLimits",
    "HeadPose",
    "Health",
    "Image",
    "Imu",
    "Interpolation",
    "JointLimits",
    "JointState",
    "Joints",
    "Keyframe",
    "Lamp",
    "Latching",
    "Length",
    "Manner",
    "Microphone",
    "Mood",
    "Mouth",
    "MouthShape",
    "Odometers",
    "Pose2D",
    "Posture",
    "Priority",
    "Progress",
    "Quality",
    "RangeScan",
    "Ranger",
    "Ranges",
    "Reading",
    "Reflexes",
    "Report",
    "Ros2",
    "Samples",
    "Screen",
    "Shown",
    "Sides",
    "Sound",
    "Source",
    "Steered",
    "Steering",
    "Tune",
    "Utterance",
    "Velocity",
    "Voice",
    "Witnessed",
    "ignore",
    "is_guarded",
    "wrapped",
]
