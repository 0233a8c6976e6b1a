"""World files: the room and who is in it."""

import math
from pathlib import Path

import pytest

from config.diagnostics import Diagnostic, InvalidFileError
from config.world import WorldConfig, load_world


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "world.yaml"


def load(file: Path, text: str) -> WorldConfig:
    file.write_text(text, encoding="utf-8")
    return load_world(file)


def mistakes(file: Path, text: str) -> list[Diagnostic]:
    with pytest.raises(InvalidFileError) as caught:
        load(file, text)
    return list(caught.value.diagnostics)


def test_a_world_is_read_in_si_units(file: Path) -> None:
    world = load(
        file,
        "world: hall\nlight: 50 %\nnoise: 0\nroom: {length: 900 cm, centre: [2 m, 1 m]}\npeople:\n"
        "  - {name: Ben, at: [1.5 m, -20 cm], facing: 90 deg,\n"
        "     walk: [[1 m, 0 m], [2 m, 0 m]], after: 2 s, loop: false}\n"
        "  - {name: Anna, at: [2 m, 0 m], facing: camera}\n",
    )
    assert (world.name, world.length, world.width, world.centre) == ("hall", 9.0, 6.0, (2.0, 1.0))
    assert (world.light, world.noise) == (0.5, 0.0)
    ben, anna = world.people
    assert (ben.name, ben.x, ben.y, ben.path) == ("Ben", 1.5, -0.2, ((1.0, 0.0), (2.0, 0.0)))
    assert ben.facing == pytest.approx(math.pi / 2)
    assert (ben.start, ben.loop) == (2.0, False)
    assert (anna.facing, anna.path, anna.loop) == ("camera", (), True)


def test_a_world_needs_no_more_than_a_name(file: Path) -> None:
    world = load(file, "world: nowhere\n")
    assert (world.people, world.light, world.length) == ((), 1.0, 8.0)


def test_all_faults_are_reported_together_with_positions(file: Path) -> None:
    faults = mistakes(
        file,
        "world: hall\n"
        "light: 300 %\n"
        "room: {length: 1 m, centre: 2 m, heigth: 3 m}\n"
        "noise: 5 %\n"
        "people:\n"
        "  - {at: [1 m], facing: camra}\n"
        "  - Anna\n"
        "  - {name: Ben, at: [1 m, 2 m], walk: [1 m, 2 m]}\n",
    )
    assert [(fault.mark.line, fault.mark.column, fault.message) for fault in faults] == [
        (2, 8, "'light' must be at most 200 %"),
        (3, 16, "'length' must be at least 2 m"),
        (3, 29, "'centre' needs a place, such as [1.5 m, 0.2 m]"),
        (3, 34, "'room' has no key 'heigth'"),
        (4, 8, "'noise' needs a plain number"),
        (6, 5, "a person needs 'name'"),
        (6, 10, "'at' needs a place, such as [1.5 m, 0.2 m]"),
        (6, 25, "'facing' needs an angle such as '30 deg', got 'camra'"),
        (7, 5, "a person must be a mapping of keys to values, such as 'name: value'"),
        (8, 40, "'walk' needs a place, such as [1.5 m, 0.2 m]"),
        (8, 45, "'walk' needs a place, such as [1.5 m, 0.2 m]"),
    ]


def test_people_must_be_a_list(file: Path) -> None:
    (fault,) = mistakes(file, "world: hall\npeople: {name: Anna}\n")
    assert fault.message == "'people' needs a list"
