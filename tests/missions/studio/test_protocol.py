"""The studio's messages: what is said of them, what is read of them, and what is refused by name."""

import json
from typing import Any

import jsonschema
import pytest

from missions.codec import encode_tagged, message_fields
from missions.control.commands import CODEC_RULES, MAX_COMMAND_BYTES, BadMessage, DriveCommand, find_id, read_command
from missions.control.messages import ERRORS, MESSAGES, AnswerMessage, RunOverMessage, encode_message
from missions.plugins.studio.studio_commands import COMMANDS, StartRun, protocol_schema
from tests.cases import each

SCHEMA: Any = protocol_schema()

WRONG_STAMPS = ("null", "true", '"5"', "5.0", "1e9", "NaN", "Infinity", "-1", str(2**53 + 1), "[5]", "{}")
"""What is no whole number, or no stamp that can be drawn."""


def test_the_schema_is_one() -> None:
    jsonschema.Draft202012Validator.check_schema(SCHEMA)


@each(
    "message",
    [AnswerMessage(id=3, ok=True, result={"run": "1"}), RunOverMessage(run="1", result="", reason="", seconds=2.0)],
)
def test_messages_match_the_schema(message: object) -> None:
    jsonschema.validate(json.loads(encode_message(message)), SCHEMA)


def test_command_is_decoded_with_defaults() -> None:
    line = '{"do": "drive", "run": "7", "n": 1, "stamp": 5, "ahead": 1, "left": -0.5}'
    assert read_command(line) == DriveCommand(run="7", n=1, stamp=5, ahead=1, left=-0.5, pace=0.5)
    jsonschema.validate(json.loads(line), SCHEMA)


def test_command_round_trips() -> None:
    start = StartRun(id=4, mission="greet", params={"patience": "5 s"}, sure=True)
    assert read_command(json.dumps(encode_tagged(start, "do", CODEC_RULES)), commands=COMMANDS) == start


@each(
    ("line", "error", "said"),
    [
        ("{", "no_json", "no JSON"),
        ("[" * 20_000, "no_json", "no JSON"),
        ("[1]", "no_json", "an object"),
        ('{"do": "stop", "do": "release", "stop": 1}', "no_json", "'do' is a duplicate member"),
        ('{"do": "stop", "run": "1", "run": "2"}', "no_json", "'run' is a duplicate member"),
        ('{"do": "stpo"}', "unknown_command", "'stpo'"),
        ('{"do": 5}', "unknown_command", "'5'"),
        ('{"do": "watch", "runn": "1"}', "bad_field", "'runn'"),
        ('{"do": "release", "run": "1"}', "bad_field", "'stop' is missing"),
        ('{"do": "release", "run": "1", "stop": true}', "bad_field", "whole number"),
        ('{"do": "release", "run": "1", "stop": 1.5}', "bad_field", "whole number"),
        ('{"do": "drive", "run": "1", "n": 1, "stamp": 0, "ahead": 1.1, "left": 0}', "bad_field", "within -1 and 1"),
        ('{"do": "drive", "run": "1", "n": 1, "stamp": 0, "ahead": NaN, "left": 0}', "bad_field", "a number"),
        ('{"do": "drive", "run": "1", "n": -1, "stamp": 0, "ahead": 0, "left": 0}', "bad_field", "within 0"),
        *(
            (f'{{"do": "{word}", "n": 1, {stamp}"{ahead}": 1, "left": 0}}', "bad_field", "'stamp'")
            for word, ahead in (("drive", "ahead"), ("look", "down"))
            for stamp in ("", *(f'"stamp": {wrong}, ' for wrong in WRONG_STAMPS))
        ),
        ('{"do": "start", "mission": "greet", "simulate": "slow"}', "bad_field", "one of"),
        ('{"do": "start", "mission": "greet", "params": {"a": 5}}', "bad_field", "'params.a'"),
        ('{"do": "start", "mission": 7}', "bad_field", "a text"),
        ('{"do": "start", "mission": "a\\u0000"}', "bad_field", "without NUL"),
        ('{"do": "start", "mission": "a", "params": {"\\ud800": "b"}}', "bad_field", "surrogates"),
        (f'{{"do": "stop", "id": 1{"0" * 400}}}', "bad_field", "whole number"),
        (f'{{"do": "release", "run": "1", "stop": -1{"0" * 400}}}', "bad_field", "whole number"),
        (json.dumps({"do": "hello", "version": "x" * MAX_COMMAND_BYTES}), "too_large", "65536 bytes"),
    ],
)
def test_invalid_command_is_refused_by_error_name(line: str, error: str, said: str) -> None:
    with pytest.raises(BadMessage, match=said.replace("[", r"\[")) as refused:
        read_command(line, commands=COMMANDS)
    assert refused.value.error == error
    assert error in ERRORS


@each("line", ['{"do": "stop", "id": %s}', '{"do": "start", "mission": "x", "params": {"a": %s}}'])
def test_deeply_nested_command_is_refused(line: str) -> None:
    for depth in range(850, 1050):
        with pytest.raises(BadMessage):
            read_command(line % ('{"a": ' * depth + "1" + "}" * depth), commands=COMMANDS)


@each(
    ("message", "number"),
    [
        ('{"do": "stpo", "id": 7}', 7),
        ('{"id": -7, "do": 5}', -7),
        ('{"do": "drive", "n": NaN, "id": 7}', 7),
        ('{"do": "stop", "id": 7', 7),
        ('{"do": "stop", "id": 7,}', 7),
        ('{"do": "stop", "id": 7, "run": "1', 7),
        ("{'do': 'stop', \"id\": 7}", 7),
        ('{"do": "stop" "id": 7}', 7),
        ('{"run": ' + "[" * 30_000 + "]" * 30_000 + ', "id": 7}', 7),
        ('{"id": 7, "run": ' + '{"a": ' * 2000, 7),
        (b'{"id": 7, "run": "\xff"', 7),
        ('{"run": "\\"id\\": 8", "id": 7,,}', 7),
        ('{"params": {"id": 8}, "id": 7,,}', 7),
        ('{"params": {"id": 8},,}', None),
        ('[{"id": 7}]', None),
        ('{"id": "7"}', None),
        ('{"id": 7.5,,}', None),
        ('{"id": true}', None),
        ('{"id": null}', None),
        (f'{{"id": 1{"0" * 400}}}', None),
        (f'{{"id": {2**53 + 1}}}', None),
        ("", None),
        ("7", None),
        ("null", None),
        ('"id": 7', None),
        ('{"' + '\\"' * 60_000 + "\\", None),  # took minutes where each text was tried from every quote
        ('{"id": 7,,' + '"' * 100_001, 7),
    ],
)
def test_the_id_of_a_malformed_command_is_found(message: str | bytes, number: int | None) -> None:
    assert find_id(message) == number


def test_near_miss_of_a_command_gives_a_suggestion() -> None:
    with pytest.raises(BadMessage) as refused:
        read_command('{"do": "stopp"}')
    assert refused.value.hint == "did you mean 'stop'?"


@each("kind", [*COMMANDS.values(), *MESSAGES.values()])
def test_every_member_has_a_type_in_the_schema(kind: Any) -> None:
    assert kind.__doc__
    side = "commands" if kind.word in COMMANDS else "messages"
    properties = SCHEMA["$defs"][side][kind.word]["properties"]
    for member in message_fields(kind):
        assert properties[member.name].keys() & {"type", "enum"}, member.name


def test_viewers_stop_and_look_and_do_nothing_else() -> None:
    assert {word for word, kind in COMMANDS.items() if kind.role == "viewer"} == {
        "hello", "library", "mission", "world", "watch", "seen", "stop", "records", "record", "moment", "tasks",
        "faults", "tuning", "fleet", "stop_fleet", "failsafe", "compare",
    }  # fmt: skip
