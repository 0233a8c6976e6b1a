"""Files that MissionTree writes itself: what is written is read again as it was meant."""

from math import isclose
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from config.diagnostics import InvalidFileError, SourceText
from config.gesture import GestureConfig, load_gesture, parse_gesture
from config.yaml_writer import gesture_text, write_new
from drivers.servos.declared import DynamixelKeys, JointKeys
from missions.library.drivers import parse_robot
from missions.plugins.setup.servo.joint_import import robot_text

NOD = GestureConfig("nod", "Nod: once.", ((0.0, {"neck": 0.0}), (0.5, {"neck": 0.5, "waist": -0.25})), "cubic")

NAMES = st.text(st.characters(codec="utf-8", categories=["L", "N", "P", "Zs"]), min_size=1).filter(
    lambda name: name.strip() == name != "at"
)
MOVES = st.builds(
    lambda name, summary, steps, cubic: GestureConfig(
        name,
        summary,
        tuple((sum(step for step, _ in steps[: place + 1]), angles) for place, (_, angles) in enumerate(steps)),
        "cubic" if cubic else "minimum_jerk",
    ),
    NAMES,
    NAMES,
    st.lists(st.tuples(st.floats(0.001, 10), st.dictionaries(NAMES, st.floats(-7, 7))), min_size=1, max_size=5),
    st.booleans(),
)


def whole(gesture: GestureConfig) -> list[tuple[float, dict[str, float]]]:
    """Every joint at every keyframe: one that is not named stays where it was."""
    found: list[tuple[float, dict[str, float]]] = []
    for time, angles in gesture.keyframes:
        found.append((time, (found[-1][1] if found else {}) | dict(angles)))
    return found


def test_gesture_text_is_readable_yaml() -> None:
    assert gesture_text(NOD) == (
        'gesture: nod\nsummary: "Nod: once."\ninterpolation: cubic\nkeyframes:\n'
        "  - {at: 0 s, neck: 0 rad}\n"
        "  - {at: 0.5 s, neck: 0.5 rad, waist: -0.25 rad}\n"
    )


def test_unchanged_joint_angle_is_not_written_again() -> None:
    frames = ((0.5, {"neck": 0.5, "waist": 0.1}), (1.0, {"neck": 0.5, "waist": 0.2}), (1.5, {"neck": 0.5}))
    text = gesture_text(GestureConfig("nod", "", frames))
    assert text.splitlines()[-2:] == ["  - {at: 1 s, waist: 0.2 rad}", "  - {at: 1.5 s}"]


@given(MOVES)
def test_gesture_text_round_trips(gesture: GestureConfig) -> None:
    again = parse_gesture(SourceText("x.yaml", gesture_text(gesture)))
    assert (again.name, again.interpolation) == (gesture.name, gesture.interpolation)
    for (time, angles), (was, meant) in zip(whole(again), whole(gesture), strict=True):
        assert isclose(time, was, abs_tol=6e-5)
        assert angles == pytest.approx(meant, abs=6e-7)


@pytest.mark.parametrize(
    "frames",
    [
        (),
        ((1.0, {"neck": 0.0}), (1.00001, {"neck": 0.1})),
        ((1.0, {"neck": float("nan")}),),
        tuple((0.1 * (place + 1), {"neck": 0.1 * place, "waist": 0.1 * place}) for place in range(12_000)),
    ],
)
def test_invalid_gesture_is_not_written(frames: tuple[tuple[float, dict[str, float]], ...]) -> None:
    with pytest.raises(InvalidFileError):
        gesture_text(GestureConfig("nod", "", frames))


def test_write_new_does_not_overwrite_a_file(tmp_path: Path) -> None:
    file = tmp_path / "nod.yaml"
    write_new(file, gesture_text(NOD))
    assert load_gesture(file) == NOD
    with pytest.raises(FileExistsError, match=r"nod\.yaml already exists"):
        write_new(file, "nothing")
    assert load_gesture(file) == NOD


def test_failed_write_leaves_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    full = Path("/dev/full").open
    file = tmp_path / "my_robot.yaml"

    def opened(path: Path, *_: object, **__: object) -> object:
        path.touch(exist_ok=False)
        return full("w", encoding="utf-8")

    monkeypatch.setattr(Path, "open", opened)
    with pytest.raises(OSError, match="No space left"):
        write_new(file, "robot: my_robot")
    assert not file.exists()


def test_joints_in_angles_round_trip_through_robot_text() -> None:
    joint = JointKeys(
        id=3, written_model="MX-28", written_zero=0.5, written_reverse=True, limits=(-1.0, 1.5), speed=2.0, torque=0.8
    )
    arm = parse_robot(SourceText("r.yaml", robot_text("on", {"left elbow": joint}, port="/dev/x y", baud=57_600))).keys(
        DynamixelKeys
    )
    assert arm is not None
    assert (arm.joints, arm.port, arm.baud) == ({"left elbow": joint}, "/dev/x y", 57_600)


def test_invalid_joints_are_not_written() -> None:
    with pytest.raises(InvalidFileError, match="reaches from"):
        robot_text("r", {"elbow": JointKeys(id=3, limits=(-3.0, 3.0))}, port="x")
