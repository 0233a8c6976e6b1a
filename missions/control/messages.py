"""Messages to clients: answers to their commands, and states and events of the runs that they watch."""

import json
from collections.abc import Mapping, Sequence
from math import isfinite
from typing import Annotated, Any, ClassVar, Literal

from drivers.api.fast_dataclass import dataclass
from missions.codec import encode_tagged
from missions.control.commands import CODEC_RULES, Role

MESSAGE_KEY = "say"
"""JSON key of the word that names a message to a client, as in ``{"say": "state"}``."""

PROTOCOL_VERSION = 2
"""Version of the protocol; increased if older clients would fail."""

ERRORS: Mapping[str, str] = {
    "no_json": "The message is not a JSON object.",
    "too_large": "The message is longer than 64 KiB.",
    "unknown_command": "Unknown command.",
    "bad_field": "A member is missing, unknown, of a wrong type, or out of range.",
    "hello_first": "The first command of a connection must be `hello`.",
    "old_page": "The page has another version than the studio: reload it.",
    "not_allowed": "A viewer is not permitted to do this.",
    "too_many": "More than 100 commands per second, or too many unanswered ones.",
    "no_such_run": "The run does not exist, or has ended.",
    "no_answer": "No reply from the run. After a `stop`, the answer says whether it was ended by a signal.",
    "no_base": "The run has no base to drive, or no head to turn.",
    "no_wheels": "Another client drives, or no client has the wheels.",
    "unsupported": "The run does not support this fault: it needs simulated time, and the part.",
    "stale": "The state behind the command is older than 0.5 s, or of another run: the base stops at once.",
    "let_go": "The base has stopped because commands or states were late: send zero once, then drive again.",
    "out_of_order": "The number or the state is not newer than that of the last command: the base stops.",
    "stopped": "A stop is latched: release it first.",
    "not_stopped": "This stop is not latched.",
    "busy": "The mission itself moves the head: pause it first.",
    "device": "A part of the robot refuses, or is disconnected.",
    "not_sure": "The robot will move: send `sure` once a person has looked.",
    "cannot_start": "The run has not started: the message is that of the command line.",
    "bad_file": "A mission, robot, world or param has an error.",
    "no_such_record": "Unknown record.",
    "bad_record": "The record cannot be read.",
    "no_person": "No person was added: the name is invalid, or a picture does not show exactly one face.",
    "bad_task": "The task cannot be added, moved or cancelled.",
    "no_fleet": "This computer is not in a fleet, or the fleet cannot be reached.",
    "fault": "Internal error of the studio.",
}
"""Names of the errors in answers to clients, each with its meaning."""

RunId = Annotated[str, "Name of the run."]
RunSeconds = Annotated[float, "Seconds from the start of the run."]


@dataclass(frozen=True, slots=True, kw_only=True)
class AnswerMessage:
    """Answer to a command. If `ok` is false, `error` is the name for programs, and `message` the text for people."""

    word: ClassVar[str] = "answer"
    id: Annotated[int | None, "The id of the command."] = None
    ok: bool
    result: Annotated[Mapping[str, object] | None, "Result of the command."] = None
    error: Annotated[str | None, "Name of the error, see the table of errors."] = None
    message: Annotated[str | None, "Text of the error."] = None
    hint: Annotated[str | None, "Suggestion."] = None


@dataclass(frozen=True, slots=True, kw_only=True)
class WelcomeMessage:
    """First message of the studio to a client, the answer to `hello`."""

    word: ClassVar[str] = "welcome"
    version: Annotated[int, "Version of the protocol."]
    page: Annotated[str, "Version of the present page."]
    role: Role
    name: Annotated[str, "Name of this client for others."]
    release: Annotated[str, "Version of MissionTree."]


@dataclass(frozen=True, slots=True, kw_only=True)
class RunMessage:
    """Description of a run: the first message of its control socket, sent again after each stop and release.

    The studio's clients get it in `runs`.
    """

    word: ClassVar[str] = "run"
    run: RunId
    pid: int
    mission: str
    robot: str
    simulated: Annotated[Literal["", "wire", "fast"], "Kind of simulation; empty for a real robot."]
    began: Annotated[float, "Time of day (Unix)."]
    stops: Annotated[int, "As in `state`."] = 0
    stopped: Annotated[str, "As in `state`."] = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class RunsMessage:
    """All runs of this user on this computer, each as a `run`; sent after each change.

    A run that cannot be reached has `trouble`.
    """

    word: ClassVar[str] = "runs"
    runs: Annotated[Sequence[Mapping[str, object]], "Newest first."]


@dataclass(frozen=True, slots=True, kw_only=True)
class SceneMessage:
    """The complete state of a run, at the start of a subscription."""

    word: ClassVar[str] = "scene"
    run: RunId
    mission: str
    robot: str
    file: Annotated[str, "File of the mission."]
    params: Annotated[Mapping[str, str], "All params, as texts."]
    simulated: Annotated[Literal["", "wire", "fast"], "Kind of simulation; empty for a real robot."]
    world: Annotated[str, "World of a simulated robot."]
    drawing: Annotated[Mapping[str, object], "The tree, in the form of `docs/tree.schema.json`."]
    first: Annotated[
        Mapping[str, str], "Initial values of variables, also of sub-missions, by the names of `variables`."
    ]
    parts: Annotated[Sequence[str], "Parts of the robot."]
    limits: Annotated[Mapping[str, float] | None, "Limits of the base: `speed` (m/s), `turn` (rad/s)."] = None
    state: Annotated[Mapping[str, object], "Complete state, with the members of a `state`."]
    log: Annotated[Sequence[Mapping[str, object]], "The last 500 log lines."]
    way: Annotated[Sequence[Sequence[float]], "Path of the base so far: x, y (m), 2000 points at most."]
    past: Annotated[Mapping[str, Sequence[Sequence[object]]], "Up to 60 values of each variable: time (s) and value."]


@dataclass(frozen=True, slots=True, kw_only=True)
class StateMessage:
    """Changes of a run, at most 20 a second. A slow client gets several changes merged into one message.

    A missing member has not changed.
    """

    word: ClassVar[str] = "state"
    run: RunId
    t: RunSeconds
    tick: Annotated[int, "Number of ticks."]
    late: Annotated[float, "Delay of the last tick in seconds."]
    lates: Annotated[int, "Number of late ticks."]
    paused: bool
    stopping: Annotated[bool, "True while the mission is being ended."]
    stops: Annotated[int, "Number of stops so far, which is the number of the last one."]
    stopped: Annotated[str, "Who has latched the last stop; empty after its release."]
    driver: Annotated[str, "Name of the driver; empty for the mission."]
    stamp: Annotated[int, "Random number of this state: `drive` and `look` repeat the newest."]
    round_trip: Annotated[float, "Age (s) of the state behind the driver's last command; 0 without one."]
    asking: Annotated[Sequence[str], "Names of the clients that request the wheels."]
    changed: Annotated[Mapping[str, Sequence[object]] | None, "Status, reason and time of changed nodes, by key."] = (
        None
    )
    visited: Annotated[Sequence[str] | None, "Keys of the nodes that the last tick visited."] = None
    variables: Annotated[
        Mapping[str, object] | None, "Values of changed variables as texts, null for deleted ones."
    ] = None
    parts: Annotated[
        Sequence[Mapping[str, object]] | None,
        "Status of each part: `part`, `level` (OK, WARN, ERROR, STALE), `age`, `values`, `detail`, `hint`; "
        "twice a second",
    ] = None
    pose: Annotated[Sequence[float] | None, "Odometry of the base: x, y (m), heading (rad)."] = None
    joints: Annotated[
        Mapping[str, Sequence[float]] | None,
        "Joints of the arm, and of further arms as `right_arm.elbow`: position (rad), load, temperature (degrees C).",
    ] = None
    scan: Annotated[Sequence[Sequence[float]] | None, "Points of the range finder, x and y (m) in the robot frame."] = (
        None
    )
    percept: Annotated[Mapping[str, object] | None, "The last event `percept`."] = None
    commands: Annotated[Mapping[str, Mapping[str, object]] | None, "The last event `command` of each part."] = None
    log: Annotated[Sequence[Mapping[str, object]] | None, "New log lines, in order."] = None
    lost: Annotated[int | None, "Number of log lines that a slow client has missed."] = None


@dataclass(frozen=True, slots=True, kw_only=True)
class EventsMessage:
    """All events of a run in order, each as in `mission run --events`. `lost` is the number of dropped ones."""

    word: ClassVar[str] = "events"
    run: RunId
    events: Sequence[Mapping[str, object]]
    lost: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class PictureMessage:
    """A camera frame for clients that watch `pictures` and confirm each with `seen`: a slow link gets fewer."""

    word: ClassVar[str] = "picture"
    run: RunId
    t: RunSeconds
    width: int
    height: int
    jpeg: Annotated[str, "The picture, as base64."]
    found: Annotated[
        Sequence[Mapping[str, object]], "Percepts in the picture: `name` and `box` (x, y, width, height in pixels)."
    ] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class RunOverMessage:
    """End of a watched run: `result` is success, failure, interrupted or error; empty if unknown."""

    word: ClassVar[str] = "over"
    run: RunId
    result: str
    reason: str
    seconds: float


MESSAGES: Mapping[str, type[Any]] = {
    kind.word: kind
    for kind in (
        AnswerMessage,
        WelcomeMessage,
        RunMessage,
        RunsMessage,
        SceneMessage,
        StateMessage,
        EventsMessage,
        PictureMessage,
        RunOverMessage,
    )
}
"""Classes of the messages to clients, by the word that names each in a message, such as "state"."""


def encode_message(message: Any) -> bytes:
    """Return a message as JSON."""
    return encode_json(encode_tagged(message, MESSAGE_KEY, CODEC_RULES))


def encode_json(data: object) -> bytes:
    """Return data as standard JSON in UTF-8: infinity and NaN become null, objects of other types become texts."""
    try:
        text = json.dumps(data, ensure_ascii=False, separators=(",", ":"), allow_nan=False, default=str)
    except ValueError:
        text = json.dumps(
            _replace_non_finite(data), ensure_ascii=False, separators=(",", ":"), allow_nan=False, default=str
        )
    return text.encode("utf-8", "replace")


def _replace_non_finite(data: object) -> object:
    """Return data with null instead of numbers that JSON does not have."""
    if isinstance(data, float):
        return data if isfinite(data) else None
    if isinstance(data, Mapping):
        return {str(key): _replace_non_finite(each) for key, each in data.items()}
    return [_replace_non_finite(each) for each in data] if isinstance(data, list | tuple) else data
