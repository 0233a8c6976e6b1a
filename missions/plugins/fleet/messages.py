"""The words of a fleet: names, keys on the wire, what a robot tells of itself, and what may be asked of it."""

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal, Self, TypeVar

from missions.codec import MAX_INTEGER, CodecError, Rules, decode, decode_tagged, encode, encode_tagged, parse
from missions.plugins.tasks.task import Interrupted

# How long robots of a fleet wait for each other.


@dataclass(frozen=True, slots=True)
class FleetTimeouts:
    """Seconds. A robot reports on a task each ``heartbeat``, and asks ``again`` where it got no answer.

    It lets go of a task that may be repeated once its keeper has not answered for ``lease``; after ``reassign_after``, which
    is longer by the time that a run may take to stop, the keeper gives that task to another.
    """

    heartbeat: float = 2.0
    retry_interval: float = 1.0
    lease: float = 30.0
    reassign_after: float = 50.0
    refusal_pause: float = 2.0


T = TypeVar("T")

MAX_MESSAGE_BYTES, MAX_ANSWER_BYTES = 64 * 1024, 1024 * 1024
"""Bytes of a message, and of an answer, at most."""

MAX_TEXT_LENGTH = 1000
"""Characters of a text, at most."""

RULES = Rules(
    max_text=MAX_TEXT_LENGTH, max_members=4096, max_number=MAX_INTEGER, is_text=str.isprintable, text="a printable text"
)
"""How messages are written and read. One that is not exactly as declared is refused whole."""

VERSION = 1
"""The version of keys and messages: robots of another one do not see each other."""

NAME_PATTERN = re.compile(r"[a-z0-9][a-z0-9_-]{0,39}")
"""Names of fleets and robots: what stands in a key as it is, and does nothing on a terminal."""

TASK_ID_PATTERN = re.compile(r"[a-z0-9][a-z0-9_-]{0,39}/[0-9a-f]{8}/[0-9a-f]{12}")
"""IDs of tasks: the address of the robot that keeps the task, and a number drawn by chance."""

Connection = Literal["ONLINE", "OFFLINE", "CONNECTIONBROKEN"]
"""As in VDA 5050: there; gone, after it said so; gone without a word."""

TaskState = Literal["WAITING", "INITIALIZING", "RUNNING", "PAUSED", "FINISHED", "FAILED"]
"""As in VDA 5050; the last two are for good."""

AttemptEnd = Literal["", "success", "failure", "interrupted", "refused"]
"""How an attempt ended; `refusal_pause` did not begin."""


@dataclass(frozen=True, slots=True, order=True)
class Address:
    """A robot: its name, and the number that its folder of tasks got by chance, so that two of one name differ."""

    name: str
    number: str

    def __str__(self) -> str:
        return f"{self.name}/{self.number}"

    @classmethod
    def read(cls, text: str) -> Self:
        """Read what ``str`` wrote. Raises CodecError."""
        name, _, number = text.partition("/")
        if not NAME_PATTERN.fullmatch(name) or not re.fullmatch("[0-9a-f]{8}", number):
            raise CodecError(f"no address of a robot: {ascii(text)[:80]}")
        return cls(name, number)


def zenoh_key(fleet: str, kind: str, where: str = "*/*") -> str:
    """Return the key of a kind (here, state, stop, ask) of a robot, or of all."""
    return f"missiontree/{VERSION}/{fleet}/{kind}/{where}"


def address_of_key(text: str) -> Address:
    """Return the robot that a key is of. Raises CodecError."""
    return Address.read("/".join(text.split("/")[-2:]))


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotState:
    """What a robot tells of itself, whenever that changes. Lengths in m, angles in rad; None is not known.

    ``session`` is drawn at each start, and ``number`` counts within it. ``battery`` (0..1) and the pose are those of
    the last run, ``age`` seconds ago. ``stops`` counts stops; ``stopped`` says who has latched the last.
    """

    session: str
    number: int
    robot: str
    parts: tuple[str, ...] = ()
    simulated: bool = False
    farewell: bool = False
    mission: str = ""
    task: str = ""
    task_state: TaskState | None = None
    free: bool = False
    battery: float | None = None
    x: float | None = None
    y: float | None = None
    heading: float | None = None
    age: float | None = None
    stops: int = 0
    stopped: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class FleetRequest:
    """Something that is asked of a robot; ``by`` says who asks, for people."""

    word: ClassVar[str] = ""
    by: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class FleetStop(FleetRequest):
    """Latch every actuator still, and begin no task, until it is released; asked again, of the same ``press``."""

    word: ClassVar[str] = "stop"
    press: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class FleetRelease(FleetRequest):
    """End the latched stop of this number; ``resume`` lets missions go on as well."""

    word: ClassVar[str] = "release"
    stop: int
    resume: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class ListPeers(FleetRequest):
    """Answer with the robots that it has met since it was started, and how each is connected."""

    word: ClassVar[str] = "met"


@dataclass(frozen=True, slots=True, kw_only=True)
class KeepTask(FleetRequest):
    """Keep a task, and have it done by the robot ``on``, or `any`, that is as ``where`` says; asked twice, once."""

    word: ClassVar[str] = "keep"
    task: str
    mission: str
    params: Mapping[str, str] = field(default_factory=dict)
    on: str = "any"
    where: str = ""
    if_interrupted: Interrupted = "retry"
    retries: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class AcceptTask(FleetRequest):
    """Have a task, and report on it; do not begin it before its keeper has confirmed that. ``again``: as `retry`."""

    word: ClassVar[str] = "accept"
    task: str
    attempt: int
    mission: str
    params: Mapping[str, str] = field(default_factory=dict)
    repeatable: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class TaskReport(FleetRequest):
    """Hear from ``robot`` how an attempt at a task goes. Refused, it is not that robot's any more."""

    word: ClassVar[str] = "report"
    task: str
    attempt: int
    robot: str
    state: TaskState
    how: AttemptEnd = ""
    reason: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class DecideTask(FleetRequest):
    """Do with a task whose robot is lost what a person says: have another do it, or give it up."""

    word: ClassVar[str] = "decide"
    task: str
    decision: Literal["hand-on", "give-up"]


@dataclass(frozen=True, slots=True, kw_only=True)
class ListFleetTasks(FleetRequest):
    """Answer with tasks that the robot keeps, the newest first: those that are open, or those that have ended.

    With ``before`` those that it was given before the task of that ID: an answer holds so many and no more.
    """

    word: ClassVar[str] = "tasks"
    ended: bool = False
    before: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Peer:
    """What is told of a robot that was met: its address, and how it is connected."""

    robot: str
    connection: Connection


@dataclass(frozen=True, slots=True, kw_only=True)
class FleetTaskInfo:
    """What is told of a task: what was asked for, by whom, which robot has it, and what became of it."""

    id: str
    mission: str
    params: Mapping[str, str]
    on: str
    where: str
    if_interrupted: Interrupted
    state: TaskState
    robot: str
    attempt: int
    reason: str
    by: str


@dataclass(frozen=True, slots=True, kw_only=True)
class FleetAnswer:
    """The answer to an Ask: ``reason`` it was not done, and what to try, where it was not.

    ``data`` are JSON objects, for who asked to check.
    """

    ok: bool = True
    reason: str = ""
    data: tuple[Mapping[str, Any], ...] = field(default=())


REQUESTS: Mapping[str, type[FleetRequest]] = {
    kind.word: kind
    for kind in (FleetStop, FleetRelease, ListPeers, KeepTask, AcceptTask, TaskReport, DecideTask, ListFleetTasks)
}
"""What may be asked, by its word."""


def read_request(data: bytes) -> FleetRequest:
    """Return what is asked. Raises CodecError."""
    return decode_tagged(parse(data, MAX_MESSAGE_BYTES), "do", REQUESTS, RULES)


def encode_message(message: Any) -> bytes:
    """Return a message as it is sent."""
    told = encode_tagged(message, "do", RULES) if isinstance(message, FleetRequest) else encode(message, RULES)
    return json.dumps(told, separators=(",", ":"), allow_nan=False).encode()


def decode_message(kind: type[T], data: bytes, max_bytes: int = MAX_MESSAGE_BYTES) -> T:
    """Return the message of class ``kind`` in ``data``. Raises CodecError."""
    return decode(kind, parse(data, max_bytes), RULES)
