"""What stands in a world file, who is there, and every way in which it can be wrong, at the word that is wrong."""

from dataclasses import astuple
from math import pi
from pathlib import Path

import pytest

from config.diagnostics import Diagnostic, InvalidFileError
from config.library import shipped_files
from config.world import BatteryConfig, LightConfig, StartConfig, WorldConfig, load_world
from config.world_items import ActConfig, BoxConfig, DockConfig, EdgeConfig, ThingConfig, WallConfig


def load(folder: Path, text: str) -> WorldConfig:
    file = folder / "world.yaml"
    file.write_text(f"world: hall\n{text}", encoding="utf-8")
    return load_world(file)


def mistake(folder: Path, text: str) -> Diagnostic:
    with pytest.raises(InvalidFileError) as caught:
        load(folder, text)
    (fault,) = caught.value.diagnostics
    return fault


def test_a_full_world_is_read_in_si_units(tmp_path: Path) -> None:
    world = load(
        tmp_path,
        "room: {length: 8 m, width: 6 m, height: 300 cm, centre: [1 m, 0 m]}\n"
        "start: {at: [-1 m, 50 cm], heading: 2 rad}\n"
        "light: [{at: 0 s, light: 100 %}, {at: 10 s, light: 50 %, over: 2 s}]\n"
        "walls: [{from: [2 m, -1 m], to: [2 m, 1 m]}, {from: [2 m, 1 m], to: [3 m, 1 m], height: 2.2 m}]\n"
        "furniture: [{name: table, at: [1 m, 1 m], size: [1.2 m, 0.8 m, 75 cm], heading: 3 rad}]\n"
        "edges: [{at: [3 m, 0 m], size: [1 m, 2 m]}]\n"
        "objects:\n"
        "  - {name: ball, shape: ball, colour: yellow, at: [1 m, 1 m, 75 cm], size: 0.2 m}\n"
        "  - {name: crate, shape: box, colour: red, at: [2 m, 2 m], size: [0.3 m, 0.3 m, 0.3 m]}\n"
        "robots: [{name: R2, marker: 7, at: [2.5 m, -2 m], heading: 3 rad}]\n"
        "physics: {slip: 3 %, lag: 100 ms, gyro_noise: 45 deg/s, dropouts: 2 %, mishearing: 5 %}\n"
        "camera: {noise: 5}\n",
    )
    assert world.height == 3.0
    assert world.start == StartConfig(at=(-1.0, 0.5), heading=2.0)
    assert world.light_changes == (LightConfig(at=0.0, light=1.0), LightConfig(at=10.0, light=0.5, over=2.0))
    assert world.walls == (
        WallConfig(start=(2.0, -1.0), end=(2.0, 1.0)),
        WallConfig(start=(2.0, 1.0), end=(3.0, 1.0), height=2.2),
    )
    assert world.furniture == (BoxConfig(name="table", at=(1.0, 1.0), size=(1.2, 0.8, 0.75), heading=3.0),)
    assert world.edges == (EdgeConfig(at=(3.0, 0.0), size=(1.0, 2.0)),)
    assert world.objects == (
        ThingConfig(name="ball", shape="ball", at=(1.0, 1.0, 0.75), size=0.2, colour="yellow"),
        ThingConfig(name="crate", shape="box", at=(2.0, 2.0), size=(0.3, 0.3, 0.3), colour="red"),
    )
    (robot,) = world.robots
    assert (robot.name, robot.marker, robot.x, robot.heading) == ("R2", 7, 2.5, 3.0)
    assert astuple(world.physics)[:6] == (*(pytest.approx(value) for value in (0.03, 0.1, pi / 4, 0.02)), None, 0.05)
    assert (world.noise, world.dropouts) == pytest.approx((5.0, 0.02))


def test_actions_of_people_are_read(tmp_path: Path) -> None:
    (anna,) = load(
        tmp_path,
        "people:\n"
        "  - name: Anna\n"
        "    at: [2 m, 0 m]\n"
        "    facing: away\n"
        "    hears_within: 2 m\n"
        "    acts:\n"
        "      - {at: 5 s, turn: away}\n"
        "      - {at: 6 s, turn: 1 rad}\n"
        '      - {hears: hello, say: "Hello, robot!", nod: true}\n'
        "      - {hears: anything, after: 2 s, times: 2, leave: true}\n",
    ).people
    assert anna.facing == "away"
    assert anna.acts == (
        ActConfig(at=5.0, turn="away"),
        ActConfig(at=6.0, turn=1.0),
        ActConfig(phrase="hello", say="Hello, robot!", nod=True),
        ActConfig(phrase="anything", delay=2.0, leave=True, often=2),
    )
    assert [(act.hears, act.after, act.times) for act in anna.acts[1:]] == [
        (None, 0.6, 0), ("hello", 0.6, 0), ("", 2.0, 2),
    ]  # fmt: skip
    assert anna.hears_within == 2.0


FLOOR = "size: [1 m, 1 m, 1 m]"
WRONG = [
    ("start: {at: [4.95 m, 0 m]}", "[4", "there is no room for the robot at [4.95 m, 0 m]"),
    ("room: {length: 4 m, centre: [9 m, 0 m]}", "{length", "the room is x 7 m to 11 m, y -3 m to 3 m"),
    ("people: [{name: Anna, at: [9 m, 0 m]}]", "[9", "Anna is outside the room at [9 m, 0 m]"),
    ("people: [{name: Anna, at: [2 m, 0 m], walk: [[2 m, 4 m]]}]", "[2 m, 4", "Anna is outside the room"),
    ("people: [{name: Anna, at: [0.3 m, 0 m]}]", "[0.3", "Anna is where the robot starts, at [0 m, 0 m]"),
    ("people: [{name: Anna, look: ana, at: [2 m, 0 m]}]", "ana,", "did you mean 'anna'?"),
    ("people: [{name: Anna, at: [2 m, 0 m], facing: camra}]", "camra", "'facing' needs an angle"),
    ("walls: [{from: [2 m, -9 m], to: [2 m, 1 m]}]", "{from", "the wall is outside the room at [2 m, -9 m]"),
    ("walls: [{from: [2 m, 1 m], to: [2 m, 1 m]}]", "{from", "the wall is only 0 m long: at least 0.1 m are needed"),
    ("walls: [{from: [0.1 m, -1 m], to: [0.1 m, 1 m]}]", "{from", "the wall is where the robot starts"),
    ("walls: [{from: [2 m, 1 m], to: [2 m, 2 m], height: 9 m}]", "9 m", "'height' must be at most 2.6 m"),
    (f"furniture: [{{name: bed, at: [4.8 m, 0 m], {FLOOR}}}]", "bed", "'bed' is outside the room at [5.3 m"),
    ("furniture: [{name: bed, at: [2 m, 0 m], size: [2 m, 1 m]}]", "[2 m, 1", "'size' needs three lengths"),
    ("furniture: [{name: bed, at: [2 m, 0 m], size: [1 m, 1 m, 3 m]}]", "bed", "the room is 2.6 m high"),
    ("furniture: [{name: bed, at: [2 m, 0 m], size: [1 m, 1 m, 0 mm]}]", "0 mm", "must be at least 0.01 m"),
    (f"furniture: [{{name: bed, at: [0 m, 0 m], {FLOOR}}}]", "bed", "'bed' is where the robot starts"),
    ("edges: [{at: [0.5 m, 0 m], size: [1 m, 1 m]}]", "{at", "give 'start' another place"),
    ("edges: [{at: [2 m, 0 m], size: 1 m}]", "1 m}", "'size' needs a length and a width"),
    (f"objects: [{{name: b, shape: box, colour: red, at: [2 m, 0 m, -1 m], {FLOOR}}}]", "-1", "at least 0 m"),
    (f"objects: [{{name: b, shape: box, colour: red, at: [2 m], {FLOOR}}}]", "[2 m]", "'at' needs a place"),
    (f"objects: [{{name: b, shape: cone, colour: red, at: [2 m, 0 m], {FLOOR}}}]", "cone", "known are: ball, box"),
    ("objects: [{name: b, shape: cone, colour: red, at: [2 m, 0 m], size: 1 m}]", "cone", "known are: ball, box"),
    ("objects: [{name: b, shape: ball, colour: rad, at: [2 m, 0 m], size: 1 m}]", "rad", "did you mean 'red'?"),
    ("robots: [{name: R2, marker: 50, at: [2 m, 0 m]}]", "50", "'marker' must be at most 49"),
    ("robots: [{name: R2, marker: 5, at: [2 m, 0 m], size: [0.1 m, 1 m, 1 m]}]", "[0.1", "room for its marker"),
    ("light: [{at: 5 s, light: 50 %}, {at: 1 s, light: 1 %}]", "1 s", "must be in the order of time"),
    ("light: 300 %", "300", "'light' must be at most 200 %"),
    ("noise: 3\ncamera: {noise: 4}", "4}", "'noise' is given twice"),
    ("camera: {noise: 4, dropout: 5 %}", "dropout", "did you mean 'dropouts'?"),
    ("physics: {slip: 3}", "3}", "'slip' needs a share such as '20 %'"),
    ("room: {height: 1 m}", "1 m", "'height' must be at least 2.2 m"),
]


@pytest.mark.parametrize(("text", "word", "said"), WRONG, ids=[said for _, _, said in WRONG])
def test_world_fault_is_reported_with_position(tmp_path: Path, text: str, word: str, said: str) -> None:
    fault = mistake(tmp_path, text)
    assert fault.mark.line == 2 + text.count("\n")
    assert fault.mark.column == text.splitlines()[-1].index(word) + 1
    assert said in str(fault)


@pytest.mark.parametrize(
    ("act", "message"),
    [
        ("{turn: away}", "an act needs either 'at' or 'hears'"),
        ("{at: 1 s, hears: hello, nod: true}", "an act needs either 'at' or 'hears'"),
        ("{hear: hello, nod: true}", "an act has no key 'hear'"),
        ("{at: 1 s}", "the act does nothing"),
        ("{at: 1 s, after: 2 s, nod: true}", "'after' needs 'hears'"),
        ("{at: 1 s, times: 2, nod: true}", "'times' needs 'hears'"),
        ("{hears: hello, times: 0, nod: true}", "'times' must be at least 1"),
        ("{at: 1 s, nods: true, nod: true}", "an act has no key 'nods'"),
        ("{hears: [], nod: true}", "'hears' needs a text"),
        ("{at: 1 s, turn: sideways}", "'turn' needs an angle"),
    ],
)
def test_incomplete_act_is_reported(tmp_path: Path, act: str, message: str) -> None:
    fault = mistake(tmp_path, f"people:\n  - {{name: Anna, at: [2 m, 0 m], acts: [{act}]}}\n")
    assert fault.mark.line == 3
    assert message in fault.message


def test_person_inside_furniture_is_reported(tmp_path: Path) -> None:
    table = "furniture: [{name: table, at: [2 m, 0 m], size: [1 m, 1 m, 0.7 m], heading: 45 deg}]\n"
    fault = mistake(tmp_path, f"{table}people: [{{name: Anna, at: [2 m, 0.6 m]}}]\n")
    assert fault.message == "Anna cannot be at [2 m, 0.6 m]: 'table' is there"
    fault = mistake(tmp_path, f"{table}people: [{{name: Anna, at: [3 m, 2 m], walk: [[2.1 m, 0 m]]}}]\n")
    assert (fault.mark.line, fault.mark.column) == (3, 46)
    load(tmp_path, f"{table}people: [{{name: Anna, at: [2.6 m, 0.6 m]}}]\n")


def test_raised_object_may_be_above_the_robot(tmp_path: Path) -> None:
    world = load(tmp_path, f"objects: [{{name: b, shape: box, colour: red, at: [0 m, 0 m, 1.5 m], {FLOOR}}}]\n")
    assert [thing.bottom for thing in world.objects] == [1.5]


def test_duplicate_name_is_reported_at_the_second(tmp_path: Path) -> None:
    people = "people:\n  - {name: Eve, at: [2 m, 0 m]}\n  - {name: Eve, at: [3 m, 0 m]}\n"
    fault = mistake(tmp_path, people)
    assert (fault.mark.line, fault.mark.column) == (4, 12)
    assert fault.message == "'Eve' is a duplicate name in 'people'"


def test_invalid_room_does_not_invalidate_its_contents(tmp_path: Path) -> None:
    fault = mistake(tmp_path, "room: {length: 1 m}\npeople: [{name: Anna, at: [4 m, 0 m]}]\n")
    assert fault.message == "'length' must be at least 2 m"


def test_camera_dropouts_default_to_the_physics_dropouts(tmp_path: Path) -> None:
    both = load(tmp_path, "physics: {dropouts: 4 %}\n")
    apart = load(tmp_path, "physics: {dropouts: 4 %}\ncamera: {dropouts: 1 %}\nnoise: 7\n")
    assert (both.physics.dropouts, both.dropouts, both.noise) == pytest.approx((0.04, 0.04, 3.0))
    assert (apart.physics.dropouts, apart.dropouts, apart.noise) == pytest.approx((0.04, 0.01, 7.0))


@pytest.mark.parametrize("name", list(shipped_files("worlds")))
def test_every_mark_of_a_broken_world_is_inside_the_file(name: str, tmp_path: Path) -> None:
    """Each line of a shipped file is left out in turn: what then is wrong must be told without an accident."""
    lines = shipped_files("worlds")[name].read_text(encoding="utf-8").splitlines()
    file = tmp_path / "world.yaml"
    for left_out in range(len(lines)):
        file.write_text("\n".join(lines[:left_out] + lines[left_out + 1 :]), encoding="utf-8")
        try:
            load_world(file)
        except InvalidFileError as error:
            for fault in error.diagnostics:
                assert 1 <= fault.mark.line <= len(lines)


# The dock and the battery


def test_a_dock_and_a_battery_are_read_in_si_units(tmp_path: Path) -> None:
    world = load(
        tmp_path,
        "dock: {at: [-2.95 m, 50 cm], heading: 0 deg}\nphysics: {slip: 1 %, battery: {level: 80 %, drain: 10}}\n",
    )
    assert world.dock == DockConfig(at=(-2.95, 0.5), heading=0.0)
    assert world.physics.battery == BatteryConfig(level=0.8, drain=10.0)
    assert load(tmp_path, "physics: {battery: {}}\n").physics.battery == BatteryConfig()
    plain = load(tmp_path, "")
    assert (plain.dock, plain.physics.battery) == (None, None)


@pytest.mark.parametrize(
    ("text", "word", "said"),
    [
        ("dock: {at: [-2.95 m, 0 m]}", "{at", "'dock' needs 'heading'"),
        ("dock: {heading: 0 deg}", "{heading", "'dock' needs 'at'"),
        ("dock: {at: [-2.95 m, 0 m], headng: 0 deg, heading: 0 deg}", "headng", "did you mean 'heading'?"),
        ("dock: {at: [-2.95 m, 0 m], heading: 0}", "0}", "'heading' needs an angle such as '30 deg'"),
        ("dock: [-2.95 m, 0 m]", "[-2.95", "'dock' must be a mapping"),
        ("dock: {at: [-9 m, 0 m], heading: 0 deg}", "[-9 m", "no room for the robot before the dock"),
        ("dock: {at: [-2.99 m, 0 m], heading: 0 deg}", "[-2.99", "the dock is outside the room at [-3.04 m"),
        ("dock: {at: [-2.95 m, 0 m], heading: 180 deg}", "[-2.95", "before the dock, at [-3.18 m, 0 m]"),
        ("dock: {at: [0.1 m, 0 m], heading: 0 deg}", "[0.1 m", "the dock is where the robot starts"),
        (
            f"furniture: [{{name: bed, at: [-1.5 m, 1 m], {FLOOR}}}]\ndock: {{at: [-2.1 m, 1 m], heading: 0 deg}}",
            "[-2.1 m",
            "at [-1.87 m, 1 m]: 'bed' is there",
        ),
        ("dok: {at: [-2.95 m, 0 m], heading: 0 deg}", "dok", "did you mean 'dock'?"),
        ("physics: {battery: {level: 80}}", "80", "'level' needs a share such as '20 %'"),
        ("physics: {battery: {level: 120 %}}", "120", "'level' must be at most 100 %"),
        ("physics: {battery: {drain: -1}}", "-1", "'drain' must be at least 0"),
        ("physics: {battery: {drian: 2}}", "drian", "did you mean 'drain'?"),
        ("battery: {level: 80 %}", "battery", "a world file has no key 'battery'"),
    ],
)
def test_dock_and_battery_faults_are_reported_with_position(tmp_path: Path, text: str, word: str, said: str) -> None:
    fault = mistake(tmp_path, text)
    assert fault.mark.line == 2 + text.count("\n")
    assert fault.mark.column == text.splitlines()[-1].index(word) + 1
    assert said in str(fault)


def test_all_dock_and_battery_faults_are_reported_together(tmp_path: Path) -> None:
    file = tmp_path / "world.yaml"
    file.write_text("world: hall\ndock: {at: 1 m, heading: 3 m}\nphysics: {battery: {level: 2, drain: x}}\n")
    with pytest.raises(InvalidFileError) as caught:
        load_world(file)
    assert [(fault.mark.line, fault.mark.column) for fault in caught.value.diagnostics] == [
        (2, 12),
        (2, 26),
        (3, 28),
        (3, 38),
    ]


def test_person_in_the_dock_is_reported_and_robot_may_start_there(tmp_path: Path) -> None:
    dock = "dock: {at: [-2.95 m, 0 m], heading: 0 deg}\n"
    fault = mistake(tmp_path, f"{dock}people: [{{name: Anna, at: [-2.95 m, 0 m]}}]\n")
    assert fault.message == "Anna cannot be at [-2.95 m, 0 m]: the dock is there"
    load(tmp_path, f"{dock}start: {{at: [-2.715 m, 0 m], heading: 180 deg}}\n")
