"""Every command by its word, and how one is read."""

import json
from collections.abc import Mapping
from typing import Any

from config.faults import did_you_mean
from missions.studio.commands import (
    KEY,
    LARGEST,
    Command,
    Drive,
    Fault,
    Faulty,
    Give,
    Halt,
    Look,
    Pause,
    Release,
    Resume,
    Seen,
    Step,
    Stop,
    Take,
    Tune,
    Tuned,
    Watch,
)  # fmt: skip
from missions.studio.form import BadMessage, read, shown
from missions.studio.wishes import (
    AddPerson,
    AddTask,
    ApproveTask,
    CancelTask,
    Compare,
    Failsafe,
    Fleet,
    Hello,
    KeepTuning,
    Library,
    Mission,
    Moment,
    MoveTask,
    Record,
    Records,
    ReleaseFleet,
    Revoke,
    ShowPerson,
    Start,
    StopFleet,
    Tasks,
    World,
)  # fmt: skip

COMMANDS: Mapping[str, type[Command]] = {
    kind.word: kind
    for kind in (
        Hello, Library, Mission, World, Failsafe, Start, ShowPerson, AddPerson, KeepTuning, Revoke,
        Watch, Seen, Stop, Release, Pause, Resume, Step, Halt, Fault, Faulty, Tuned, Tune, Take, Give, Drive, Look,
        Records, Record, Moment, Compare,
        Tasks, AddTask, ApproveTask, MoveTask, CancelTask,
        Fleet, StopFleet, ReleaseFleet,
    )
}  # fmt: skip
"""Every command by its word."""


def read_command(line: str | bytes, *, words: Mapping[str, type[Command]] = COMMANDS) -> Command:
    """Return the command in a message. Raises BadMessage that names what is wrong with it."""
    if len(line) > LARGEST:
        raise BadMessage("too_large", f"a command has at most {LARGEST} bytes, this one {len(line)}")
    try:
        data: Any = json.loads(line)
    except (ValueError, RecursionError) as error:
        raise BadMessage("no_json", f"it is no JSON: {error}"[:200]) from error
    if not isinstance(data, dict):
        raise BadMessage("no_json", 'a command is an object, such as {"do": "stop", "id": 1}')
    word = data.get(KEY)
    if not isinstance(word, str) or word not in words:
        said = word[:60] if isinstance(word, str) else shown(word)
        raise BadMessage("unknown_command", f"unknown command {said!r}", did_you_mean(said, words))
    return read(data, words[word], KEY)
