"""Gaits made of gaits: blended, mirrored, scaled, in sequence; and what a body cannot do, by the joint and the time."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from click.testing import CliRunner

from config.diagnostics import InvalidFileError
from config.gesture import load_gait
from config.library import shipped_files
from drivers.api import Image
from drivers.errors import BadRequest
from drivers.legs.balance import support_margins
from drivers.legs.engine import whole_body_pose
from drivers.legs.gait import blend_gaits, mirror_gait, scale_gait
from missions.cli.show import command as show
from missions.library.drivers import load_robot
from missions.plugins.legs.command import LeggedRobot, command, format_gait

GAITS = Path(__file__).parents[3] / "config" / "gaits"
STROLL, CURVE = GAITS / "stroll.yaml", GAITS / "curve.yaml"


@pytest.fixture(scope="module", params=["humanoid", "op3"])
def walker(request: pytest.FixtureRequest) -> LeggedRobot:
    return LeggedRobot(load_robot(shipped_files("robots")[request.param]))


def test_shipped_gaits_can_be_walked(walker: LeggedRobot) -> None:
    assert [wrong for path in sorted(GAITS.glob("*.yaml")) for wrong in walker.gait_errors(walker.load(path))] == []


def test_blend_of_two_gaits_is_between_them_and_can_be_walked(walker: LeggedRobot) -> None:
    one, other = walker.load(STROLL), walker.load(CURVE)
    middle = blend_gaits(one, other, 0.5)
    assert walker.gait_errors(middle) == []
    assert np.allclose(middle.feet, (one.feet + other.feet) / 2)
    assert np.array_equal(blend_gaits(one, other, 0.0).feet, one.feet)


def test_a_mirrored_gait_is_the_mirror_image_joint_by_joint(walker: LeggedRobot) -> None:
    gait = walker.load(CURVE)
    image, body = mirror_gait(gait), walker.body
    assert walker.gait_errors(image) == []
    here, there = (whole_body_pose(body, each.angles(body)[0]) for each in (gait, image))
    assert np.allclose(body.mirror(here), there, atol=1e-12)
    assert np.array_equal(mirror_gait(image).feet, gait.feet)


def test_a_gait_scaled_out_of_reach_is_refused_with_joint_and_time(walker: LeggedRobot) -> None:
    wrong = walker.gait_errors(scale_gait(walker.load(STROLL), length=6))
    knee = walker.body.joints[walker.body.legs["left"].joints[3]]
    assert wrong[0].startswith(f"stroll: {knee} at 0.")
    assert "too far from the hip" in wrong[0]


def test_too_fast_gait_is_refused_with_joint_time_and_speed(walker: LeggedRobot) -> None:
    wrong = walker.gait_errors(scale_gait(walker.load(STROLL), time=0.3))
    assert any("deg/s, faster than" in each and " s: " in each for each in wrong)


def test_pressure_outside_the_soles_is_reported(walker: LeggedRobot) -> None:
    gait = walker.load(STROLL)
    still = np.broadcast_to(gait.feet.mean(axis=0), gait.feet.shape).copy()
    still[..., 2] = gait.feet[..., 2]  # up and down, without any sway
    wrong = walker.gait_errors(type(gait)("march", 4.0, still, gait.headings, gait.on_floor))
    assert any("outside of its soles" in each for each in wrong)


def test_colliding_soles_are_reported(walker: LeggedRobot) -> None:
    gait = walker.load(STROLL)
    near = gait.feet.copy()
    near[..., 1] *= 0.4
    wrong = walker.gait_errors(type(gait)("narrow", 4.0, near, gait.headings, gait.on_floor))
    assert any("hits" in each for each in wrong)


def test_weak_servos_are_reported_with_their_torque() -> None:
    weak = LeggedRobot(load_robot(shipped_files("robots")["op3"]))
    weak.torques = dict.fromkeys(weak.torques, 0.5)
    assert any("more than its servo's 0.5 Nm" in each for each in weak.gait_errors(weak.load(STROLL)))


def test_a_gait_goes_into_files_and_comes_back(walker: LeggedRobot, tmp_path: Path) -> None:
    gait = walker.load(CURVE)
    robot = "humanoid" if "left_knee" in walker.limits else "op3"
    for name in ("again.yaml", "again.csv"):
        made = CliRunner().invoke(command, ["make", str(CURVE), "-o", str(tmp_path / name), "--robot", robot])
        assert made.exit_code == 0, made.output
        again = walker.load(tmp_path / name)
        assert again.period == pytest.approx(gait.period, abs=1e-4)
        assert np.abs(again.feet - gait.feet).max() < 0.001
        assert walker.gait_errors(again) == [], name
        assert support_margins(walker.body, again, again.angles(walker.body)[0]).min() > 0


def test_scale_writes_no_file_for_an_invalid_gait(tmp_path: Path) -> None:
    out = tmp_path / "long.yaml"
    ran = CliRunner().invoke(command, ["scale", str(STROLL), "--length", "6", "-o", str(out)])
    assert ran.exit_code == 1
    assert "left_knee at 0." in ran.output
    assert "nothing is written" in ran.output
    assert not out.exists()


def test_commands_blend_mirror_and_put_in_a_row(tmp_path: Path) -> None:
    between, image, row = tmp_path / "between.yaml", tmp_path / "image.yaml", tmp_path / "row.csv"
    for arguments in (
        ["blend", str(STROLL), str(CURVE), "--share", "0.3", "-o", str(between)],
        ["mirror", str(between), "-o", str(image)],
        ["sequence", str(STROLL), str(image), "--cycles", "2", "-o", str(row)],
        ["check", str(between), str(image)],
    ):
        ran = CliRunner().invoke(command, arguments)
        assert ran.exit_code == 0, ran.output
    ran = CliRunner().invoke(show, [str(image)])
    assert ran.exit_code == 0, ran.output
    assert "support margin: " in ran.output
    times = np.loadtxt(row, delimiter=",", skiprows=1)[:, 0]
    assert (np.diff(times) > 0).all()
    assert times[-1] == pytest.approx(3.7)


@pytest.mark.parametrize("ending", [".png", ".svg"])
def test_gait_picture_shows_soles_and_joints(tmp_path: Path, ending: str) -> None:
    picture = tmp_path / f"stroll{ending}"
    ran = CliRunner().invoke(show, [str(STROLL), "-o", str(picture)])
    assert ran.exit_code == 0, ran.output
    assert picture.stat().st_size > 10_000
    if ending == ".svg":
        assert "hip pitch" in picture.read_text().replace("<!-- ", "")
    refused = CliRunner().invoke(show, [str(STROLL), "-o", str(tmp_path / "stroll.txt")])
    assert refused.exit_code == 2
    assert "a picture ends in .png or .svg, a film in .webm, .mp4, .avi" in refused.output


def test_a_gait_is_filmed_for_two_cycles(tmp_path: Path) -> None:
    file = tmp_path / "stroll.webm"
    assert CliRunner().invoke(show, [str(STROLL), "-o", str(file)]).exit_code == 0
    film, pictures = cv2.VideoCapture(str(file)), list[Image]()
    while (found := film.read())[0]:
        pictures.append(np.asarray(found[1], np.uint8))
    film.release()
    walker = LeggedRobot(load_robot(shipped_files("robots")["humanoid"]))
    assert len(pictures) == round(2 * 25 * walker.load(STROLL).period)
    first, half = (pictures[number].astype(int) for number in (0, len(pictures) // 4))
    assert np.abs(first - half).max() > 50  # half a cycle on, the other foot is in front
    assert np.abs(first - pictures[len(pictures) // 2])[:400].mean() < 2  # and a cycle on it is as before


def test_unreachable_gait_and_missing_folder_are_refused(tmp_path: Path) -> None:
    far = tmp_path / "far.yaml"
    walker = LeggedRobot(load_robot(shipped_files("robots")["humanoid"]))
    far.write_text(format_gait(scale_gait(walker.load(STROLL), length=6.0), "far"))
    for arguments, why in (([str(far), "-o", str(tmp_path / "x.webm")], "out of reach"),
                           ([str(STROLL), "-o", "/nowhere/x.webm"], "no such folder")):  # fmt: skip
        refused = CliRunner().invoke(show, [*arguments])
        assert refused.exit_code != 0
        assert why in refused.output
    assert not (tmp_path / "x.webm").exists()


def test_gait_is_named_after_its_file(tmp_path: Path) -> None:
    for name in ("a: b", "yes", "- 1", 'half "done"'):
        file = tmp_path / f"{name}.yaml"
        assert CliRunner().invoke(command, ["make", "stroll", "-o", str(file)]).exit_code == 0
        assert load_gait(file).gait == name


def test_gait_file_without_step_length_is_refused_with_position(tmp_path: Path) -> None:
    path = tmp_path / "lame.yaml"
    path.write_text("gait: lame\nwalk: {turn: 5 deg}\n")
    with pytest.raises(InvalidFileError, match=r"lame\.yaml:2:.*step"):
        load_gait(path)
    path.write_text("gait: lame\n")
    with pytest.raises(InvalidFileError, match="either 'walk' or 'points'"):
        load_gait(path)


def test_too_long_step_and_robot_without_legs_are_refused(walker: LeggedRobot, tmp_path: Path) -> None:
    path = tmp_path / "giant.yaml"
    path.write_text("gait: giant\nwalk: {step: 40 cm}\n")
    with pytest.raises(BadRequest, match="giant: step: a step can be"):
        walker.load(path)
    with pytest.raises(BadRequest, match="has no legs"):
        LeggedRobot(load_robot(shipped_files("robots")["turtlebot2"]))
