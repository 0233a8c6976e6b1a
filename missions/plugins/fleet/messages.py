"""Messages of a fleet: names, Zenoh keys, states and requests."""

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
    """Times of the protocol for fleet tasks, in seconds.

    A robot that has a task reports on it every ``heartbeat``, and repeats a report without an answer after
    ``retry_interval``. If no answer arrives for ``lease``, the robot cancels the task, provided that it may be repeated
    or has not begun. The allocator counts a robot as lost if no report arrives for ``reassign_after``, plus the time
    that a run may take to stop. Then it gives a repeatable task to another robot. A robot that refused a task is not
    offered it again for ``refusal_pause``.
    """

    heartbeat: float = 2.0
    retry_interval: float = 1.0
    lease: float = 30.0
    reassign_after: float = 50.0
    refusal_pause: float = 2.0


T = TypeVar("T")

MAX_MESSAGE_BYTES, MAX_ANSWER_BYTES = 64 * 1024, 1024 * 1024
"""Maximum size of a message, and of an answer, in bytes."""

MAX_TEXT_LENGTH = 1000
"""Maximum length of a text in a fleet message, in characters."""

RULES = Rules(
    max_text=MAX_TEXT_LENGTH, max_members=4096, max_number=MAX_INTEGER, is_text=str.isprintable, text="a printable text"
)
"""Rules for encoding and decoding fleet messages; a message with one invalid field is refused as a whole."""

VERSION = 1
"""Version of keys and messages; robots with different versions do not see each other."""

NAME_PATTERN = re.compile(r"[a-z0-9][a-z0-9_-]{0,39}")
"""Names of fleets and robots: safe in a Zenoh key and on a terminal."""

TASK_ID_PATTERN = re.compile(r"[a-z0-9][a-z0-9_-]{0,39}/[0-9a-f]{8}/[0-9a-f]{12}")
"""Task IDs: the address of the robot that keeps the task, and a random number."""

Connection = Literal["ONLINE", "OFFLINE", "CONNECTIONBROKEN"]
"""Connection state of a robot, named as in VDA 5050: connected, disconnected after a farewell, or without one."""

TaskState = Literal["WAITING", "INITIALIZING", "RUNNING", "PAUSED", "FINISHED", "FAILED"]
"""State of a fleet task, named as in VDA 5050; the last two states are final."""

AttemptEnd = Literal["", "success", "failure", "interrupted", "cancelled", "refused"]
"""Result of an attempt to run a fleet task: empty while it runs; `refused` means that the robot did not begin it."""


@dataclass(frozen=True, slots=True, order=True)
class Address:
    """Address of a robot in its fleet: its name, and a random number that distinguishes robots with the same name."""

    name: str
    number: str

    def __str__(self) -> str:
        return f"{self.name}/{self.number}"

    @classmethod
    def read(cls, text: str) -> Self:
        """Parse an address in the form that ``str`` of an address returns. Raises CodecError."""
        name, _, number = text.partition("/")
        if not NAME_PATTERN.fullmatch(name) or not re.fullmatch("[0-9a-f]{8}", number):
            raise CodecError(f"no address of a robot: {ascii(text)[:80]}")
        return cls(name, number)


def zenoh_key(fleet: str, kind: str, where: str = "*/*") -> str:
    """Return the Zenoh key for messages of one ``kind``, which is "here", "state", "stop" or "ask".

    ``where`` is the address of a robot, or ``*/*`` for all robots.
    """
    return f"missiontree/{VERSION}/{fleet}/{kind}/{where}"


def address_of_key(text: str) -> Address:
    """Return the robot's address in a Zenoh key. Raises CodecError."""
    return Address.read("/".join(text.split("/")[-2:]))


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotState:
    """State that a robot publishes when it changes. Lengths in m, angles in rad; None is unknown.

    ``session`` is a random text, drawn when the robot's server starts, and ``number`` counts the states since then.
    ``battery`` (0..1) and the pose are those of the last run, ``age`` seconds ago. ``stops`` counts the stops;
    ``stopped`` names the client that latched the last one.
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
    """A request to a robot; ``by`` names the sender, for people."""

    word: ClassVar[str] = ""
    by: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class FleetStop(FleetRequest):
    """Request to latch every actuator, and to begin no task until a release.

    ``press`` is a random text for one press of a stop button; a repeated request has the same.
    """

    word: ClassVar[str] = "stop"
    press: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class FleetRelease(FleetRequest):
    """Request to end the latched stop with the number ``stop``; with ``resume``, missions continue."""

    word: ClassVar[str] = "release"
    stop: int
    resume: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class ListPeers(FleetRequest):
    """Request for the list of robots that the receiver has seen since its start, with their connections."""

    word: ClassVar[str] = "met"


@dataclass(frozen=True, slots=True, kw_only=True)
class KeepTask(FleetRequest):
    """Request to become the allocator of a task, for the robot ``on`` (or `any`) that meets the condition ``where``.

    The receiver assigns the task to a robot. A repeated request with the same task ID has no effect.
    """

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
    """Request to accept a task and to report on it; it may begin only after the allocator has confirmed it.

    ``repeatable`` means that the task may run a second time, on another robot.
    """

    word: ClassVar[str] = "accept"
    task: str
    attempt: int
    mission: str
    params: Mapping[str, str] = field(default_factory=dict)
    repeatable: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class TaskReport(FleetRequest):
    """Report of ``robot`` to the allocator on its attempt to run a task.

    A negative answer means that the robot no longer has the task, and must stop it.
    """

    word: ClassVar[str] = "report"
    task: str
    attempt: int
    robot: str
    state: TaskState
    how: AttemptEnd = ""
    reason: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class DecideTask(FleetRequest):
    """A person's decision about a task whose robot no longer answers: give the task to another robot, or give it up."""

    word: ClassVar[str] = "decide"
    task: str
    decision: Literal["reassign", "give-up"]


@dataclass(frozen=True, slots=True, kw_only=True)
class ListFleetTasks(FleetRequest):
    """Request for the tasks that the receiver allocates, newest first: the open ones or the ``ended`` ones.

    An answer has a maximum size. ``before`` is the ID of the last task of the previous answer, to request the next
    page.
    """

    word: ClassVar[str] = "tasks"
    ended: bool = False
    before: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Peer:
    """A robot that the answering robot has seen since its start: address and connection."""

    robot: str
    connection: Connection


@dataclass(frozen=True, slots=True, kw_only=True)
class FleetTaskInfo:
    """A fleet task in an answer: the request for it, the client that gave it, the robot that has it, and its state."""

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
    """Answer to a FleetRequest; if it was refused, ``reason`` has the reason and the remedy.

    ``data`` are JSON objects, which the receiver decodes and checks.
    """

    ok: bool = True
    reason: str = ""
    data: tuple[Mapping[str, Any], ...] = field(default=())


REQUESTS: Mapping[str, type[FleetRequest]] = {
    kind.word: kind
    for kind in (FleetStop, FleetRelease, ListPeers, KeepTask, AcceptTask, TaskReport, DecideTask, ListFleetTasks)
}
"""Request classes by the word that names them in a message, such as "stop" or "tasks"."""


def read_request(data: bytes) -> FleetRequest:
    """Decode a request. Raises CodecError."""
    return decode_tagged(parse(data, MAX_MESSAGE_BYTES), "do", REQUESTS, RULES)


def encode_message(message: Any) -> bytes:
    """Encode a message as JSON."""
    data = encode_tagged(message, "do", RULES) if isinstance(message, FleetRequest) else encode(message, RULES)
    return json.dumps(data, separators=(",", ":"), allow_nan=False).encode()


def decode_message(kind: type[T], data: bytes, max_bytes: int = MAX_MESSAGE_BYTES) -> T:
    """Decode a message of class ``kind``. Raises CodecError."""
    return decode(kind, parse(data, max_bytes), RULES)
