"""Commands that the studio itself handles: library, records, tasks, fleet and people."""

from collections.abc import Mapping
from dataclasses import field
from typing import Annotated, ClassVar, Literal

from drivers.api.fast_dataclass import dataclass
from missions.codec import Bound, object_schema
from missions.control.commands import CODEC_RULES, COMMAND_KEY, RUN_COMMANDS, ClientCommand, Role
from missions.control.messages import MESSAGE_KEY, MESSAGES, PROTOCOL_VERSION
from missions.options import options_of
from missions.request import RunRequest


@dataclass(frozen=True, slots=True, kw_only=True)
class Hello(ClientCommand):
    """First command of a connection; later, a ping. The page reloads if its version differs from that of the studio."""

    word: ClassVar[str] = "hello"
    role: ClassVar[Role] = "viewer"
    version: Annotated[str, "The page's `<meta name=version>`; for another program, the version of the protocol."]


RUN_OPTIONS = {each.name: each for each in options_of(RunRequest)}
"""Options of `mission run` by name; their declarations are used for the message and the form that start a run."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LibraryQuery(ClientCommand):
    """Return the `missions`, `robots`, `worlds` and `people` of the library."""

    word: ClassVar[str] = "library"
    role: ClassVar[Role] = "viewer"
    edition: Annotated[
        str, "The version that you have: if nothing has changed since, the answer has nothing else.", Bound(high=64)
    ] = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class MissionQuery(ClientCommand):
    """Return a mission: summary, form fields of its params, drawing, and the parts that it needs."""

    word: ClassVar[str] = "mission"
    role: ClassVar[Role] = "viewer"
    name: Annotated[str, "Name in the library, or file."]


@dataclass(frozen=True, slots=True, kw_only=True)
class WorldQuery(ClientCommand):
    """Return a world's plan as `svg`, and the pose of the odometry's origin in it."""

    word: ClassVar[str] = "world"
    role: ClassVar[Role] = "viewer"
    name: Annotated[str, "Name in the library, or file."]


@dataclass(frozen=True, slots=True, kw_only=True)
class FailsafeQuery(ClientCommand):
    """Return the reaction of a base to a fault as `moments`, and the available `choices`.

    Each field is one of `choices`; an empty one is chosen for you.
    """

    word: ClassVar[str] = "failsafe"
    role: ClassVar[Role] = "viewer"
    who: Annotated[str, "Source of the commands."] = ""
    wish: Annotated[str, "Commanded velocity."] = ""
    fault: Annotated[str, "Fault."] = ""
    battery: Annotated[str, "Battery level."] = ""
    reflexes: Annotated[str, "Reflexes of the robot file."] = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class StartRun(ClientCommand):
    """Run a mission in a process of its own; returns its `run` name when it has begun, or the error."""

    word: ClassVar[str] = "start"
    mission: Annotated[str, "Name in the library, or file."]
    params: Annotated[Mapping[str, str], "Params by name, each as on the command line: `5 s`."] = field(
        default_factory=dict
    )
    robot: Annotated[str, "Robot, which moves unless it is simulated; if empty, the default one, simulated."] = ""
    simulate: Annotated[Literal["", "wire", "fast"], "Kind of simulation; `fast` is simulated time."] = ""
    world: Annotated[str, RUN_OPTIONS["world"]] = ""
    seed: Annotated[int, RUN_OPTIONS["seed"], Bound(high=2**53)] = 0
    speed: Annotated[float | None, RUN_OPTIONS["speed"]] = None
    sure: Annotated[bool, "For a robot that moves: confirms that there is room."] = False
    record: Annotated[bool, "Whether it is recorded."] = True


@dataclass(frozen=True, slots=True, kw_only=True)
class ShowPerson(ClientCommand):
    """Send a picture of a person, for this client's next `add_person` without a `run`."""

    word: ClassVar[str] = "show_person"
    jpeg: Annotated[str, "Picture as base64; `add_person` uses the last six.", Bound(high=60_000)]


@dataclass(frozen=True, slots=True, kw_only=True)
class AddPerson(ClientCommand):
    """Add the person in front of a run's camera, or in the pictures sent with `show_person`.

    The person must be the only one visible. The rules of `mission person add` apply. Get the person's consent first.
    """

    word: ClassVar[str] = "add_person"
    name: Annotated[str, "Name of the person.", Bound(high=60)]
    run: Annotated[
        str, "Run whose camera is used, as named in `runs`; empty for the pictures of `show_person`.", Bound(high=64)
    ] = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class KeepTuning(ClientCommand):
    """Write the values that `tune` changed in a run to its robot file; the rest of the file stays."""

    word: ClassVar[str] = "keep_tuning"
    run: Annotated[str, "Run, as named in `runs`.", Bound(high=64)]


@dataclass(frozen=True, slots=True, kw_only=True)
class RevokeLinks(ClientCommand):
    """Replace the links of operator and viewer, and disconnect everyone else; the parts that they drove stop.

    The answer has the new tokens. The sender's cookie ends too: open the new link.
    """

    word: ClassVar[str] = "revoke"


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordsQuery(ClientCommand):
    """Return the stored `records`, the newest first."""

    word: ClassVar[str] = "records"
    role: ClassVar[Role] = "viewer"


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordQuery(ClientCommand):
    """Return a record: drawing, node states over time, log, failures, and result.

    A long record comes in pieces: if the answer has `more`, request the next piece from there.
    """

    word: ClassVar[str] = "record"
    role: ClassVar[Role] = "viewer"
    name: Annotated[str, "Record, as named in `records`.", Bound(high=255)]
    start: Annotated[float, "Start in seconds: `more` of the previous piece.", Bound(-1e9, 1e9)] = -1e9


@dataclass(frozen=True, slots=True, kw_only=True)
class MomentQuery(ClientCommand):
    """Return the state at a moment of a record: tree, variables, pose, parts, joints, scan, and picture."""

    word: ClassVar[str] = "moment"
    role: ClassVar[Role] = "viewer"
    name: Annotated[str, "Record, as named in `records`.", Bound(high=255)]
    t: Annotated[float, "Seconds from the start of the run.", Bound(0.0, 1e9)]


@dataclass(frozen=True, slots=True, kw_only=True)
class CompareRecords(ClientCommand):
    """Return the differences of two records of one mission on one robot, like `mission record compare --json`."""

    word: ClassVar[str] = "compare"
    role: ClassVar[Role] = "viewer"
    name: Annotated[str, "Record, as named in `records`.", Bound(high=255)]
    other: Annotated[str, "The other record, as named in `records`.", Bound(high=255)]


@dataclass(frozen=True, slots=True, kw_only=True)
class TasksQuery(ClientCommand):
    """Return the `tasks` of the queue, like `mission task list --json`, and whether the task server runs (`served`)."""

    word: ClassVar[str] = "tasks"
    role: ClassVar[Role] = "viewer"
    ended: Annotated[bool, "Include ended tasks."] = False


@dataclass(frozen=True, slots=True, kw_only=True)
class FleetQuery(ClientCommand):
    """Return the `robots` of this computer's fleet, and the `missing` robots: docs/fleet.md."""

    word: ClassVar[str] = "fleet"
    role: ClassVar[Role] = "viewer"


@dataclass(frozen=True, slots=True, kw_only=True)
class StopFleet(ClientCommand):
    """Stop all robots of the fleet, latched; returns each robot's confirmation, and the `silent` robots."""

    word: ClassVar[str] = "stop_fleet"
    role: ClassVar[Role] = "viewer"


@dataclass(frozen=True, slots=True, kw_only=True)
class ReleaseFleet(ClientCommand):
    """Release the stop of the fleet for one robot, or for all."""

    word: ClassVar[str] = "release_fleet"
    robot: Annotated[str, "Robot: name, or name/number; empty for all.", Bound(high=60)] = ""
    resume: Annotated[bool, "Resume the missions, instead of leaving them paused."] = False


@dataclass(frozen=True, slots=True, kw_only=True)
class AddTask(ClientCommand):
    """Add a task to the queue, like `mission task add`; returns its number."""

    word: ClassVar[str] = "add_task"
    mission: Annotated[str, "Name in the library, or file."]
    params: Annotated[Mapping[str, str], "Params by name, each as on the command line."] = field(default_factory=dict)
    robot: Annotated[str, "As in `start`."] = ""
    simulate: Annotated[Literal["", "wire", "fast"], "As in `start`."] = ""
    world: Annotated[str, "As in `start`."] = ""
    at: Annotated[str, 'Start time: "18:00", "2026-12-24 18:00"; empty for now.'] = ""
    every: Annotated[str, 'Repetition: "30 min", "day", "monday 18:00".'] = ""
    priority: Annotated[int, "The highest of the due tasks runs first.", Bound(-100, 100)] = 0
    retry: Annotated[int, "Number of retries after a failure.", Bound(0, 1000)] = 0
    needs_approval: Annotated[bool, "Whether it waits for approval."] = False
    sure: Annotated[bool, "As in `start`."] = False


@dataclass(frozen=True, slots=True, kw_only=True)
class ApproveTask(ClientCommand):
    """Approve a task that needs approval before it begins; each repetition needs its own."""

    word: ClassVar[str] = "approve_task"
    task: Annotated[int, "Number of the task.", Bound(1, 2**53)]
    by: Annotated[str, "Set by the studio to the client's name.", Bound(high=60)] = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class MoveTask(ClientCommand):
    """Change the priority of a waiting task: of the tasks that are due, the highest begins first."""

    word: ClassVar[str] = "move_task"
    task: Annotated[int, "Number of the task.", Bound(1, 2**53)]
    priority: Annotated[int, "New priority.", Bound(-100, 100)]


@dataclass(frozen=True, slots=True, kw_only=True)
class CancelTask(ClientCommand):
    """Cancel a task and its repetitions; a running task is stopped safely."""

    word: ClassVar[str] = "cancel_task"
    task: Annotated[int, "Number of the task.", Bound(1, 2**53)]


COMMANDS: Mapping[str, type[ClientCommand]] = {
    **{
        kind.word: kind
        for kind in (
            Hello, LibraryQuery, MissionQuery, WorldQuery, FailsafeQuery, StartRun,
            ShowPerson, AddPerson, KeepTuning, RevokeLinks,
            RecordsQuery, RecordQuery, MomentQuery, CompareRecords,
            TasksQuery, AddTask, ApproveTask, MoveTask, CancelTask,
            FleetQuery, StopFleet, ReleaseFleet,
        )
    },
    **RUN_COMMANDS,
}  # fmt: skip
"""Commands of the studio by word: its own, and those forwarded to a run."""


def protocol_schema() -> dict[str, object]:
    """Return the JSON Schema of the protocol: `commands` and `messages`, by word."""
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": f"The messages of MissionTree's studio, version {PROTOCOL_VERSION}",
        "anyOf": [
            {"$ref": f"#/$defs/{side}/{word}"}
            for side, words in (("commands", COMMANDS), ("messages", MESSAGES))
            for word in words
        ],
        "$defs": {
            "commands": _schemas(COMMANDS, COMMAND_KEY),
            "messages": _schemas(MESSAGES, MESSAGE_KEY),
        },
    }


def _schemas(kinds: Mapping[str, type[object]], key: str) -> dict[str, object]:
    """Return the JSON Schemas of messages by word; ``key`` is the field that holds the word."""
    return {word: object_schema(kind, CODEC_RULES, **{key: {"const": word}}) for word, kind in kinds.items()}
