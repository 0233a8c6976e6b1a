"""The JSON Schemas of tests, robots and worlds: what ships and what the docs show is valid, and mistakes are seen."""

import re
from functools import cache
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from config.faults import Source
from config.library import shipped
from config.marked import compose, read_source
from missions.library import shipped_missions
from missions.schema.files import DECLARED, KINDS, file_schema
from missions.testing.suite import beside
from tests.missions.command import command
from tests.missions.test_schema import VALIDATOR as MISSIONS
from tests.missions.test_schema import plain

KEY = {
    "tests": "tests",
    "robots": "robot",
    "worlds": "world",
    "gestures": "gesture",
    "controllers": "controller",
    "objects": "object",
}
EVERY = [*KINDS, *DECLARED]
FILES = {
    "tests": [tests for path in shipped_missions().values() if (tests := beside(path)).is_file()],
    "robots": list(shipped("robots").values()),
    **{kind: list(shipped(kind).values()) for kind in ("worlds", "gestures", "controllers", "objects")},
}


@cache
def validator(kind: str) -> Any:
    return jsonschema.Draft7Validator(file_schema(kind))


def complaints(kind: str, text: str) -> list[str]:
    data = plain(compose(Source(kind, text)))
    return [
        f"{'/'.join(map(str, error.absolute_path))}: {error.message}" for error in validator(kind).iter_errors(data)
    ]


@pytest.mark.parametrize("kind", EVERY)
def test_what_ships_and_what_the_docs_show_is_valid_and_no_mission(kind: str) -> None:
    jsonschema.Draft7Validator.check_schema(file_schema(kind))
    texts = {str(path): read_source(path).text for path in FILES[kind]}
    for page in (*Path("docs").glob("*.md"), Path("README.md")):
        for number, block in enumerate(re.findall(r"```yaml\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)):
            if re.search(rf"^{KEY[kind]}:", block, re.MULTILINE):
                texts[f"{page} ({number})"] = block
    assert len(texts) > 2
    wrong = {name: found for name, text in texts.items() if (found := complaints(kind, text))}
    assert not wrong
    marked = {name for name, text in texts.items() if not MISSIONS.is_valid(plain(compose(Source(name, text))))}
    assert not marked, "an editor that takes all *.yaml for missions marks them wrong"


BROKEN = {
    "tests": [
        "cases: []",
        "tests: m\ncases: []\nextra: 1",
        "tests: m\ncases: [{case: a, expect: {result: good}}]",
        "tests: m\ncases: [{case: a, expect: {within: 3}}]",
        "tests: m\ncases: [{case: a, expect: {said: hi, sad: hi}}]",
        "tests: m\ncases: [{case: a, seed: -1, expect: {}}]",
        "tests: m\nwith: {eyes: shut}\ncases: []",
    ],
    "robots": [
        "base: {driver: kobuki, port: /dev/kobuki}",
        "robot: r\nbase: {driver: kobuki}",
        "robot: r\nbase: {driver: kobuki, port: p, baudrate: 9600}",
        "robot: r\nbase: {driver: kobuki, port: p, max_speed: 3}",
        "robot: r\nbase: {driver: kobuki, port: p, max_speed: 3 deg}",
        "robot: r\nbase: {driver: roomba, port: p}",
        "robot: r\nbase: {driver: kobuki, port: p, reflexes: {bumper: ignore}}",
        "robot: r\narm: {driver: dynamixel, port: p, joints: {elbow: {limits: [0 deg, 9 deg]}}}",
        "robot: r\narm: {driver: dynamixel, port: p, joints: {elbow: {id: 1, limits: [9]}}}",
        "robot: r\ncamera: {width: wide}",
        "robot: r\nlidar: {}",
    ],
    "worlds": [
        "room: {length: 4 m}",
        "world: w\nroom: {length: 4}",
        "world: w\npeople: [{name: Anna}]",
        "world: w\npeople: [{name: Anna, at: [1 m, 1 m], mood: sad}]",
        "world: w\nphysics: {slip: 0.5}",
        "world: w\nlight: [{at: 1 s}]",
        "world: w\nobjects: [{name: o, shape: cone, at: [1 m, 0 m]}]",
    ],
    "gestures": [
        "keyframes: [{at: 1 s, elbow: 3 deg}]",
        "gesture: g\nkeyframes: []",
        "gesture: g\nkeyframes: [{elbow: 3 deg}]",
        "gesture: g\nkeyframes: [{at: 1 s, elbow: 3}]",
        "gesture: g\nspeed: 3\nkeyframes: [{at: 1 s}]",
    ],
    "controllers": ["summary: s", "controller: c\nsummary: [s]"],
    "objects": [
        "object: o",
        "object: o\ncolour: brown",
        "object: o\ncolour: red\nsize: 3",
        "object: o\ncolour: red\nweight: 3",
    ],
}


def test_mistakes_are_seen() -> None:
    assert not [(kind, text) for kind, texts in BROKEN.items() for text in texts if not complaints(kind, text)]


def test_the_command_writes_each_of_them(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    for kind in EVERY:
        outcome = command(capsys, "schema", kind, "-o", str(tmp_path / f"{kind}.json"))
        assert (outcome.code, (tmp_path / f"{kind}.json").is_file()) == (0, True)
    assert command(capsys, "schema", "moves").code == 2


def test_every_key_that_readers_name_is_in_a_schema() -> None:
    """An example in missions/schema that lacks a part would leave out its keys."""
    known = {name for kind in ("robots", "worlds") for name in _names(file_schema(kind))}
    files = "arm base camera head identity lens microphone notices people range robot screen things voice world"
    paths = [path for part in files.split() if (path := Path("config") / f"{part}.py").is_file()]
    read = "\n".join(path.read_text(encoding="utf-8") for path in paths)
    getters = "text|choice|flag|number|integer|quantity|span|position|section|items|node_of"
    named = set(re.findall(rf'(?:fields|section|world)\.(?:{getters})\(\s*"(\w+)"', read))
    assert named - known == set()


def _names(schema: object) -> set[str]:
    if isinstance(schema, list):
        return set().union(*map(_names, schema)) if schema else set()
    if not isinstance(schema, dict):
        return set()
    own = set(schema["properties"]) if isinstance(schema.get("properties"), dict) else set()
    return own.union(*map(_names, schema.values()))
