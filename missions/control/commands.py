"""Commands of clients to a run, over the studio or over the control socket of the run.

A command is a JSON object ``{"do": word, "id": number, ...}``. Its answer has the same ``id``; a command without an id
is answered only if it has an error.
"""

import re
from collections.abc import Mapping
from itertools import islice
from typing import Annotated, ClassVar, Literal

from config.file_io import parse_json
from drivers.api.fast_dataclass import dataclass
from missions.codec import MAX_INTEGER, Bound, CodecError, Rules, UnknownTagError, decode_tagged, parse

COMMAND_KEY = "do"
"""JSON key of the word that names a command, as in ``{"do": "stop"}``."""

MAX_COMMAND_BYTES = 64 * 1024
"""Maximum length of a client's command in bytes."""

CODEC_RULES = Rules(
    max_text=4096,
    max_members=256,
    max_number=MAX_INTEGER,
    is_text=lambda text: "\0" not in text and not any("\ud800" <= letter <= "\udfff" for letter in text),
    text="a text without NUL and without surrogates",
    omit_none=True,
)
"""Codec rules of commands and messages; each text can be written to a file and used on a command line."""

Role = Literal["viewer", "operator"]
"""Permissions of a client: a viewer can watch and stop; an operator can do everything."""

RunName = Annotated[str, "Name of the run, as in `runs`.", Bound(high=64)]
CommandId = Annotated[int | None, "Repeated in the answer.", Bound(-(2**53), 2**53)]
CommandNumber = Annotated[
    int, "Increasing number of the driver's commands; one that is not above the last stops the base.", Bound(0, 2**53)
]
StateStamp = Annotated[
    int,
    "The `stamp` of the newest `state` that the driver has received; the command is valid for 0.5 s after it.",
    Bound(0, 2**53),
]
SHARE_BOUND = Bound(-1.0, 1.0)


class BadMessage(ValueError):
    """A message that is not a valid command, or cannot be executed.

    ``error`` is the name of the error in answers to clients, one of ``missions.control.messages.ERRORS``.
    """

    def __init__(self, error: str, message: str, hint: str = "") -> None:
        super().__init__(message)
        self.error, self.hint = error, hint

    def __reduce__(self) -> tuple[type["BadMessage"], tuple[str, str, str]]:
        return BadMessage, (self.error, str(self), self.hint)  # for pickling between processes


@dataclass(frozen=True, slots=True, kw_only=True)
class ClientCommand:
    """Base of all commands; ``role`` is the minimum permission."""

    word: ClassVar[str] = ""
    role: ClassVar[Role] = "operator"
    id: CommandId = None


@dataclass(frozen=True, slots=True, kw_only=True)
class RunCommand(ClientCommand):
    """A command to a run."""

    run: RunName = ""
    by: Annotated[str, "Name of the user; the studio replaces it by the client's name.", Bound(high=60)] = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class WatchCommand(RunCommand):
    """Subscribe to a run, instead of an earlier subscription; with all options off, unsubscribe.

    The first message is a `scene` with the complete state.
    """

    word: ClassVar[str] = "watch"
    role: ClassVar[Role] = "viewer"
    state: Annotated[bool, "Subscribe to `state`."] = True
    events: Annotated[bool, "Subscribe to `events`: all events, as in `mission run --events`."] = False
    pictures: Annotated[float, "Maximum `picture`s per second.", Bound(0.0, 30.0)] = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class PictureShownCommand(RunCommand):
    """Confirm that the picture of this time was shown; at most two unconfirmed pictures are sent."""

    word: ClassVar[str] = "seen"
    role: ClassVar[Role] = "viewer"
    t: Annotated[float, "The `t` of the picture."]


@dataclass(frozen=True, slots=True, kw_only=True)
class StopCommand(RunCommand):
    """Latch every actuator and pause the mission until `release`. Without a run, stop all runs of this user."""

    word: ClassVar[str] = "stop"
    role: ClassVar[Role] = "viewer"
    press: Annotated[
        str, "A text that is unique to a press, so that it counts once if it arrives twice.", Bound(high=60)
    ] = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class ReleaseCommand(RunCommand):
    """Release a latched stop. The mission stays paused until `resume`."""

    word: ClassVar[str] = "release"
    stop: Annotated[int, "Number of the stop, as in `stops` of `state`, so that a later stop is not released."]


@dataclass(frozen=True, slots=True, kw_only=True)
class PauseCommand(RunCommand):
    """Pause ticking; the mission keeps its state, and its actuators hold still."""

    word: ClassVar[str] = "pause"


@dataclass(frozen=True, slots=True, kw_only=True)
class ResumeCommand(RunCommand):
    """Continue after `pause`; refused while a stop is latched."""

    word: ClassVar[str] = "resume"


@dataclass(frozen=True, slots=True, kw_only=True)
class StepCommand(RunCommand):
    """Tick once while paused."""

    word: ClassVar[str] = "step"


@dataclass(frozen=True, slots=True, kw_only=True)
class HaltCommand(RunCommand):
    """End the mission: its behaviours halt, the robot comes to rest, and the run ends."""

    word: ClassVar[str] = "halt"


@dataclass(frozen=True, slots=True, kw_only=True)
class InjectFaultCommand(RunCommand):
    """Inject a fault into a run in simulated time, in the words of test files: `camera frozen for 2 s`."""

    word: ClassVar[str] = "fault"
    what: Annotated[str, "The fault and its duration; permanent without a duration.", Bound(high=200)]


@dataclass(frozen=True, slots=True, kw_only=True)
class ListFaultsCommand(RunCommand):
    """Return `examples` of faults for `fault`; empty unless the run is in simulated time.

    `command` is then the command line for the same run in simulated time.
    """

    word: ClassVar[str] = "faults"
    role: ClassVar[Role] = "viewer"


@dataclass(frozen=True, slots=True, kw_only=True)
class ListTuningCommand(RunCommand):
    """Return the values of the robot that can be changed in the run: trims, speeds, limits of joints."""

    word: ClassVar[str] = "tuning"
    role: ClassVar[Role] = "viewer"


@dataclass(frozen=True, slots=True, kw_only=True)
class TuneCommand(RunCommand):
    """Change a value of `tuning` until the run ends, within its bounds; joints apply it from their next goal on."""

    word: ClassVar[str] = "tune"
    name: Annotated[str, "Name of the value, as in `tuning`: `head.pan.trim`.", Bound(high=200)]
    value: Annotated[float, "In SI units and radians.", Bound(-1e6, 1e6)]


@dataclass(frozen=True, slots=True, kw_only=True)
class TakeWheelsCommand(RunCommand):
    """Take control of the wheels; if another driver has it, request it from that driver."""

    word: ClassVar[str] = "take"


@dataclass(frozen=True, slots=True, kw_only=True)
class GiveWheelsCommand(RunCommand):
    """Give up control of the wheels, or withdraw the request. Control goes to the first client that requested it."""

    word: ClassVar[str] = "give"


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveCommand(RunCommand):
    """Drive for 0.3 s, but not longer than 0.5 s after the state of `stamp` was sent. Both inputs 0: stop.

    The client must have control of the wheels.
    """

    word: ClassVar[str] = "drive"
    n: CommandNumber
    stamp: StateStamp
    ahead: Annotated[float, "Share of the speed, positive forward.", SHARE_BOUND]
    left: Annotated[float, "Share of the turn rate, positive to the left.", SHARE_BOUND]
    pace: Annotated[float, "Share of the robot's limits for an input of 1.", Bound(0.05, 1.0)] = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class LookCommand(RunCommand):
    """Turn the head; refused while the mission moves it.

    As for `drive`, the client must have control of the wheels, and the state of `stamp` must be at most 0.5 s old.
    """

    word: ClassVar[str] = "look"
    n: CommandNumber
    stamp: StateStamp
    left: Annotated[float, "Share of the turn rate 60 deg/s, positive to the left.", SHARE_BOUND]
    down: Annotated[float, "Share of the turn rate 60 deg/s, positive down.", SHARE_BOUND]


# Commands that a run accepts, and how they are parsed.

RUN_COMMANDS: Mapping[str, type[ClientCommand]] = {
    kind.word: kind
    for kind in (
        WatchCommand,
        PictureShownCommand,
        StopCommand,
        ReleaseCommand,
        PauseCommand,
        ResumeCommand,
        StepCommand,
        HaltCommand,
        InjectFaultCommand,
        ListFaultsCommand,
        ListTuningCommand,
        TuneCommand,
        TakeWheelsCommand,
        GiveWheelsCommand,
        DriveCommand,
        LookCommand,
    )
}
"""Classes of the commands that a run executes, by the word that names each in a message, such as "stop"."""

MAX_REFUSED_BYTES = 2 * MAX_COMMAND_BYTES
"""Maximum bytes received of one message; a message above ``MAX_COMMAND_BYTES`` is refused in an answer with its id."""

MAX_ID_TOKENS = 4096
"""Maximum number of tokens searched for the id of a message that is not JSON."""

_MAX_ID = 2**53
# Possessive: backtracking through a long text would take minutes.
_TOKENS = re.compile(r'"(?:[^"\\]|\\.)*+(?:"|\\?\Z)|[\[{]+|[\]}]+', re.DOTALL)
_ID_VALUE = re.compile(r"\s*:\s*(-?\d{1,16})\s*(?:[,}]|$)")


def find_id(message: str | bytes) -> int | None:
    """Return the id of a refused command, even if it is malformed; None if it has none."""
    text = message if isinstance(message, str) else message.decode("utf-8", "replace")
    try:
        data = parse_json(text)
    except ValueError:
        found = _find_id_in_malformed(text)
    else:
        found = data.get("id") if isinstance(data, dict) else None
    return found if type(found) is int and abs(found) <= _MAX_ID else None


def _find_id_in_malformed(text: str) -> int | None:
    """Return the id among the members of the outermost object of a text that is not JSON."""
    depth, found = 0, None
    for token in islice(_TOKENS.finditer(text), MAX_ID_TOKENS):
        first = token[0][0]
        if first in "[{":
            depth += len(token[0])
        elif first in "]}":
            depth -= len(token[0])
        elif depth == 1 and token[0] == '"id"' and (value := _ID_VALUE.match(text, token.end())):
            found = int(value[1])
    return found


def read_command(line: str | bytes, *, commands: Mapping[str, type[ClientCommand]] = RUN_COMMANDS) -> ClientCommand:
    """Return the command in a message. Raises BadMessage with the error."""
    if len(line) > MAX_COMMAND_BYTES:
        raise BadMessage("too_large", f"a command has at most {MAX_COMMAND_BYTES} bytes, this one {len(line)}")
    try:
        data = parse(line, MAX_COMMAND_BYTES)
        if not isinstance(data, dict):
            raise CodecError('a command is an object, such as {"do": "stop", "id": 1}')
    except CodecError as error:
        raise BadMessage("no_json", str(error)) from error
    try:
        return decode_tagged(data, COMMAND_KEY, commands, CODEC_RULES)
    except UnknownTagError as error:
        raise BadMessage("unknown_command", str(error), error.hint) from error
    except CodecError as error:
        raise BadMessage("bad_field", str(error), error.hint) from error
