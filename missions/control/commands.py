"""What a client may ask of a run, over the studio or over the run's own control socket.

A command is a JSON object ``{"do": word, "id": number, ...}``. It is answered with the same ``id``; one without an id
is answered only where something is wrong with it.
"""

import re
from collections.abc import Mapping
from itertools import islice
from typing import Annotated, ClassVar, Literal

from config.file_io import parse_json
from drivers.api.fast_dataclass import dataclass
from missions.codec import MAX_INTEGER, Bound, CodecError, Rules, UnknownTagError, decode_tagged, parse

COMMAND_KEY = "do"
"""The member that has the word of a command."""

MAX_COMMAND_BYTES = 64 * 1024
"""Bytes of a command, at most."""

CODEC_RULES = Rules(
    max_text=4096,
    max_members=256,
    max_number=MAX_INTEGER,
    is_text=lambda text: "\0" not in text and not any("\ud800" <= letter <= "\udfff" for letter in text),
    text="a text without NUL, and without halves of letters",
    omit_none=True,
)
"""How commands and messages are written and read: each text can be written to a file and stand on a command line."""

Role = Literal["viewer", "operator"]
"""Who may: a viewer sees, and stops; an operator does all."""

RunName = Annotated[str, "Which run, as `runs` names it.", Bound(high=64)]
CommandId = Annotated[int | None, "Comes back with the answer.", Bound(-(2**53), 2**53)]
CommandNumber = Annotated[
    int, "Counts the commands of this driver, upwards; at one not higher than the last the base stops.", Bound(0, 2**53)
]
StateStamp = Annotated[
    int,
    "The `stamp` of the newest `state` that the driver has seen; the base obeys for 0.5 s from that.",
    Bound(0, 2**53),
]
SHARE_BOUND = Bound(-1.0, 1.0)


class BadMessage(ValueError):
    """A message that is not a command, or that cannot be obeyed; ``error`` is its name in answers."""

    def __init__(self, error: str, message: str, hint: str = "") -> None:
        super().__init__(message)
        self.error, self.hint = error, hint

    def __reduce__(self) -> tuple[type["BadMessage"], tuple[str, str, str]]:
        return BadMessage, (self.error, str(self), self.hint)  # as it comes from another process


@dataclass(frozen=True, slots=True, kw_only=True)
class ClientCommand:
    """A command. ``role`` is the least that one must be to give it."""

    word: ClassVar[str] = ""
    role: ClassVar[Role] = "operator"
    id: CommandId = None


@dataclass(frozen=True, slots=True, kw_only=True)
class RunCommand(ClientCommand):
    """A command that a run answers."""

    run: RunName = ""
    by: Annotated[str, "Who asks: the studio puts in the client's name, whatever stands here.", Bound(high=60)] = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class WatchCommand(RunCommand):
    """Tell what happens in a run from now on, instead of what was watched of it before; nothing, to watch no more.

    The first message is a `scene` with all that is so far.
    """

    word: ClassVar[str] = "watch"
    role: ClassVar[Role] = "viewer"
    state: Annotated[bool, "Whether `state` comes."] = True
    events: Annotated[bool, "Whether `events` come: all of them, as `mission run --events` writes them."] = False
    pictures: Annotated[float, "So many `picture`s a second at most.", Bound(0.0, 30.0)] = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class PictureShownCommand(RunCommand):
    """The picture of this time has been shown: while two are on their way, no third one comes."""

    word: ClassVar[str] = "seen"
    role: ClassVar[Role] = "viewer"
    t: Annotated[float, "That of the picture."]


@dataclass(frozen=True, slots=True, kw_only=True)
class StopCommand(RunCommand):
    """Latch every actuator still and pause the mission, until `release`. Without a run, all runs of this machine."""

    word: ClassVar[str] = "stop"
    role: ClassVar[Role] = "viewer"
    press: Annotated[
        str, "Any text, another one at each press: sent again, or by two ways, it counts once.", Bound(high=60)
    ] = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class ReleaseCommand(RunCommand):
    """End a latched stop. The mission stays paused until `resume`."""

    word: ClassVar[str] = "release"
    stop: Annotated[int, "Which stop, as `state` counts them in `stops`: not one that nobody has seen."]


@dataclass(frozen=True, slots=True, kw_only=True)
class PauseCommand(RunCommand):
    """Tick no more; the mission keeps its place, and its actuators hold still."""

    word: ClassVar[str] = "pause"


@dataclass(frozen=True, slots=True, kw_only=True)
class ResumeCommand(RunCommand):
    """Go on after `pause`; not while a stop is latched."""

    word: ClassVar[str] = "resume"


@dataclass(frozen=True, slots=True, kw_only=True)
class StepCommand(RunCommand):
    """Tick once while paused."""

    word: ClassVar[str] = "step"


@dataclass(frozen=True, slots=True, kw_only=True)
class HaltCommand(RunCommand):
    """End the mission: its behaviours halt, the robot comes to rest, and the run is over."""

    word: ClassVar[str] = "halt"


@dataclass(frozen=True, slots=True, kw_only=True)
class InjectFaultCommand(RunCommand):
    """Let something go wrong with a run in simulated time, in the words of test files: `camera frozen for 2 s`."""

    word: ClassVar[str] = "fault"
    what: Annotated[str, "What goes wrong, and for how long; for good where nothing is said.", Bound(high=200)]


@dataclass(frozen=True, slots=True, kw_only=True)
class ListFaultsCommand(RunCommand):
    """Answer with `examples` of what can go wrong, in the words that `fault` takes; none but in simulated time.

    `command` is then what to type for the same run in simulated time.
    """

    word: ClassVar[str] = "faults"
    role: ClassVar[Role] = "viewer"


@dataclass(frozen=True, slots=True, kw_only=True)
class ListTuningCommand(RunCommand):
    """Answer with what of the robot may be changed while it runs, and how it is: trims, speeds, limits of joints."""

    word: ClassVar[str] = "tuning"
    role: ClassVar[Role] = "viewer"


@dataclass(frozen=True, slots=True, kw_only=True)
class TuneCommand(RunCommand):
    """Change one of these until the run ends, within what the robot file lets; joints obey from their next goal on."""

    word: ClassVar[str] = "tune"
    name: Annotated[str, "As `tuning` names it: `head.pan.trim`.", Bound(high=200)]
    value: Annotated[float, "In SI units and radians.", Bound(-1e6, 1e6)]


@dataclass(frozen=True, slots=True, kw_only=True)
class TakeWheelsCommand(RunCommand):
    """Take the wheels; where another driver has them, ask that one for them."""

    word: ClassVar[str] = "take"


@dataclass(frozen=True, slots=True, kw_only=True)
class GiveWheelsCommand(RunCommand):
    """Let go of the wheels, or ask for them no more. They go to who has asked for them first."""

    word: ClassVar[str] = "give"


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveCommand(RunCommand):
    """Drive for 0.3 s, at most until 0.5 s after the state of its `stamp`, with the wheels. Both 0: stand still."""

    word: ClassVar[str] = "drive"
    n: CommandNumber
    stamp: StateStamp
    ahead: Annotated[float, "The share of the speed, positive ahead.", SHARE_BOUND]
    left: Annotated[float, "The share of the turn rate, positive to the left.", SHARE_BOUND]
    pace: Annotated[float, "The share of the robot's limits that a share of 1 is.", Bound(0.05, 1.0)] = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class LookCommand(RunCommand):
    """Turn the head on, if one has the wheels, the state is as young as for `drive`, and the mission moves no head."""

    word: ClassVar[str] = "look"
    n: CommandNumber
    stamp: StateStamp
    left: Annotated[float, "The share of 60 deg/s by which the head turns, positive to the left.", SHARE_BOUND]
    down: Annotated[float, "The same downwards.", SHARE_BOUND]


# The commands that a run answers, and how a command is read.

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
"""Every command that a run answers, by its word."""

MAX_REFUSED_BYTES = 2 * MAX_COMMAND_BYTES
"""Bytes of a message that is received at most: one longer than ``MAX_COMMAND_BYTES`` is refused, by its id if it has one."""

MAX_ID_TOKENS = 4096
"""Brackets and texts of a message that is not JSON among which its id is looked for."""

_MAX_ID = 2**53
# A text always matches to its end, and is never tried again from a shorter one: else a long one takes minutes.
_TOKENS = re.compile(r'"(?:[^"\\]|\\.)*+(?:"|\\?\Z)|[\[{]+|[\]}]+', re.DOTALL)
_ID_VALUE = re.compile(r"\s*:\s*(-?\d{1,16})\s*(?:[,}]|$)")


def find_id(message: str | bytes) -> int | None:
    """Return the id of a command that is refused, however malformed it is otherwise; None where it has none."""
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
    """Return the command in a message. Raises BadMessage that names what is wrong with it."""
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
