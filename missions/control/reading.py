"""The commands that a run answers, and how a command is read."""

import re
from collections.abc import Mapping
from itertools import islice

from config.reading import parse_json
from missions.codec import CodecError, UnknownWordError, decode_word, parse
from missions.control.commands import (  # fmt: skip
    KEY,
    LARGEST,
    RULES,
    BadMessage,
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
)

RUN_COMMANDS: Mapping[str, type[Command]] = {
    kind.word: kind
    for kind in (
        Watch,
        Seen,
        Stop,
        Release,
        Pause,
        Resume,
        Step,
        Halt,
        Fault,
        Faulty,
        Tuned,
        Tune,
        Take,
        Give,
        Drive,
        Look,
    )
}
"""Every command that a run answers, by its word."""

MAX_REFUSED_BYTES = 2 * LARGEST
"""Bytes of a message that is received at most: one longer than ``LARGEST`` is refused, by its id if it has one."""

MAX_ID_TOKENS = 4096
"""Brackets and texts of a message that is not JSON among which its id is looked for."""

_MAX_ID = 2**53
# A text always matches to its end, and is never tried again from a shorter one: else a long one takes minutes.
_TOKENS = re.compile(r'"(?:[^"\\]|\\.)*+(?:"|\\?\Z)|[\[{]+|[\]}]+', re.DOTALL)
_ID_VALUE = re.compile(r"\s*:\s*(-?\d{1,16})\s*(?:[,}]|$)")


def id_in(message: str | bytes) -> int | None:
    """Return the id of a command that is refused, however malformed it is otherwise; None where it has none."""
    text = message if isinstance(message, str) else message.decode("utf-8", "replace")
    try:
        data = parse_json(text)
    except ValueError:
        found = _id_in_malformed(text)
    else:
        found = data.get("id") if isinstance(data, dict) else None
    return found if type(found) is int and abs(found) <= _MAX_ID else None


def _id_in_malformed(text: str) -> int | None:
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


def read_command(line: str | bytes, *, words: Mapping[str, type[Command]] = RUN_COMMANDS) -> Command:
    """Return the command in a message. Raises BadMessage that names what is wrong with it."""
    if len(line) > LARGEST:
        raise BadMessage("too_large", f"a command has at most {LARGEST} bytes, this one {len(line)}")
    try:
        data = parse(line, LARGEST)
        if not isinstance(data, dict):
            raise CodecError('a command is an object, such as {"do": "stop", "id": 1}')
    except CodecError as error:
        raise BadMessage("no_json", str(error)) from error
    try:
        return decode_word(data, KEY, words, RULES)
    except UnknownWordError as error:
        raise BadMessage("unknown_command", str(error), error.hint) from error
    except CodecError as error:
        raise BadMessage("bad_field", str(error), error.hint) from error
