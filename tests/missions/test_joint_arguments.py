"""What missions say of joints: names, groups, angles by joint, movements; and what the robot cannot do of it."""

import math
from pathlib import Path

import pytest

import missions
from behaviours.catalogue import LEAVES
from behaviours.robot import Robot
from config.diagnostics import Diagnostic, InvalidFileError, SourceText
from config.library import shipped_files
from config.yaml_nodes import Mapping, Scalar, compose
from drivers.api import Gesture
from missions.language.claims import impossible_alternatives
from missions.language.document import check_plan
from missions.language.plan import Step
from missions.library.drivers import load_robot
from missions.library.lookups import LOOKUPS
from missions.library.target import target_of
from missions.plugins.testing.recorders import LeafTestBench

HUMANOID = target_of(load_robot(shipped_files("robots")["humanoid"]))
ELBOW = "left_elbow"


def step(text: str, *, robot: bool = False, params: str = "{}") -> Step:
    source = SourceText("m.yaml", f"mission: m\nparams: {params}\ntree:\n  {text}\n")
    return check_plan(source, LEAVES, LOOKUPS, robot=HUMANOID if robot else None).tree


def faults(text: str, *, robot: bool = False, params: str = "{}") -> list[str]:
    with pytest.raises(InvalidFileError) as caught:
        step(text, robot=robot, params=params)
    return [fault.message for fault in caught.value.diagnostics]


def constants(text: str, *, params: str = "{}") -> dict[str, object]:
    return {name: value.constant for name, value in step(text, params=params).arguments.items()}


# --- how they are written --------------------------------------------------------------------------------------------


def test_angles_by_joint_are_taken_in_radians() -> None:
    found = constants("move_joints: {to: {elbow: 90 deg, wrist: -0.5 rad}, tolerance: 1 deg}")
    assert found == {"to": {"elbow": pytest.approx(math.pi / 2), "wrist": -0.5}, "tolerance": pytest.approx(0.0174533)}


def test_angles_by_joint_may_be_params() -> None:
    found = constants('move_joints: {to: {elbow: "${far}", wrist: "${-far}"}}', params="{far: 90 deg}")
    assert found["to"] == {"elbow": pytest.approx(math.pi / 2), "wrist": pytest.approx(-math.pi / 2)}


def test_a_variable_may_hold_all_angles() -> None:
    tree = step("sequence: [{set: {pose: {elbow: 90 deg}}}, {move_joints: {to: '${pose}'}}]")
    value = tree.children[1].arguments["to"]
    stored = tree.children[0].arguments["pose"].constant
    assert value.resolve({"pose": stored}) == {"elbow": pytest.approx(math.pi / 2)}
    with pytest.raises(ValueError, match=r"needs joints with values, such as .*; got '3'"):
        value.resolve({"pose": 3})


@pytest.mark.parametrize(
    ("to", "message"),
    [
        ("{elbow: 90}", "'elbow' needs an angle such as '30 deg': '90' has no unit (units: deg, rad)"),
        ("{}", " needs joints, each with its value, such as {elbow: 28.6479 deg}"),
        ("90 deg", " needs joints, each with its value, such as {elbow: 28.6479 deg}"),
        ("[elbow]", " needs joints, each with its value, such as {elbow: 28.6479 deg}"),
        ("{elbow: [1 deg]}", "'elbow' needs one value, not a list"),
        ('{elbow: "${base.heading}"}', ": the values must be known before the mission starts: numbers or params"),
    ],
)
def test_invalid_joint_angles_are_reported(to: str, message: str) -> None:
    (found,) = faults(f"move_joints: {{to: {to}}}")
    assert found.startswith("'move_joints': 'to'")
    assert found.endswith(message)


@pytest.mark.parametrize(
    ("written", "names"),
    [("elbow", ("elbow",)), ("7", ("7",)), ("[left_arm, neck]", ("left_arm", "neck")), ('"${arm}"', ("left_arm",))],
)
def test_joints_are_a_name_or_a_list_of_names(written: str, names: tuple[str, ...]) -> None:
    assert constants(f"joint_hot: {{joints: {written}}}", params="{arm: left_arm}")["joints"] == names


@pytest.mark.parametrize("written", ["[]", "[[elbow]]", "[{a: b}]", "' '", "{a: b}"])
def test_invalid_joint_lists_are_reported(written: str) -> None:
    assert len(faults(f"joint_hot: {{joints: {written}}}")) == 1


@pytest.mark.parametrize(
    ("written", "on"), [("on", True), ("off", False), ("true", True), ("false", False), ("'off'", False)]
)
def test_torque_is_on_or_off(written: str, on: bool) -> None:
    assert constants(f"torque: {written}")["stiff"] is on
    assert constants(f"torque: {{stiff: {written}, joints: elbow}}")["stiff"] is on


def test_on_and_off_are_read_as_text() -> None:
    """YAML 1.1 would make truth values of them, the key of ``{on: off}`` included."""
    root = compose(SourceText("m.yaml", "torque: {on: off}"))
    assert isinstance(root, Mapping)
    inner = root.get("torque")
    assert isinstance(inner, Mapping)
    value = inner.get("on")
    assert isinstance(value, Scalar)
    assert value.value == "off"


@pytest.mark.parametrize("written", ["yes", "1", "On", "stiff"])
def test_torque_is_nothing_else(written: str) -> None:
    assert faults(f"torque: {written}") == [f"'torque' needs true or false, got '{written}'"]


def test_temperature_needs_a_unit() -> None:
    assert constants("joint_hot: {over: 55 degC}")["over"] == 55.0
    assert faults("joint_hot: {over: 55}") == [
        "'joint_hot': 'over' needs a temperature such as '60 degC': '55' has no unit (units: degC)"
    ]
    assert faults("joint_hot: {over: 55 °C}") == [
        "'joint_hot': 'over' needs a temperature such as '60 degC': unknown unit '°C' (write '55 degC')"
    ]


def test_a_move_is_a_gesture_by_name_or_a_file(tmp_path: Path) -> None:
    found = constants("play: gait")["move"]
    assert isinstance(found, Gesture)
    assert (found.name, found.interpolation) == ("gait", "cubic")
    sheet = tmp_path / "lift.csv"
    sheet.write_text("time,left_elbow\n0,0.1\n0.5,0.4\n1,0.2\n", encoding="utf-8")
    lift = constants(f"play: {{move: {sheet}, speed: 0.5}}")["move"]
    assert isinstance(lift, Gesture)
    assert [frame.positions[ELBOW] for frame in lift.keyframes] == [0.1, 0.4, 0.2]


def test_missing_or_invalid_move_is_reported(tmp_path: Path) -> None:
    assert faults("play: gaitt") == ["'play' needs a move: unknown move 'gaitt'; did you mean 'gait'?"]
    sheet = tmp_path / "lift.csv"
    sheet.write_text("time,left_elbow\n0,0.1\n0.5,none\n", encoding="utf-8")
    (found,) = faults(f"play: {sheet}")
    assert found.startswith("'play' names a move with errors: ")
    assert "lift.csv:3:2: 'none' is not a number" in found


def test_a_new_move_has_the_name_of_a_file() -> None:
    assert getattr(constants("record_move: my_wave")["move"], "path", None) == Path("my_wave.yaml")
    assert faults("record_move: /") == ["'record_move' needs the name of a new file, got '/'"]


# --- what the robot cannot do ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "text",
    [
        "play: gait",
        "gesture: wave",
        "move_joints: {to: {left_elbow: 90 deg}, speed: 180 deg/s}",
        "mirror: {leader: left_arm, follower: right_arm, offsets: {right_elbow: 5 deg}}",
        "follow_joint: {leader: left_elbow, follower: right_elbow, past: 20 deg}",
        "sweep: {joints: [left_elbow, right_elbow], between: [10 deg, 90 deg], phases: {right_elbow: 180 deg}}",
        "torque: {stiff: off, joints: legs}",
        "joint_hot: legs",
        "joint_at: {joint: left_elbow, angle: 90 deg}",
        "record_move: {move: mine, joints: left_arm}",
    ],
)
def test_joint_steps_the_robot_can_do_pass_the_check(text: str) -> None:
    assert step(text, robot=True).leaf is not None


@pytest.mark.parametrize(
    ("text", "misfits"),
    [
        ("gesture: hello", ["shoulder_lift", "shoulder_pan", "elbow", "gripper", "upper_roll", "wrist_bend"]),
        (
            "move_joints: {to: {left_elbow: 150 deg, left_elbw: 1 deg}, speed: 200 deg/s}",
            ["left_elbow at 150 deg is outside its limits (0 deg to 120 deg)", "left_elbw", "left_elbow at 200 deg/s"],
        ),
        ("move_joints: {to: {left_arm: 5 deg}}", ["'left_arm' is a group of joints"]),
        ("mirror: {leader: left_arm, follower: legs}", ["4 joints cannot lead 12 joints"]),
        ("mirror: {leader: left_arms, follower: right_arm}", ["(did you mean 'left_arm'?)"]),
        ("follow_joint: {leader: left_arm, follower: right_elbow}", ["'left_arm' is a group of joints"]),
        ("sweep: {joints: left_arm, between: [-50 deg, 0 deg]}", ["left_shoulder_roll at -50 deg", ELBOW]),
        ("torque: {stiff: off, joints: [legs, tail]}", ["no joint or group 'tail'"]),
        ("joint_loaded: tail", ["no joint or group 'tail'"]),
        ("joint_at: {joint: legs, angle: 0 deg}", ["'legs' is a group of joints"]),
        ("record_move: {move: mine, joints: tail}", ["no joint or group 'tail'"]),
    ],
)
def test_joint_steps_the_robot_cannot_do_are_reported_completely(text: str, misfits: list[str]) -> None:
    (message,) = faults(f"sequence:\n    - succeed\n    - {text}", robot=True)
    assert message.startswith(f"'{text.partition(':')[0]}' cannot be done by robot 'humanoid': ")
    assert [misfit for misfit in misfits if misfit not in message] == []
    assert step(text) is not None, "where no robot is named"


def test_joints_of_an_opened_robot_are_checked(tmp_path: Path) -> None:
    file = tmp_path / "m.yaml"
    file.write_text("mission: m\ntree: {torque: {stiff: off, joints: [upper, tail]}}\n", encoding="utf-8")
    robot = Robot(arm_part=LeafTestBench().arm, groups={"upper": ("shoulder",)})
    with pytest.raises(InvalidFileError, match=r"'torque' cannot be done by robot 'this robot': .* no .* 'tail'"):
        missions.load(file, robot=robot)


def test_joints_in_a_variable_are_checked_at_run_time() -> None:
    text = "sequence: [{set: {pose: {tail: 1 deg}}}, {move_joints: {to: '${pose}'}}]"
    assert step(text, robot=True) is not None


def test_missing_arm_is_the_only_mistake_of_play() -> None:
    target = HUMANOID._replace(parts=frozenset({"voice"}), reaches={})
    with pytest.raises(InvalidFileError) as caught:
        check_plan(SourceText("m.yaml", "mission: m\ntree: {play: gait}\n"), LEAVES, LOOKUPS, robot=target)
    (fault,) = caught.value.diagnostics
    assert fault.message == "'play' needs an arm; robot 'humanoid' has none (it has voice)"


# --- what the robot cannot do, and could instead ---------------------------------------------------------------------


def refused(text: str, robot: str) -> Diagnostic:
    target = target_of(load_robot(shipped_files("robots")[robot]))
    source = SourceText("m.yaml", f"mission: m\ntree:\n  {text}\n")
    with pytest.raises(InvalidFileError) as caught:
        check_plan(source, LEAVES, LOOKUPS, robot=target)
    (fault,) = caught.value.diagnostics
    return fault


def test_unsuitable_gesture_suggests_the_possible_ones() -> None:
    fault = refused("gesture: hello", "so101")
    assert fault.message.startswith("'gesture' cannot be done by robot 'so101': the arm has no joints 'elbow'")
    assert fault.suggestion == "it can do: arm_wave"
    assert refused("play: hello", "so101").suggestion == "it can do: arm_wave"


def test_where_no_gesture_fits_one_is_to_be_recorded() -> None:
    assert "mission servo record" in refused("gesture: hello", "op3").suggestion


@pytest.mark.parametrize("robot", ["humanoid", "pi_car"])
@pytest.mark.parametrize(
    "first",
    [
        "gesture: hello",
        "race: [track_face, gesture: hello]",
        "{gesture: hello, retry: 2}",
        "selector: [gesture: hello, nod]",
    ],
)
def test_impossible_selector_child_is_a_hint_if_another_follows(robot: str, first: str) -> None:
    target = target_of(load_robot(shipped_files("robots")[robot]))
    source = SourceText("m.yaml", f"mission: m\ntree:\n  selector: [{{sequence: [{first}]}}, nod]\n")
    plan = check_plan(source, LEAVES, LOOKUPS, robot=target)
    (hint,) = impossible_alternatives(plan.tree, target, LOOKUPS)
    assert hint.message.startswith(f"'gesture' cannot be done by robot '{robot}'")
    able = {"humanoid": "; it can do: gait, get_up_front, wave", "pi_car": ""}[robot]
    assert hint.suggestion == f"the next alternative of the selector is tried then{able}"


@pytest.mark.parametrize(
    "tree",
    [
        "selector: [nod, gesture: hello]",  # the last alternative
        "selector: [{sequence: [wait: 1 s, gesture: hello]}, nod]",  # something was done before
        "reactive_selector: [gesture: hello, nod]",
        "{gesture: hello, on_failure: succeed}",
        "selector: [obstacle_within: 1 m, nod]",  # a condition that a missing sensor would answer
        "selector: [{gesture: hello, invert: true}, nod]",  # its failure does not lead to the next
        "selector: [{sequence: [gesture: hello, wait: 1 s], invert: true}, nod]",
        "selector: [{parallel: [gesture: hello, drive: 1 m], success_count: 1, failure_count: all}, nod]",
        "selector: [{parallel: [gesture: hello, drive: 1 m], wait_for_all: true}, nod]",  # drives before it fails
    ],
)
def test_impossible_step_is_a_mistake(tree: str) -> None:
    assert "pi_car" in refused(tree, "pi_car").message
