"""What a client is told: answers to its commands, and what happens in the runs that it watches."""

import json
from collections.abc import Mapping, Sequence
from math import isfinite
from typing import Annotated, Any, ClassVar, Literal

from drivers.api.fast_dataclass import dataclass
from missions.codec import encode_tagged
from missions.control.commands import CODEC_RULES, Role

MESSAGE_KEY = "say"
"""The member that has the word of a message."""

PROTOCOL_VERSION = 2
"""The number of the protocol: it grows when a client of before would go wrong."""

ERRORS: Mapping[str, str] = {
    "no_json": "The message is no JSON object.",
    "too_large": "The message is longer than 64 KiB.",
    "unknown_command": "There is no such command.",
    "bad_field": "A member is missing, unknown, of another type, or out of its bounds.",
    "hello_first": "The first command of a connection is `hello`.",
    "old_page": "The page is of another version than the studio: reload it.",
    "not_allowed": "A viewer may not do this.",
    "too_many": "More commands than 100 a second, or too many that are not answered yet.",
    "no_such_run": "There is no such run, or not any more.",
    "no_answer": "The run does not answer. After a `stop`, the answer says whether a signal was sent that ends it.",
    "no_base": "The run has no base to drive, or no head to turn.",
    "no_wheels": "Somebody else drives, or nobody has taken the wheels.",
    "unsupported": "This run cannot have what is to go wrong: only one in simulated time can, with the parts it uses.",
    "stale": "The state behind the command is older than 0.5 s, or not one of this run: the base stops at once.",
    "let_go": "The base has stopped as commands or states were late: stand still once (both 0), then drive again.",
    "out_of_order": "Its number is not higher than that of the last, or its state is an older one: the base stops.",
    "stopped": "A stop is latched: release it first.",
    "not_stopped": "No such stop is latched.",
    "busy": "The mission itself moves the head: pause it first.",
    "device": "A part of the robot refuses, or is not there.",
    "not_sure": "The robot moves: say `sure` once somebody has looked.",
    "cannot_start": "The run has not begun: the command line's own words say why.",
    "bad_file": "A mission, robot, world or param is wrong.",
    "no_such_record": "There is no record of this name.",
    "bad_record": "The record cannot be read.",
    "no_person": "Nobody was added: the pictures do not show one face each, or the name is none.",
    "bad_task": "The task cannot be added, moved or cancelled.",
    "no_fleet": "This computer is in no fleet, or that cannot be reached.",
    "fault": "A fault of the studio itself.",
}
"""Every error that an answer may name."""

RunId = Annotated[str, "Which run."]
RunSeconds = Annotated[float, "Seconds from the start of the run."]


@dataclass(frozen=True, slots=True, kw_only=True)
class AnswerMessage:
    """The answer to a command. Where it is not `ok`, `error` is its name, for programs, and `message` is for people."""

    word: ClassVar[str] = "answer"
    id: Annotated[int | None, "That of the command."] = None
    ok: bool
    result: Annotated[Mapping[str, object] | None, "What was asked for."] = None
    error: Annotated[str | None, "Its name, see the table of errors."] = None
    message: Annotated[str | None, "What is wrong, in words."] = None
    hint: Annotated[str | None, "What to try."] = None


@dataclass(frozen=True, slots=True, kw_only=True)
class WelcomeMessage:
    """The first message, after `hello`."""

    word: ClassVar[str] = "welcome"
    version: Annotated[int, "Of the protocol."]
    page: Annotated[str, "The version of the page that is served now."]
    role: Role
    name: Annotated[str, "What the others see of this client."]
    release: Annotated[str, "The version of MissionTree."]


@dataclass(frozen=True, slots=True, kw_only=True)
class RunMessage:
    """What a run is: the first message of its control socket, and again when it is stopped or released.

    The studio's clients get it in `runs`.
    """

    word: ClassVar[str] = "run"
    run: RunId
    pid: int
    mission: str
    robot: str
    simulated: Annotated[Literal["", "wire", "fast"], "Empty for a robot that moves."]
    began: Annotated[float, "Time of day (Unix)."]
    stops: Annotated[int, "As in `state`."] = 0
    stopped: Annotated[str, "As in `state`."] = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class RunsMessage:
    """The runs of this machine, whenever that changes: each as a `run`. One that cannot be reached has `trouble`."""

    word: ClassVar[str] = "runs"
    runs: Annotated[Sequence[Mapping[str, object]], "The newest first."]


@dataclass(frozen=True, slots=True, kw_only=True)
class SceneMessage:
    """All that is so of a run, as it begins to be watched."""

    word: ClassVar[str] = "scene"
    run: RunId
    mission: str
    robot: str
    file: Annotated[str, "Of the mission."]
    params: Annotated[Mapping[str, str], "All of them, as texts."]
    simulated: Annotated[Literal["", "wire", "fast"], "Empty for a robot that moves."]
    world: Annotated[str, "What a simulated robot stands in."]
    drawing: Annotated[Mapping[str, object], "The tree, as `docs/tree.schema.json` describes it."]
    first: Annotated[
        Mapping[str, str], "What variables hold at the start, those of sub-missions too; by the names of `variables`."
    ]
    parts: Annotated[Sequence[str], "The parts of the robot that the mission has to do with."]
    limits: Annotated[Mapping[str, float] | None, "Of the base: `speed` (m/s), `turn` (rad/s)."] = None
    state: Annotated[Mapping[str, object], "The same as of a `state`: here, all of it."]
    log: Annotated[Sequence[Mapping[str, object]], "The last 500 events that are worth a line."]
    way: Annotated[Sequence[Sequence[float]], "Where the base was until now: x, y (m), 2000 places at most."]
    past: Annotated[Mapping[str, Sequence[Sequence[object]]], "Of each variable, up to 60 values: when (s), and what."]


@dataclass(frozen=True, slots=True, kw_only=True)
class StateMessage:
    """What is new of a run, at most 20 times a second. What a slow client misses it hears in one, the newest of each.

    What is not there has not changed.
    """

    word: ClassVar[str] = "state"
    run: RunId
    t: RunSeconds
    tick: Annotated[int, "How many ticks there were."]
    late: Annotated[float, "By how many seconds the last tick was too late."]
    lates: Annotated[int, "How many ticks were too late."]
    paused: bool
    stopping: Annotated[bool, "Whether the mission is being ended."]
    stops: Annotated[int, "How many stops there were: the number of the last one."]
    stopped: Annotated[str, "Who has latched the last stop; empty while none is."]
    driver: Annotated[str, "Who has the wheels; empty for the mission."]
    stamp: Annotated[int, "Drawn anew for each state: `drive` and `look` return the newest."]
    round_trip: Annotated[float, "How old (s) the state behind the driver's last command was; 0 where there is none."]
    asking: Annotated[Sequence[str], "Who asks for the wheels."]
    changed: Annotated[
        Mapping[str, Sequence[object]] | None, "By the key of a node: its status, its reason, and since when."
    ] = None
    visited: Annotated[Sequence[str] | None, "The way of the last tick: the keys of the nodes that it has visited."] = (
        None
    )
    variables: Annotated[Mapping[str, object] | None, "By their names: texts, and null for those that are gone."] = None
    parts: Annotated[
        Sequence[Mapping[str, object]] | None,
        "How each is: `part`, `level` (OK, WARN, ERROR, STALE), `age`, `values`, `detail`, `hint`; twice a second",
    ] = None
    pose: Annotated[Sequence[float] | None, "Where the base is by its odometry: x, y (m), heading (rad)."] = None
    joints: Annotated[
        Mapping[str, Sequence[float]] | None,
        "Of the arm, by name, and of further arms as `right_arm.elbow`: position (rad), load, temperature (degrees C).",
    ] = None
    scan: Annotated[Sequence[Sequence[float]] | None, "The range finder's points, x and y (m) on the robot."] = None
    percept: Annotated[Mapping[str, object] | None, "What was seen last: the event `percept`."] = None
    commands: Annotated[
        Mapping[str, Mapping[str, object]] | None, "What each part was commanded last: the event `command`."
    ] = None
    log: Annotated[Sequence[Mapping[str, object]] | None, "Events worth a line, in order."] = None
    lost: Annotated[int | None, "How many lines of the log a slow client has missed."] = None


@dataclass(frozen=True, slots=True, kw_only=True)
class EventsMessage:
    """All events of a run, in order, each as `mission run --events` writes it. `lost` is how many are missing."""

    word: ClassVar[str] = "events"
    run: RunId
    events: Sequence[Mapping[str, object]]
    lost: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class PictureMessage:
    """What the camera has seen, for who watches `pictures` and says `seen` of each: a slow link gets fewer."""

    word: ClassVar[str] = "picture"
    run: RunId
    t: RunSeconds
    width: int
    height: int
    jpeg: Annotated[str, "The picture, as base64."]
    found: Annotated[
        Sequence[Mapping[str, object]], "What was found in it: `name` and `box` (x, y, width, height in pixels)."
    ] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class RunOverMessage:
    """A run that was watched is over: `result` is success, failure, interrupted or error, or empty if nobody knows."""

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
"""Every message by its word."""


def encode_message(message: Any) -> bytes:
    """Return a message as JSON."""
    return encode_json(encode_tagged(message, MESSAGE_KEY, CODEC_RULES))


def encode_json(data: object) -> bytes:
    """Return data as JSON that every reader takes: numbers that are not finite are null, other things are texts."""
    try:
        text = json.dumps(data, ensure_ascii=False, separators=(",", ":"), allow_nan=False, default=str)
    except ValueError:
        text = json.dumps(
            _replace_non_finite(data), ensure_ascii=False, separators=(",", ":"), allow_nan=False, default=str
        )
    return text.encode("utf-8", "replace")


def _replace_non_finite(data: object) -> object:
    """Return data without numbers that JSON has not."""
    if isinstance(data, float):
        return data if isfinite(data) else None
    if isinstance(data, Mapping):
        return {str(key): _replace_non_finite(each) for key, each in data.items()}
    return [_replace_non_finite(each) for each in data] if isinstance(data, list | tuple) else data
