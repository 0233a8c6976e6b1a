"""ROS 2 types: conversion of messages to and from CDR, by the package rosbags, and type hashes.

Loading the types takes a tenth of a second, and the first message of a type takes some milliseconds. Drivers do both
when they open.
"""

import re
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any, Literal

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from drivers.errors import BadRequest, DriverError

# Types missing in rosbags, as defined by their packages: Nav2, Create 3, vision, and our own.

UUID, TIME, HEADER = "unique_identifier_msgs/UUID", "builtin_interfaces/Time", "std_msgs/Header"

MESSAGES: Mapping[str, str] = {
    "irobot_create_msgs/msg/HazardDetection": "std_msgs/Header header\nuint8 type",
    "irobot_create_msgs/msg/HazardDetectionVector": (
        "std_msgs/Header header\nirobot_create_msgs/HazardDetection[] detections"
    ),
    "irobot_create_msgs/msg/DockStatus": "std_msgs/Header header\nbool dock_visible\nbool is_docked",
    "irobot_create_msgs/msg/LedColor": "uint8 red\nuint8 green\nuint8 blue",
    "irobot_create_msgs/msg/LightringLeds": (
        "std_msgs/Header header\nirobot_create_msgs/LedColor[6] leds\nbool override_system"
    ),
    "irobot_create_msgs/msg/AudioNote": "uint16 frequency\nbuiltin_interfaces/Duration max_runtime",
    "irobot_create_msgs/msg/AudioNoteVector": (
        "std_msgs/Header header\nirobot_create_msgs/AudioNote[] notes\nbool append"
    ),
    "turtlebot3_msgs/msg/SensorState": (
        "std_msgs/Header header\nuint8 bumper\nfloat32 cliff\nfloat32 sonar\nfloat32 illumination\nuint8 led\n"
        "uint8 button\nbool torque\nint32 left_encoder\nint32 right_encoder\nfloat32 battery"
    ),
    "vision_msgs/msg/Point2D": "float64 x\nfloat64 y",
    "vision_msgs/msg/Pose2D": "vision_msgs/Point2D position\nfloat64 theta",
    "vision_msgs/msg/BoundingBox2D": "vision_msgs/Pose2D center\nfloat64 size_x\nfloat64 size_y",
    "vision_msgs/msg/ObjectHypothesis": "string class_id\nfloat64 score",
    "vision_msgs/msg/ObjectHypothesisWithPose": (
        "vision_msgs/ObjectHypothesis hypothesis\ngeometry_msgs/PoseWithCovariance pose"
    ),
    "vision_msgs/msg/Detection2D": (
        "std_msgs/Header header\nvision_msgs/ObjectHypothesisWithPose[] results\n"
        "vision_msgs/BoundingBox2D bbox\nstring id"
    ),
    "vision_msgs/msg/Detection2DArray": "std_msgs/Header header\nvision_msgs/Detection2D[] detections",
}
"""Definitions of the message types that rosbags lacks, by name; one field per line."""

SERVICES: Mapping[str, tuple[str, str]] = {
    "std_srvs/srv/Empty": ("", ""),
    "std_srvs/srv/Trigger": ("", "bool success\nstring message"),
    "std_srvs/srv/SetBool": ("bool data", "bool success\nstring message"),
    "example_interfaces/srv/AddTwoInts": ("int64 a\nint64 b", "int64 sum"),
    "action_msgs/srv/CancelGoal": (
        "action_msgs/GoalInfo goal_info",
        "int8 return_code\naction_msgs/GoalInfo[] goals_canceling",
    ),
    "irobot_create_msgs/srv/ResetPose": ("geometry_msgs/Pose pose", "bool success"),
    "nav2_msgs/srv/ClearEntireCostmap": ("std_msgs/Empty request", "std_msgs/Empty response"),
}
"""Definitions of services by type name: request and response."""

_NAVIGATION_RESULT = "uint16 error_code\nstring error_msg"
"""Definition of the result of Nav2's actions since ROS 2 Kilted.

In Jazzy it has only ``error_code``, in Humble it is a ``std_msgs/Empty``. See
``drivers.ros2.action_server.decode_result``.
"""

_NAVIGATION_FEEDBACK = (
    "geometry_msgs/PoseStamped current_pose\nbuiltin_interfaces/Duration navigation_time\n"
    "builtin_interfaces/Duration estimated_time_remaining\nint16 number_of_recoveries\nfloat32 distance_remaining"
)

ACTIONS: Mapping[str, tuple[str, str, str]] = {
    "nav2_msgs/action/NavigateToPose": (
        "geometry_msgs/PoseStamped pose\nstring behavior_tree",
        _NAVIGATION_RESULT,
        _NAVIGATION_FEEDBACK,
    ),
    "nav2_msgs/action/NavigateThroughPoses": (
        "geometry_msgs/PoseStamped[] poses\nstring behavior_tree",
        _NAVIGATION_RESULT,
        f"{_NAVIGATION_FEEDBACK}\nint16 number_of_poses_remaining",
    ),
    "nav2_msgs/action/Spin": (
        "float32 target_yaw\nbuiltin_interfaces/Duration time_allowance",
        "builtin_interfaces/Duration total_elapsed_time\nuint16 error_code",
        "float32 angular_distance_traveled",
    ),
    "irobot_create_msgs/action/Dock": ("", "bool is_docked", "bool sees_dock"),
    "irobot_create_msgs/action/Undock": ("", "bool is_docked", ""),
    "missiontree_msgs/action/RunMission": (
        "string mission\nstring parameters",
        "string status\nstring reason",
        "string running",
    ),
}
"""Definitions of actions by type name: goal, result, feedback."""


_EMPTY_FIELD = ("structure_needs_at_least_one_member", (Nodetype.BASE, ("uint8", 0)))
"""Field that a type without any field has on the wire."""

_MAX_DEPTH = 12
"""Maximum nesting of values in the result of ``TypeRegistry.to_plain``."""

_MAX_LENGTH = 1000
"""Maximum length of arrays in the result of ``TypeRegistry.to_plain``."""


class MalformedMessage(DriverError):
    """Error for received bytes that are not a message of the expected type."""


@cache
def types() -> "TypeRegistry":
    """Return the registry of types: those of ROS 2 Jazzy, and the types defined in this module. Created once."""
    return TypeRegistry()


class TypeRegistry:
    """Registry of ROS 2 types by name, such as "geometry_msgs/msg/Twist", with their conversion to and from CDR."""

    def __init__(self) -> None:
        self._store: Any = get_typestore(Stores.ROS2_JAZZY)
        # ROS takes `char` for a uint8, in hashes too.
        for name in ("service_msgs/msg/ServiceEventInfo",):
            constants, fields = self._store.fielddefs[name]
            self._store.fielddefs[name] = (constants, [_char_to_uint8(each) for each in fields])

    def is_known(self, name: str) -> bool:
        """True if ``name`` is a known type of a message, a service or an action."""
        try:
            self._require_type(name)
        except BadRequest:
            return False
        return True

    def define(self, name: str, text: str) -> None:
        """Add a message type; ``text`` is its definition. Raises BadRequest for an invalid definition."""
        try:
            ((constants, fields),) = get_types_from_msg(text, name).values()
            for used in _field_types(fields):
                self._require_type(used)
            found: list[Any] = [*fields] or [_EMPTY_FIELD]
            self._store.register({name: (constants, found)})
        except BadRequest:
            raise
        except Exception as error:  # the parser raises various errors
            raise BadRequest(f"{name}: invalid definition: {error}") from error

    def define_service(self, name: str, request: str, response: str) -> None:
        """Add the types of the service ``name`` from the definitions of its request and response."""
        # A service's hash covers its request, response and event.
        self.define(f"{name}_Request", request)
        self.define(f"{name}_Response", response)
        kinds = [(Nodetype.NAME, f"{name}_{part}") for part in ("Request", "Response", "Event")]
        several = [(Nodetype.SEQUENCE, (kind, 1)) for kind in kinds[:2]]
        told = ((Nodetype.NAME, "service_msgs/msg/ServiceEventInfo"), *several)
        words = ("request_message", "response_message", "event_message")
        self._store.register({f"{name}_Event": ([], list(zip(("info", "request", "response"), told, strict=True)))})
        self._store.register({name: ([], list(zip(words, kinds, strict=True)))})

    def define_action(self, name: str, goal: str, result: str, feedback: str) -> None:
        """Add the types of the action ``name`` from the definitions of goal, result and feedback.

        The types of the services and topics of the action are added as well.
        """
        for part, text in (("Goal", goal), ("Result", result), ("Feedback", feedback)):
            self.define(f"{name}_{part}", text)
        which = f"{UUID} goal_id"
        started = f"{which}\n{name}_Goal goal", f"bool accepted\n{TIME} stamp"
        self.define_service(f"{name}_SendGoal", *started)
        self.define_service(f"{name}_GetResult", which, f"int8 status\n{name}_Result result")
        self.define(f"{name}_FeedbackMessage", f"{which}\n{name}_Feedback feedback")

    def digest(self, name: str) -> str:
        """Return the type hash (RIHS01) of a type, as in Zenoh keys. Raises BadRequest for an unknown type."""
        digest: str = self._store.hash_rihs01(self._require_type(name))
        return digest

    def preload(self, *names: str) -> None:
        """Prepare the conversion of messages of these types."""
        for name in names:
            self._store.get_msgdef(self._require_type(name))

    def encode(self, name: str, values: Mapping[str, object]) -> bytes:
        """Return a message with these values; all other fields are zero or empty.

        Raises BadRequest for values that do not fit the type.
        """
        try:
            made = self._make_message(self._require_type(name), values, name)
            return bytes(self._store.serialize_cdr(made, name, little_endian=True))
        except BadRequest:
            raise
        except (SerdeError, ValueError, TypeError, AttributeError, OverflowError) as error:
            raise BadRequest(f"{error}", hint="see its definition: `ros2 interface show`") from error
        except Exception as error:  # struct.error
            raise BadRequest(f"{name}: a value does not fit the type of its field: {error}") from error

    def decode(self, name: str, payload: bytes) -> Any:
        """Return a message as an object with the fields of the type ``name``.

        ``payload`` is CDR of either byte order. Raises MalformedMessage, which quotes the received bytes; also for
        XCDR2 and parameter lists, which ROS 2 does not use.
        """
        try:
            if wrong := _encapsulation_fault(payload):
                raise ValueError(wrong)
            return self._store.deserialize_cdr(payload, self._require_type(name))
        except Exception as error:  # received bytes: any error is due to them
            begin = f" that begin {payload[:8].hex(' ')}" if payload else ""
            raise MalformedMessage(f"expected {name}, got {len(payload)} bytes{begin}: {error}") from error

    def stamp(self, name: str, payload: bytes) -> int:
        """Return the stamp (ns) in the header of a message without decoding the rest; 0 for a type without a header."""
        fields = self._store.fielddefs[self._require_type(name)][1]
        if fields[0][1] != (Nodetype.NAME, "std_msgs/msg/Header") or len(payload) < 12:
            return 0
        order: Literal["little", "big"] = "little" if payload[1] else "big"
        seconds, rest = (int.from_bytes(payload[at : at + 4], order) for at in (4, 8))
        return seconds * 10**9 + rest

    def to_plain(self, message: object, depth: int = _MAX_DEPTH) -> Any:
        """Return a message as plain values for JSON. Long arrays are cut; ``depth`` is the maximum nesting."""
        if isinstance(message, np.ndarray):
            return message[:_MAX_LENGTH].tolist()
        if isinstance(message, np.generic):
            return message.item()
        if (kind := getattr(message, "__msgtype__", None)) is not None:
            names = [word for word, _ in self._store.fielddefs[kind][1] if word != _EMPTY_FIELD[0]]
            return {name: self.to_plain(getattr(message, name), depth - 1) for name in names} if depth else {}
        if isinstance(message, list | tuple):
            return [self.to_plain(each, depth - 1) for each in message[:_MAX_LENGTH]] if depth else []
        return message

    def _require_type(self, name: str) -> str:
        """Return ``name`` if the type is known. Types of this module are defined on first use. Raises BadRequest."""
        if name in self._store.fielddefs:
            return name
        if name in MESSAGES:
            self.define(name, MESSAGES[name])
        elif (service := _parent_of(name, SERVICES)) is not None:
            self.define_service(service, *SERVICES[service])
        elif (action := _parent_of(name, ACTIONS)) is not None:
            self.define_action(action, *ACTIONS[action])
        if name not in self._store.fielddefs:
            packages = sorted({each.split("/")[0] for each in (*self._store.fielddefs, *MESSAGES, *SERVICES, *ACTIONS)})
            hint = f"known are messages of {', '.join(packages)}"
            raise BadRequest(f"the type '{name}' of ROS 2 is not known", hint=hint)
        return name

    def _make_message(self, name: str, values: Mapping[str, object], at: str) -> object:
        if not isinstance(values, Mapping):
            raise ValueError(f"{at}: needs fields, got {values!r}")
        known = self._store.fielddefs[name][1]
        if wrong := values.keys() - {word for word, _ in known}:
            words = ", ".join(word for word, _ in known if word != _EMPTY_FIELD[0]) or "none"
            raise ValueError(f"{at} has no field '{min(wrong)}': its fields are {words}")
        given = {word: self._convert_value(kind, values.get(word), f"{at}.{word}") for word, kind in known}
        return self._store.types[name](**given)

    def _convert_value(self, kind: Any, value: object, at: str) -> Any:
        what, of = kind
        if what == Nodetype.NAME:
            return value if hasattr(value, "__msgtype__") else self._make_message(of, value or {}, at)  # type: ignore[arg-type]
        if what == Nodetype.BASE:
            return _convert_basic(of[0], value, at)
        inner, size = of
        given = [] if value is None else value
        if isinstance(given, str) or not isinstance(given, Sequence | np.ndarray | bytes):
            raise ValueError(f"{at}: needs a list, got {value!r}")
        if inner[0] == Nodetype.BASE and inner[1][0] != "string":
            dtype = {"char": "uint8", "byte": "uint8"}.get(inner[1][0], inner[1][0])
            array = np.frombuffer(given, np.uint8) if isinstance(given, bytes) else np.asarray(given, dtype)
            return (
                np.zeros(size, dtype) if what == Nodetype.ARRAY and value is None else array.astype(dtype, copy=False)
            )
        if what == Nodetype.ARRAY and value is None:
            given = [None] * size
        return [self._convert_value(inner, each, f"{at}[{place}]") for place, each in enumerate(given)]


_ENCAPSULATIONS = {
    2: "a parameter list (PL_CDR)", 3: "a parameter list (PL_CDR)", 6: "XCDR2", 7: "XCDR2", 8: "XCDR2 (delimited)",
    9: "XCDR2 (delimited)", 10: "XCDR2 (parameter list)", 11: "XCDR2 (parameter list)",
}  # fmt: skip
"""Encodings of DDS other than CDR, by the second byte of a payload."""


def _encapsulation_fault(payload: bytes) -> str:
    """Return why the header of a payload is not that of CDR; empty if it is."""
    if len(payload) < 4:
        return "too short for a CDR header"
    if payload[0] == 0 and payload[1] in (0, 1):
        return ""
    known = _ENCAPSULATIONS.get(payload[1], "") if payload[0] == 0 else ""
    return f"its header says {known}, not CDR" if known else "it has no CDR header"


def _parent_of(name: str, known: Mapping[str, object]) -> str | None:
    """Return the service or action in ``known`` to which the type ``name`` belongs; None if there is none."""
    return next((each for each in known if name == each or name.startswith(f"{each}_")), None)


def _field_types(fields: Sequence[Any]) -> list[str]:
    """Return the names of the message types that ``fields`` use."""
    inner = [of[0] if what in {Nodetype.ARRAY, Nodetype.SEQUENCE} else (what, of) for _, (what, of) in fields]
    return [of for what, of in inner if what == Nodetype.NAME]


_INTEGER_KIND = re.compile(r"(u?)int(8|16|32|64)")


def _convert_basic(kind: str, value: Any, at: str) -> object:
    if kind == "string":
        if value is not None and not isinstance(value, str):
            raise ValueError(f"{at}: needs a text, got {value!r}")
        return value or ""
    if kind == "bool":
        return bool(value)
    number = 0 if value is None else value
    if isinstance(number, str) or not hasattr(number, "__float__"):
        raise ValueError(f"{at}: needs a number, got {value!r}")
    if kind.startswith("float"):
        return float(number)
    if number != int(number):
        raise ValueError(f"{at}: needs a whole number, got {value!r}")
    if (found := _INTEGER_KIND.fullmatch(kind)) is not None:
        bits = int(found[2])
        low, high = (0, 2**bits - 1) if found[1] else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
        if not low <= number <= high:
            raise ValueError(f"{at}: must be from {low} to {high}, not {value!r}")
    return int(number)


def _char_to_uint8(field: Any) -> Any:
    word, (what, of) = field
    if what == Nodetype.ARRAY and of[0] == (Nodetype.BASE, ("char", 0)):
        return word, (what, ((Nodetype.BASE, ("uint8", 0)), of[1]))
    return field
