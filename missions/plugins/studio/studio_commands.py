"""What a client may ask of the studio itself: what there is to run, records, and tasks."""

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
    """The first command of a connection; again, it is a ping. A page of another version is told to reload."""

    word: ClassVar[str] = "hello"
    role: ClassVar[Role] = "viewer"
    version: Annotated[str, "What the page has in its `<meta name=version>`; another program, the protocol's number."]


RUN_OPTIONS = {each.name: each for each in options_of(RunRequest)}
"""The options of `mission run` by their names, for the messages and the form that start one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LibraryQuery(ClientCommand):
    """Answer with what there is to run, and on what: `missions`, `robots`, `worlds`, `people`."""

    word: ClassVar[str] = "library"
    role: ClassVar[Role] = "viewer"
    edition: Annotated[
        str, "The one that you have: while nothing has changed since, the answer holds nothing more.", Bound(high=64)
    ] = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class MissionQuery(ClientCommand):
    """Answer with a mission: its summary, its params as a form has them, its drawing, and the parts that it needs."""

    word: ClassVar[str] = "mission"
    role: ClassVar[Role] = "viewer"
    name: Annotated[str, "A name in the library, or a file."]


@dataclass(frozen=True, slots=True, kw_only=True)
class WorldQuery(ClientCommand):
    """Answer with a world's plan: `svg`, and where in it the robot's odometry begins, and which way."""

    word: ClassVar[str] = "world"
    role: ClassVar[Role] = "viewer"
    name: Annotated[str, "A name in the library, or a file."]


@dataclass(frozen=True, slots=True, kw_only=True)
class FailsafeQuery(ClientCommand):
    """Answer with what a base does while something goes wrong: its `moments`, and the `choices` that there are.

    The words are those of `choices`; the first where empty.
    """

    word: ClassVar[str] = "failsafe"
    role: ClassVar[Role] = "viewer"
    who: Annotated[str, "Who drives."] = ""
    wish: Annotated[str, "Where to."] = ""
    fault: Annotated[str, "What happens."] = ""
    battery: Annotated[str, "How full its battery is."] = ""
    reflexes: Annotated[str, "What its robot file says of reflexes."] = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class StartRun(ClientCommand):
    """Run a mission in a process of its own; answered with its `run` once it has begun, or with why it has not."""

    word: ClassVar[str] = "start"
    mission: Annotated[str, "A name in the library, or a file."]
    params: Annotated[Mapping[str, str], "Each as on the command line: `5 s`."] = field(default_factory=dict)
    robot: Annotated[str, "The robot, which moves unless it is simulated; the usual one, simulated, where empty."] = ""
    simulate: Annotated[Literal["", "wire", "fast"], "How it is simulated; `fast` is simulated time."] = ""
    world: Annotated[str, RUN_OPTIONS["world"]] = ""
    seed: Annotated[int, RUN_OPTIONS["seed"], Bound(high=2**53)] = 0
    speed: Annotated[float | None, RUN_OPTIONS["speed"]] = None
    sure: Annotated[bool, "For a robot that moves: somebody has looked, and there is room."] = False
    record: Annotated[bool, "Whether it is recorded."] = True


@dataclass(frozen=True, slots=True, kw_only=True)
class ShowPerson(ClientCommand):
    """Hand over a picture of somebody, for the `add_person` without a `run` that comes next of this client."""

    word: ClassVar[str] = "show_person"
    jpeg: Annotated[str, "The picture, as base64: of the last six of them somebody is known.", Bound(high=60_000)]


@dataclass(frozen=True, slots=True, kw_only=True)
class AddPerson(ClientCommand):
    """Let the robot know who stands before the camera of a run, alone, or is in pictures that were handed over.

    That goes by the rules of `mission person add`. Ask them first.
    """

    word: ClassVar[str] = "add_person"
    name: Annotated[str, "What they are called.", Bound(high=60)]
    run: Annotated[
        str, "Whose camera, as `runs` names it; empty for the pictures of `show_person`.", Bound(high=64)
    ] = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class KeepTuning(ClientCommand):
    """Write what was changed by `tune` in a run into its robot file, of which all else stays as it is."""

    word: ClassVar[str] = "keep_tuning"
    run: Annotated[str, "Whose, as `runs` names it.", Bound(high=64)]


@dataclass(frozen=True, slots=True, kw_only=True)
class RevokeLinks(ClientCommand):
    """Make both links anew, and shut out whoever came by the former ones, but for who asks; what they drove stands.

    The answer has the new tokens. Who asks has no cookie any more either: it opens the new link.
    """

    word: ClassVar[str] = "revoke"


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordsQuery(ClientCommand):
    """Answer with the `records` that are kept, the newest first."""

    word: ClassVar[str] = "records"
    role: ClassVar[Role] = "viewer"


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordQuery(ClientCommand):
    """Answer with a record: its drawing, what each node was when, its log, its failures, and how it ended.

    A long one comes in pieces: where the answer has `more`, ask again from there on for the next.
    """

    word: ClassVar[str] = "record"
    role: ClassVar[Role] = "viewer"
    name: Annotated[str, "As `records` names it.", Bound(high=255)]
    start: Annotated[float, "From so many seconds on: the `more` of the piece before.", Bound(-1e9, 1e9)] = -1e9


@dataclass(frozen=True, slots=True, kw_only=True)
class MomentQuery(ClientCommand):
    """Answer with what was so at a moment of a record: tree, variables, place, parts, joints, scan, and picture."""

    word: ClassVar[str] = "moment"
    role: ClassVar[Role] = "viewer"
    name: Annotated[str, "As `records` names it.", Bound(high=255)]
    t: Annotated[float, "Seconds from the start of the run.", Bound(0.0, 1e9)]


@dataclass(frozen=True, slots=True, kw_only=True)
class CompareRecords(ClientCommand):
    """Answer with what two records of one mission on one robot differ in, as `mission record compare --json` does."""

    word: ClassVar[str] = "compare"
    role: ClassVar[Role] = "viewer"
    name: Annotated[str, "As `records` names it.", Bound(high=255)]
    other: Annotated[str, "The same of the other one.", Bound(high=255)]


@dataclass(frozen=True, slots=True, kw_only=True)
class TasksQuery(ClientCommand):
    """Answer with the `tasks` of the queue, as `mission task list --json` has them, and whether it is `served`."""

    word: ClassVar[str] = "tasks"
    role: ClassVar[Role] = "viewer"
    ended: Annotated[bool, "Also those that have ended."] = False


@dataclass(frozen=True, slots=True, kw_only=True)
class FleetQuery(ClientCommand):
    """Answer with the `robots` of this computer's fleet, and those that are `missing`: docs/fleet.md."""

    word: ClassVar[str] = "fleet"
    role: ClassVar[Role] = "viewer"


@dataclass(frozen=True, slots=True, kw_only=True)
class StopFleet(ClientCommand):
    """Stop all robots of the fleet, latched; answered with what each has confirmed, and who is `silent`."""

    word: ClassVar[str] = "stop_fleet"
    role: ClassVar[Role] = "viewer"


@dataclass(frozen=True, slots=True, kw_only=True)
class ReleaseFleet(ClientCommand):
    """Release that stop of one robot, or of all."""

    word: ClassVar[str] = "release_fleet"
    robot: Annotated[str, "Its name, or name/number; all where empty.", Bound(high=60)] = ""
    resume: Annotated[bool, "Whether missions go on; else they stay paused."] = False


@dataclass(frozen=True, slots=True, kw_only=True)
class AddTask(ClientCommand):
    """Add a task to the queue, as `mission task add` does; answered with its number."""

    word: ClassVar[str] = "add_task"
    mission: Annotated[str, "A name in the library, or a file."]
    params: Annotated[Mapping[str, str], "Each as on the command line."] = field(default_factory=dict)
    robot: Annotated[str, "As of `start`."] = ""
    simulate: Annotated[Literal["", "wire", "fast"], "As of `start`."] = ""
    world: Annotated[str, "As of `start`."] = ""
    at: Annotated[str, 'When: "18:00", "2026-12-24 18:00"; at once where empty.'] = ""
    every: Annotated[str, 'Again and again: "30 min", "day", "monday 18:00".'] = ""
    priority: Annotated[int, "Of those that are due, the highest is first.", Bound(-100, 100)] = 0
    retry: Annotated[int, "How often to try again when it fails.", Bound(0, 1000)] = 0
    needs_approval: Annotated[bool, "Whether it begins only once somebody approves it."] = False
    sure: Annotated[bool, "As of `start`."] = False


@dataclass(frozen=True, slots=True, kw_only=True)
class ApproveTask(ClientCommand):
    """Let a task begin that needs approval; each of a repetition needs its own."""

    word: ClassVar[str] = "approve_task"
    task: Annotated[int, "Its number.", Bound(1, 2**53)]
    by: Annotated[str, "The studio puts in the client's name, whatever stands here.", Bound(high=60)] = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class MoveTask(ClientCommand):
    """Give a task that waits another priority: of those that are due, the highest is first."""

    word: ClassVar[str] = "move_task"
    task: Annotated[int, "Its number.", Bound(1, 2**53)]
    priority: Annotated[int, "The new one.", Bound(-100, 100)]


@dataclass(frozen=True, slots=True, kw_only=True)
class CancelTask(ClientCommand):
    """Cancel a task and its repetition; one that runs is stopped safely."""

    word: ClassVar[str] = "cancel_task"
    task: Annotated[int, "Its number.", Bound(1, 2**53)]


COMMANDS: Mapping[str, type[ClientCommand]] = {
    **{
        kind.word: kind
        for kind in (
            Hello, LibraryQuery, MissionQuery, WorldQuery, FailsafeQuery, StartRun, ShowPerson, AddPerson, KeepTuning, RevokeLinks,
            RecordsQuery, RecordQuery, MomentQuery, CompareRecords,
            TasksQuery, AddTask, ApproveTask, MoveTask, CancelTask,
            FleetQuery, StopFleet, ReleaseFleet,
        )
    },
    **RUN_COMMANDS,
}  # fmt: skip
"""Every command that the studio takes, by its word: its own, and those that it passes on to a run."""


def protocol_schema() -> dict[str, object]:
    """Return the JSON Schema of the whole protocol: `commands` and `messages`, by their words."""
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
    """Return the JSON Schemas of messages by their words, which stand under ``key``."""
    return {word: object_schema(kind, CODEC_RULES, **{key: {"const": word}}) for word, kind in kinds.items()}
