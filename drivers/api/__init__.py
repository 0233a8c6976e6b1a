"""Protocols and value types of robot parts, as behaviours see them; independent of any bus.

SI units and radians throughout, with the axes of REP 103: x forward, y left, z up, anticlockwise positive. So a
positive pan looks left, and a positive tilt (about y) looks *down*.

A device works without its hardware: ``open`` starts the search for it, ``health`` reports whether it is online, and it
reconnects by itself. Commands to an offline device raise ``drivers.errors.NotConnected``.

Every command may be called in a tick: it takes at most one exchange on the wire, a few milliseconds, while the hardware
replies. Joints are the exception: hold, relax, and a move that switches torque on wait until each servo has confirmed
it, one servo after another. This takes two or three exchanges for a servo that replies, and up to six timeouts (6 ms
each, 22 ms with an adapter that delays replies) for a servo that has just become silent. ``rest`` and ``close`` may
take longer.
"""

from drivers.api.base import (
    BASE_RADIUS,
    FALLEN_REASON,
    LEG_ACTS,
    Base,
    BaseLimits,
    BaseState,
    DockBeam,
    DockSignals,
    Lamp,
    Legs,
    Lights,
    Odometers,
    Pose2D,
    Posture,
    Sides,
    Sounds,
    Tune,
)
from drivers.api.device import (
    Device,
    DeviceStatus,
    Health,
    Latchable,
    Limitable,
    Quality,
    Reading,
    ReconnectPolicy,
    StatusCallback,
    ignore,
)
from drivers.api.head import HEAD_ACCELERATION, Head, HeadLimits, HeadPose
from drivers.api.joints import Coupling, Gesture, Interpolation, JointLimits, Joints, JointState, Keyframe
from drivers.api.measures import Angle, Angles, Duration, Image, Length, Ranges, Samples
from drivers.api.ros2 import GoalState, Progress, Ros2
from drivers.api.screen import Mood, Screen, ScreenContent
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
    WitnessedBase,
    wrap_angles,
)
from drivers.api.steering import (
    COMMAND_TIMEOUT,
    ZERO_VELOCITY,
    Reflexes,
    Source,
    Steering,
    SteeringCallback,
    Velocity,
    is_guarded,
)
from drivers.api.voice import DEFAULT_STYLE, Mouth, MouthShape, Priority, SpeechStyle, Utterance, Voice

__all__ = [
    "BASE_RADIUS",
    "COMMAND_TIMEOUT",
    "DEFAULT_STYLE",
    "FALLEN_REASON",
    "HEAD_ACCELERATION",
    "LEG_ACTS",
    "SOUND_RATE",
    "ZERO_VELOCITY",
    "Angle",
    "Angles",
    "Attitude",
    "Base",
    "BaseLimits",
    "BaseState",
    "Camera",
    "CameraFrame",
    "Coupling",
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
    "Latchable",
    "Legs",
    "Length",
    "Lights",
    "Limitable",
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
    "ReconnectPolicy",
    "Reflexes",
    "Ros2",
    "Samples",
    "Screen",
    "ScreenContent",
    "Sides",
    "Sound",
    "Sounds",
    "Source",
    "SpeechStyle",
    "StatusCallback",
    "Steering",
    "SteeringCallback",
    "Tune",
    "Utterance",
    "Velocity",
    "Voice",
    "WitnessedBase",
    "ignore",
    "is_guarded",
    "wrap_angles",
]
