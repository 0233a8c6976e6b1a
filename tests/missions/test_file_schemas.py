"""The JSON Schemas of tests, robots and worlds: what ships and what the docs show is valid, and mistakes are seen."""

import re
from collections.abc import Callable, Mapping
from copy import deepcopy
from functools import cache
from pathlib import Path
from random import Random
from typing import Any

import jsonschema
import pytest
import yaml

from config.diagnostics import InvalidFileError, SourceText
from config.gesture import parse_gesture
from config.library import shipped_files
from config.world import parse_world
from config.yaml_nodes import compose, read_source
from missions.library.drivers import parse_robot
from missions.library.shipped import shipped_missions
from missions.plugins.schema.files import FILE_KINDS, file_schema
from missions.plugins.testing import suite
from tests.config.test_move_file import WHOLE as A_MOVE
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
    "moves": "move",
    "gaits": "gait",
}
EVERY = [*FILE_KINDS]
FILES = {
    "tests": [tests for path in shipped_missions().values() if (tests := suite.suite_file_of(path)).is_file()],
    "robots": list(shipped_files("robots").values()),
    **{
        kind: list(shipped_files(kind).values())
        for kind in ("worlds", "gestures", "controllers", "objects", "moves", "gaits")
    },
}


@cache
def validator(kind: str) -> Any:
    return jsonschema.Draft7Validator(file_schema(kind))


def complaints(kind: str, text: str) -> list[str]:
    data = plain(compose(SourceText(kind, text)))
    return [
        f"{'/'.join(map(str, error.absolute_path))}: {error.message}" for error in validator(kind).iter_errors(data)
    ]


@pytest.mark.parametrize("kind", EVERY)
def test_shipped_and_documented_files_match_their_schema_only(kind: str) -> None:
    jsonschema.Draft7Validator.check_schema(file_schema(kind))
    texts = {str(path): read_source(path).text for path in FILES[kind]}
    texts |= {"a move": A_MOVE} if kind == "moves" else {}
    for page in (*Path("docs").glob("*.md"), Path("README.md")):
        for number, block in enumerate(re.findall(r"```yaml\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)):
            if re.search(rf"^{KEY[kind]}:", block, re.MULTILINE):
                texts[f"{page} ({number})"] = block
    assert len(texts) > (0 if kind == "moves" else 2)
    wrong = {name: found for name, text in texts.items() if (found := complaints(kind, text))}
    assert not wrong
    marked = {name for name, text in texts.items() if not MISSIONS.is_valid(plain(compose(SourceText(name, text))))}
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
    "moves": ["move: m\njoints: {e: {column: e}}", "move: m\nsheet: s.csv\njoints: {e: {column: e, sgn: 1}}"],
    "gaits": ["gait: g\nwalk: {turn: 3 deg}", "gait: g\nwalk: {step: 3}", "gait: g\npoints: [{at: 10 %}]"],
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


def test_schema_command_writes_every_schema(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    for kind in EVERY:
        outcome = command(capsys, "schema", kind, "-o", str(tmp_path / f"{kind}.json"))
        assert (outcome.code, (tmp_path / f"{kind}.json").is_file()) == (0, True)
    assert command(capsys, "schema", "records").code == 2


READ: Mapping[str, Callable[[SourceText], object]] = {
    "worlds": parse_world,
    "robots": parse_robot,
    "gestures": parse_gesture,
}
STRUCTURE = re.compile(r"has no key|needs '|needs a (text|list|plain|whole)|must be a mapping|cannot be used")
"""Mistakes that a schema can say; it knows nothing of what words mean, nor of what is beside each other."""


def test_reader_and_schema_agree_on_damaged_files() -> None:
    apart, refused = [], 0
    for kind, read in READ.items():
        for seed in range(70):
            path, text = _damaged(FILES[kind], Random(f"{kind} {seed}"))  # noqa: S311 - chance, not a secret
            valid, messages = not complaints(kind, text), _mistakes(read, text)
            structure = [message for message in messages if STRUCTURE.search(message)]
            if (not valid and not messages) or (valid and structure):
                apart.append((path.name, seed, valid, messages))
            refused += bool(messages)
    assert not apart
    assert refused > 100


def _mistakes(read: Callable[[SourceText], object], text: str) -> list[str]:
    try:
        read(SourceText("damaged", text))
    except InvalidFileError as error:
        return [fault.message for fault in error.diagnostics]
    return []


def _damaged(paths: list[Path], random: Random) -> tuple[Path, str]:
    """Return a file in which one value lacks, is of another kind, or stands under another name."""
    path = random.choice(paths)
    data = deepcopy(plain(compose(read_source(path))))
    holder, key = random.choice(list(_places(data)))
    harm = random.choice(["lacks", "is misspelt", "is another"])
    if harm == "lacks":
        del holder[key]
    elif harm == "is misspelt" and isinstance(holder, dict):
        holder[f"{key}q"] = holder.pop(key)
    else:
        others = [None, 3, True, "nonsense words", "-3 m", [1, 2], {"x": 1}, [holder[key]]]
        holder[key] = random.choice(others)
    return path, yaml.safe_dump(data, sort_keys=False, allow_unicode=True)


def _places(node: Any) -> Any:
    """Yield every place in a file: what holds a value, and under what."""
    for key in node if isinstance(node, dict) else range(len(node)) if isinstance(node, list) else ():
        yield node, key
        yield from _places(node[key])
