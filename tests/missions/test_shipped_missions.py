"""Everything that ships: it loads, it fits together, and it goes by the name of its file."""

import math
from collections.abc import Callable
from pathlib import Path

import pytest
import yaml

from behaviours.tracking.follow import RuleBases
from config.controller import load_controller
from config.gesture import GestureConfig, load_gesture
from config.library import DEFAULT_ROBOT, shipped_files
from config.robot import RobotConfig
from config.world import load_world
from drivers.api.sections import ArmKeys
from missions.library.drivers import load_robot
from missions.library.lookups import LOOKUPS
from missions.library.shipped import find_mission, load_mission, shipped_missions
from missions.library.target import target_of

LOADERS: dict[str, Callable[[Path], object]] = {
    "robots": load_robot,
    "worlds": load_world,
    "gestures": load_gesture,
    "controllers": load_controller,
}
FILES = [(kind, name) for kind in LOADERS for name in shipped_files(kind)]


@pytest.mark.parametrize(("kind", "name"), FILES)
def test_every_shipped_file_loads_and_has_the_name_of_its_file(kind: str, name: str) -> None:
    loaded = LOADERS[kind](shipped_files(kind)[name])
    assert getattr(loaded, "name", "") == name
    assert getattr(loaded, "summary", "")


def robot_for(mission: str) -> RobotConfig:
    """Return the robot on which the tests of a mission run it."""
    tests = shipped_missions()[mission].with_suffix(".test.yaml")
    within = yaml.safe_load(tests.read_text(encoding="utf-8")).get("with", {}) if tests.exists() else {}
    return load_robot(shipped_files("robots")[within.get("robot", DEFAULT_ROBOT)])


@pytest.mark.parametrize("name", list(shipped_missions()))
def test_every_shipped_mission_passes_the_check_for_its_robot(name: str) -> None:
    plan = load_mission(name, robot=target_of(robot_for(name)))
    assert plan.mission == name.rpartition("/")[2]
    assert plan.summary


def arm_for(gesture: GestureConfig) -> ArmKeys:
    """Return the arm of the first robot that has the joints of ``gesture``."""
    arms = (load_robot(path).arm for path in shipped_files("robots").values())
    return next(arm for arm in arms if arm is not None and gesture.joints <= arm.limits.keys())


@pytest.mark.parametrize("name", list(shipped_files("gestures")))
def test_every_gesture_stays_within_the_joints_of_a_shipped_robot(name: str) -> None:
    gesture = load_gesture(shipped_files("gestures")[name])
    arm = arm_for(gesture)
    for time, positions in gesture.keyframes:
        for joint, angle in positions.items():
            limits = arm.limits[joint]
            assert limits.lower <= angle <= limits.upper, f"{joint} at {time} s"


@pytest.mark.parametrize("name", list(shipped_files("gestures")))
def test_every_gesture_can_be_followed_at_the_speed_of_the_joints(name: str) -> None:
    gesture = load_gesture(shipped_files("gestures")[name])
    arm = arm_for(gesture)
    before: dict[str, tuple[float, float]] = {}
    for time, positions in gesture.keyframes:
        for joint, angle in positions.items():
            since, was = before.get(joint, (0.0, 0.0))
            assert abs(angle - was) <= arm.limits[joint].speed * (time - since) + 1e-9, f"{joint} at {time} s"
            before[joint] = (time, angle)


@pytest.mark.parametrize("name", list(shipped_files("gestures")))
def test_every_gesture_ends_where_it_began(name: str) -> None:
    last: dict[str, float] = {}
    for _, positions in load_gesture(shipped_files("gestures")[name]).keyframes:
        last.update(positions)
    if name == "let_go":  # whose hand stays open, since somebody's may still be in it
        assert last.pop("gripper") > 0.5
    if name.startswith("get_up"):  # it ends standing with bent legs, as a walk begins
        legs = ("hip_pitch", "knee", "ankle_pitch")
        hip, knee, ankle = ({last.pop(f"{side}_{joint}") for side in ("left", "right")} for joint in legs)
        assert sum(hip) + sum(ankle) == pytest.approx(sum(knee), abs=0.05)  # the soles are level
        assert {last.pop(f"{side}_shoulder_roll") for side in ("left", "right")} == {math.radians(5)}
    assert last == dict.fromkeys(last, 0.0)


@pytest.mark.parametrize("name", list(shipped_files("worlds")))
def test_people_of_shipped_worlds_stay_inside_the_room(name: str) -> None:
    world = load_world(shipped_files("worlds")[name])
    for person in world.people:
        for x, y in ((person.x, person.y), *person.path):
            assert abs(x - world.centre[0]) < world.length / 2
            assert abs(y - world.centre[1]) < world.width / 2


def test_every_controller_and_gesture_is_found_by_name() -> None:
    for name in shipped_files("controllers"):
        assert isinstance(LOOKUPS["controller"](name), RuleBases)
    for name in shipped_files("gestures"):
        assert getattr(LOOKUPS["gesture"](name), "name", "") == name


def test_mistake_in_a_named_file_has_its_position(tmp_path: Path) -> None:
    file = tmp_path / "bad.yaml"
    file.write_text("gesture: bad\nkeyframes:\n  - {at: 1 s, elbow: 90}\n", encoding="utf-8")
    with pytest.raises(LookupError, match=r"names a gesture with errors: .*bad\.yaml:3:22: 'elbow' needs an angle"):
        LOOKUPS["gesture"](str(file))
    file.write_text("controller: bad\nleg: {}\n", encoding="utf-8")
    with pytest.raises(LookupError, match=r"bad\.yaml:2:1: a controller file has no key 'leg'"):
        LOOKUPS["controller"](str(file))


def test_greet_accepts_its_params() -> None:
    assert find_mission("greet").name == "greet.yaml"
    plan = load_mission("greet", params={"greeting": "Good morning", "patience": "2 min"})
    assert (plan.params["greeting"], plan.params["patience"]) == ("Good morning", 120.0)
