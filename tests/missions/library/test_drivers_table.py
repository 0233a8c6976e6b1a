"""The table of kinds and drivers: every dotted name leads somewhere, and takes what it is given."""

import inspect
import subprocess
import sys
from dataclasses import replace
from importlib.metadata import EntryPoint
from types import ModuleType
from typing import get_type_hints

import pytest

from behaviours.robot import Robot
from config.diagnostics import InvalidFileError, SourceText
from config.library import find_file
from config.world import load_world
from drivers.api.driver import BrokenDriver, Driver, DriverContext, resolve_name
from drivers.api.keys import Key, declared_keys, keys
from drivers.api.keys import key as a_key
from drivers.api.kinds import KINDS
from drivers.api.sections import ArmKeys, BaseKeys
from drivers.clock import ManualClock
from drivers.errors import BadRequest
from drivers.sim.context import SimContext
from drivers.table import BUILT_IN_DRIVERS
from missions.assembly.assemble import assemble
from missions.assembly.part_factory import Hooks, Overrides, resolve_maker
from missions.library.drivers import DriverTable, load_robot, parse_robot

DRIVERS = [DriverTable().find(kind, name) for kind, names in BUILT_IN_DRIVERS.items() for name in names]


@pytest.mark.parametrize("driver", DRIVERS, ids=lambda driver: f"{driver.kind}-{driver.name}")
def test_each_driver_is_declared_by_name_and_its_paths_accept_its_keys(driver: Driver) -> None:
    assert BUILT_IN_DRIVERS[driver.kind][driver.name]
    assert issubclass(driver.keys, KINDS[driver.kind].keys)
    for name, place in ((driver.make, DriverContext), (driver.twin, SimContext), (driver.virtual, SimContext)):
        if name:
            first, second = inspect.signature(resolve_name(name)).parameters
            hints = get_type_hints(resolve_name(name))
            assert issubclass(driver.keys, hints[first]), name
            assert hints[second] is place, name


def test_every_part_with_a_port_has_a_twin_and_a_virtual_device() -> None:
    for driver in DRIVERS:
        assert bool(driver.twin) == KINDS[driver.kind].has_port, driver.name
        assert bool(driver.virtual) >= KINDS[driver.kind].has_port, driver.name  # a camera of ROS 2 has one, too


@pytest.mark.parametrize("kind", KINDS.values(), ids=lambda kind: kind.name)
def test_each_part_kind_has_a_robot_field_and_protocols(kind: object) -> None:
    found = KINDS[str(getattr(kind, "name", ""))]
    hints = get_type_hints(Robot)
    assert hints[f"{found.field}_part"] == resolve_name(found.leaf_protocol or found.protocol) | None
    assert resolve_name(found.protocol).__mro__
    assert not found.default_driver or found.default_driver in BUILT_IN_DRIVERS[found.name]


def test_every_driver_key_has_help() -> None:
    silent = [
        f"{cls.__name__}.{key.field}" for driver in DRIVERS for cls, key in _all_keys(driver.keys) if not key.help
    ]
    assert not silent


def _all_keys(cls: type) -> list[tuple[type, Key]]:
    found = []
    for key in declared_keys(cls):
        found.append((cls, key))
        for of in key.sections:
            found += _all_keys(of)
    return found


def test_built_in_drivers_are_found_without_entry_points(monkeypatch: pytest.MonkeyPatch) -> None:
    def looked(group: str) -> None:
        raise AssertionError(f"looked for {group}")

    monkeypatch.setattr("missions.library.drivers.entry_points_of", looked)
    assert DriverTable().find("base", "kobuki").name == "kobuki"


def test_the_defaults_of_keys_are_within_their_bounds() -> None:
    for driver in DRIVERS:
        for cls, key in _all_keys(driver.keys):
            if isinstance(key.default, int | float):
                low, high = (key.default if bound is None else bound for bound in (key.low, key.high))
                assert low <= key.default <= high, f"{cls.__name__}.{key.field}"


def test_a_declaration_of_the_house_is_never_broken() -> None:
    assert not [found for *_, found in DriverTable().iter_drivers() if isinstance(found, BrokenDriver)]


METAL = """
import sys
from missions.cli import run
from missions.request import RunRequest
from missions.runner import Runner
runner = Runner(RunRequest("square_3m", robot="turtlebot2"))
assert runner.assembled_robot.robot.base_part is not None
print("\\n".join(sys.modules))
"""


def test_real_robot_imports_no_simulation_or_unused_drivers() -> None:
    done = subprocess.run([sys.executable, "-c", METAL], capture_output=True, text=True, check=True)
    imported = done.stdout.split()
    assert "drivers.kobuki.driver" in imported
    unused = ("sim", "virtual", "arduino", "dynamixel", "ros2", "camera.opencv", "microphone", "voice", "screen")
    names = tuple(f"drivers.{name}" for name in unused)
    declarations = (".declared", ".models")
    loaded = [name for name in imported if name.startswith(names) and name.count(".") > 1]
    assert not [name for name in loaded if not name.endswith(declarations)]
    assert not [name for name in imported if name.startswith(("missions.assembly.simul", "missions.assembly.twin"))]


def test_wire_simulation_refuses_a_driver_without_virtual_device() -> None:
    robot = load_robot(find_file("robots", "turtlebot2"))
    base = robot.sections["base"]
    bare = replace(base, driver=replace(base.driver, virtual=""))
    robot = replace(robot, sections={**robot.sections, "base": bare})
    wishes = Overrides(world=load_world(find_file("worlds", "empty")))
    audience = Hooks(*[lambda *_: None] * 5)
    with pytest.raises(BadRequest, match="base: the driver 'kobuki' has no virtual device"):
        assemble(robot, frozenset({"base"}), ManualClock(), wishes, audience)


@keys
class Limbless(ArmKeys):
    """The keys of an arm that forgets to say which joints it has."""


class Unread(BaseKeys):
    """Keys that lack their mark."""

    horn: bool = a_key(default=False)


class Answer:
    """A value that no key can hold."""


@keys
class Odd(BaseKeys):
    """A key of a type that no file has."""

    answer: Answer | None = a_key(default=None)


@pytest.mark.parametrize(
    ("driver", "told"),
    [
        (Driver("x", "arm", "", Limbless, ""), "has keys without joints: give Limbless `limits`, a property"),
        (Driver("x", "base", "", Unread, ""), "are not read: write @keys before class Unread"),
        (Driver("x", "base", "", Odd, ""), "has an invalid key: Odd.answer: no key can hold"),
        (Driver("x", "base", "", "Keys", ""), "do not extend drivers.api.sections.BaseKeys"),  # type: ignore[arg-type]
        (Driver("y", "base", "", BaseKeys, ""), "declares the driver base.y: both must have one name"),
        (Driver("x", "base", "", BaseKeys, "", needs=("wings",)), "needs unknown parts: wings"),
    ],
    ids=["joints", "mark", "type", "class", "name", "needs"],
)
def test_a_broken_declaration_is_one_clear_error_and_breaks_nothing_else(
    driver: Driver, told: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    name = f"{driver.kind}.x"
    module = ModuleType("broken_sample")
    module.__dict__["X"] = driver
    monkeypatch.setitem(sys.modules, "broken_sample", module)
    point = EntryPoint(name, "broken_sample:X", "missiontree.drivers")
    monkeypatch.setattr("missions.library.drivers.entry_points_of", lambda _: [point])
    text = f"robot: r\n{driver.kind}: {{driver: x}}\nvoice: {{loud: true}}\n"
    with pytest.raises(InvalidFileError) as caught:
        parse_robot(SourceText("r.yaml", text))
    first, second = caught.value.diagnostics
    assert first.message.startswith(f"'driver: x' cannot be used: {name} = broken_sample:X ")
    assert told in first.message
    assert (first.mark.line, second.message) == (2, "'voice' has no key 'loud'")
    sound = {(each.kind, each.name) for *_, each in DriverTable().iter_drivers() if isinstance(each, Driver)}
    assert sound == {(each.kind, each.name) for each in DRIVERS}


def test_missing_package_of_a_driver_is_reported_with_its_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    def resolve(_: str) -> object:
        raise ModuleNotFoundError("No module named 'rosbags'", name="rosbags")

    monkeypatch.setattr("missions.assembly.part_factory.resolve_name", resolve)
    section = load_robot(find_file("robots", "turtlebot4")).sections["base"]
    for missing, message, hint in (
        (["rosbags"], "base: the driver 'ros2' needs the package 'rosbags'", "pip install 'missiontree[ros2]'"),
        ([], "base: the driver 'ros2' has a wrong twin, drivers.x:y: ModuleNotFoundError", "tell its author"),
    ):
        monkeypatch.setattr("drivers.extras.missing_distributions", lambda _, found=missing: found)
        with pytest.raises(BadRequest, match=message) as raised:
            resolve_maker("drivers.x:y", section, "twin")
        assert raised.value.hint == hint
