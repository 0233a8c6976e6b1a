"""``mission servo`` as its users meet it: scan, info, set and the rest, on virtual servos of both protocols."""

import json
import signal
from collections.abc import Callable, Iterator
from math import degrees, radians
from pathlib import Path

import pytest

from drivers.servos.units import baud_code
from drivers.transport.ports import open_port
from missions.plugins.setup.servo.registers import info
from tests.missions.command import Outcome, Process, command
from tests.missions.servo_bench import Three, patient, three
from tests.waiting import wait_until

Servo = Callable[..., Outcome]

IDS = ("--ids", "1-4")
"""Where the scans of these tests look: every ID that is not there costs its time-out."""


@pytest.fixture
def robot(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Three]:
    monkeypatch.chdir(tmp_path)
    with three(Path("three.yaml"), patient(monkeypatch)) as found:
        yield found


@pytest.fixture
def servo(robot: Three, capsys: pytest.CaptureFixture[str]) -> Servo:
    """``mission servo COMMAND --robot three.yaml ...``."""

    def run(subcommand: str, *arguments: str) -> Outcome:
        return command(capsys, "servo", subcommand, "--robot", str(robot.path), *arguments)

    return run


# Looking


@pytest.mark.parametrize("framing", [(), ("--framing", "sdk")], ids=["ours", "the vendor's"])
def test_scan_shows_every_servo_with_model_and_state(servo: Servo, robot: Three, framing: tuple[str, ...]) -> None:
    robot.elbow.temperature, robot.wrist.voltage = 52.0, 11.1
    outcome = servo("scan", *IDS, "--baud", "1000000", *framing)
    assert outcome.code == 0, outcome.err
    rows = [line.split() for line in outcome.out.splitlines()]
    assert rows[0] == ["id", "protocol", "baud", "model", "firmware", "position", "volts", "degC", "joint", "errors"]
    assert rows[1] == ["1", "1.0", "1000000", "AX-12A", "24", "+0.0", "deg", "12.0", "35", "waist", "none"]
    assert rows[2][5:9] == ["+10.0", "deg", "12.0", "52"]
    assert rows[3][:5] == ["3", "2.0", "1000000", "XL430-W250", "45"]
    assert rows[3][7] == "11.1"


def test_scan_reports_differences_from_the_robot_file(servo: Servo, robot: Three) -> None:
    robot.waist.present = False
    robot.elbow.set("baud", baud_code(57_600, 1))
    text = robot.path.read_text().replace("XL430-W250", "XM430-W350")
    robot.path.write_text(text)
    outcome = servo("scan", *IDS)
    assert outcome.code == 1
    assert "waist (servo 1) does not reply" in outcome.err
    assert "elbow (servo 2) is at 57600 baud, the robot file says 1000000" in outcome.err
    assert "mission servo set 2 baud 1000000 --baud 57600" in outcome.err
    assert "wrist (servo 3) has another model: XL430-W250, the robot file says XM430-W350" in outcome.err
    assert "write model: XL430-W250" in outcome.err


def test_where_nothing_answers_the_causes_are_named(servo: Servo, robot: Three) -> None:
    for each in robot.bus.servos:
        each.present = False
    outcome = servo("scan", *IDS, "--baud", "57600")
    assert outcome.code == 1
    assert f"no servo replies on {robot.terminal.path} at 57600 baud" in outcome.err
    for cause in ("power", "cable", "adapter", "--all-bauds", "one ID", "another device"):
        assert cause in outcome.err


def test_a_port_alone_can_be_scanned_without_any_file(robot: Three, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ("--port", robot.terminal.path, "--baud", "1000000", "--protocol", "2", *IDS, "--json")
    outcome = command(capsys, "servo", "scan", *arguments)
    (found,) = [json.loads(line) for line in outcome.out.splitlines()]
    assert (outcome.code, found["id"], found["model"], found["errors"]) == (0, 3, "XL430-W250", [])


def test_info_explains_the_registers_of_either_protocol(servo: Servo, robot: Three) -> None:
    robot.elbow.set("return_delay", 0)
    lines = {line.split()[1]: line for line in servo("info", "elbow").out.splitlines() if line[:8].strip().isdigit()}
    assert lines["baud"].split()[2:5] == ["1", "1000000", "baud"]
    assert lines["return_delay"].split() == ["5", "return_delay", "0", "0", "µs", "250", "EEPROM"]
    assert "+10.0 deg" in lines["present_position"]
    assert lines["present_voltage"].split()[2:5] == ["120", "12", "V"]
    registers = json.loads(servo("info", "3", "--json").out)["registers"]
    assert (registers["operating_mode"], registers["present_position"]) == (3, 2048)


def test_the_monitor_shows_joints_in_their_own_angles_and_changes_nothing(servo: Servo, robot: Three) -> None:
    robot.waist.set("torque_enable", 1)
    robot.elbow.turn_by_hand(radians(10) - radians(30))
    before = [bytes(each.table) for each in robot.bus.servos]
    outcome = servo("info", "--json")
    joints = json.loads(outcome.out)["joints"]
    assert outcome.code == 0
    assert degrees(joints["elbow"]["position"]) == pytest.approx(30.0, abs=0.3)
    assert [joints[name]["torque"] for name in ("waist", "elbow", "wrist")] == [True, False, False]
    for each, was in zip(robot.bus.servos, before, strict=True):
        for name, register in each.model.table.registers.items():
            assert not register.writable or register.decode(was) == each.get(name), name


def test_servo_info_reports_silent_and_shut_down_joints(servo: Servo, robot: Three) -> None:
    robot.elbow.present = False
    robot.waist.set("torque_enable", 1)
    robot.waist.overload()
    outcome = servo("info")
    rows = {line.split()[0]: line for line in outcome.out.splitlines()}
    assert outcome.code == 1
    assert rows["elbow"].endswith("no reply")
    assert rows["waist"].endswith("overload, has shut down")


def test_ctrl_c_ends_the_live_monitor_and_frees_the_port(robot: Three) -> None:
    process = Process("servo", "info", "--robot", "three.yaml", "--json", "--watch", "20", folder=Path.cwd())
    process.wait_for_line(lambda line: '"wrist"' in line)
    assert process.end(signal.SIGINT) == 130
    open_port("test", robot.terminal.path, 1_000_000).close()


# Changing


def test_a_register_is_set_by_name_and_verified(servo: Servo, robot: Three) -> None:
    outcome = servo("set", "elbow", "return_delay", "0", "--yes")
    assert outcome.code == 0, outcome.err
    assert robot.elbow.get("return_delay") == 0
    assert outcome.out == "servo 2 (AX-12A): return_delay: 250 -> 0 (0 µs), EEPROM\nservo 2: written and verified\n"
    assert "has the value already" in servo("set", "elbow", "return_delay", "0").out


def test_the_eeprom_is_not_written_without_a_yes(servo: Servo, robot: Three) -> None:
    outcome = servo("set", "all", "return_delay", "0")
    assert (outcome.code, robot.elbow.get("return_delay")) == (2, 250)
    assert "add --yes" in outcome.err
    assert servo("set", "all", "return_delay", "0", "--yes").code == 0
    assert [each.get("return_delay") for each in robot.bus.servos] == [0, 0, 0]


def test_ram_is_written_without_a_question_and_below_zero_too(servo: Servo, robot: Three) -> None:
    assert servo("set", "3", "goal_velocity", "-7").code == 0
    assert robot.wrist.get("goal_velocity") == -7


def test_eeprom_write_turns_torque_off_and_reports_it(servo: Servo, robot: Three) -> None:
    robot.wrist.set("torque_enable", 1)
    outcome = servo("set", "wrist", "temperature_limit", "70", "--yes")
    assert "servo 3: torque was on, and is off now" in outcome.err
    assert (robot.wrist.get("temperature_limit"), robot.wrist.limp) == (70, True)


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (("elbow", "retrun_delay", "0"), 3, "did you mean return_delay"),
        (("elbow", "return_delay", "999"), 3, "0..254"),
        (("elbow", "present_voltage", "100"), 3, "present_voltage"),
        (("9", "led", "1"), 3, "try: mission servo scan --all-bauds --robot three.yaml"),
        (("253", "led", "1"), 3, "no reply from servo 253"),
        (("254", "led", "1"), 3, "a servo's ID is 0..253"),
        (("all", "torque_enable", "1"), 3, "mission servo torque on --robot FILE"),
        (("wrist", "profile_velocity", "0"), 3, "means full speed"),
        (("elbwo", "led", "1"), 2, "did you mean 'elbow'?"),
    ],
)
def test_invalid_servo_setting_gives_a_suggestion(
    servo: Servo, arguments: tuple[str, ...], code: int, words: str
) -> None:
    outcome = servo("set", *arguments, "--yes")
    assert outcome.code == code
    assert words in outcome.err


def test_servo_id_is_changed_unless_taken(servo: Servo, robot: Three) -> None:
    outcome = servo("set", "2", "id", "1", "--yes")
    assert (outcome.code, robot.elbow.get("id")) == (3, 2)
    assert "that ID is already taken" in outcome.err
    assert servo("set", "2", "id", "7", "--yes").code == 0
    assert robot.elbow.get("id") == 7


def test_baud_rate_of_all_servos_is_changed(servo: Servo, robot: Three) -> None:
    outcome = servo("set", "all", "baud", "57600", "--yes")
    assert outcome.code == 0, outcome.err
    assert "set baud: 57600 in the robot file" in outcome.err
    assert servo("info").code == 1
    assert servo("info", "--baud", "57600").code == 0
    assert robot.wrist.get("baud") == baud_code(57_600, 2)


# Moving


def test_torque_on_holds_the_present_angles_and_persists(servo: Servo, robot: Three) -> None:
    robot.elbow.turn_by_hand(radians(30))
    assert servo("torque", "on", "ax").code == 0
    assert [each.limp for each in robot.bus.servos] == [False, False, True]
    assert robot.elbow.angle == pytest.approx(radians(30), abs=0.01)
    assert servo("set", "ax", "led", "1").code == 0
    assert [each.get("led") for each in robot.bus.servos] == [1, 1, 0]
    outcome = servo("torque", "off", "--yes")
    assert outcome.out.splitlines() == [f"{name}: torque off" for name in ("waist (servo 1)", "elbow (servo 2)",
                                                                       "wrist (servo 3)")]  # fmt: skip
    assert all(each.limp for each in robot.bus.servos)


def test_torque_reports_unconfirmed_joints(servo: Servo, robot: Three) -> None:
    robot.elbow.present = False
    outcome = servo("torque", "off", "--yes")
    assert outcome.code == 1
    assert "elbow (servo 2): " in outcome.err
    assert "wrist (servo 3): torque off" in outcome.out


def test_servo_move_uses_joint_angles_and_relaxes_at_the_end(servo: Servo, robot: Three) -> None:
    outcome = servo("move", "elbow", "-30", "deg")
    assert outcome.code == 0, outcome.err
    assert "\nelbow is at -" in outcome.out
    assert robot.elbow.angle == pytest.approx(radians(10 + 30), abs=radians(2))
    assert all(each.limp for each in robot.bus.servos)  # at_end: relax


def test_servo_move_reports_a_clamped_goal(servo: Servo) -> None:
    outcome = servo("move", "elbow", "100 deg")
    assert (outcome.code, "its limit for +100.0 deg" in outcome.out) == (0, True)


def test_servo_move_fails_with_the_angle_of_a_stuck_joint(servo: Servo, robot: Three) -> None:
    robot.elbow.load = 2.0
    outcome = servo("move", "elbow", "40 deg")
    assert outcome.code == 1
    assert "joint elbow: commanded 0.70 rad, at 0.00 rad" in outcome.out


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (("move", "elbow", "30"), 2, "has no unit"),
        (("move", "elbwo", "30 deg"), 3, "did you mean 'elbow'?"),
        (("move", "elbow", "30 deg", "--speed", "0 deg/s"), 2, "above 0"),
        (("torque", "on", "elbwo"), 2, "did you mean 'elbow'?"),
        (
            ("move", "elbow", "30 deg", "--simulate", "--port", "/dev/u2d2"),
            2,
            "--port and --simulate cannot be used together",
        ),
        (("torque", "restart", "elbow"), 3, "protocol 1.0 has no restart"),
    ],
)
def test_invalid_servo_commands_are_refused(servo: Servo, arguments: tuple[str, ...], code: int, words: str) -> None:
    outcome = servo(*arguments)
    assert (outcome.code, words in outcome.err) == (code, True), outcome.err


def test_overloaded_servo_is_recovered_at_its_present_angle(servo: Servo, robot: Three) -> None:
    robot.path.write_text(robot.path.read_text().replace("at_end: relax", "at_end: hold"))
    assert servo("torque", "on").code == 0
    robot.elbow.overload()
    robot.wrist.overload()
    wait_until(lambda: robot.elbow.get("torque_limit") == 0 and robot.wrist.get("hardware_error") != 0)
    robot.elbow.turn_by_hand(radians(25))
    outcome = servo("torque", "recover")
    assert (outcome.code, outcome.out) == (0, "torque is on again: elbow, wrist\n"), outcome.err
    assert not robot.elbow.limp
    assert robot.elbow.angle == pytest.approx(radians(25), abs=0.01)
    assert (robot.wrist.get("hardware_error"), robot.wrist.limp) == (0, False)  # it has started again for that
    assert servo("torque", "recover").out == "no servo has shut down\n"


def test_recovered_arm_relaxes_again_as_configured(servo: Servo, robot: Three) -> None:
    robot.wrist.set("torque_enable", 1)
    robot.wrist.overload()
    wait_until(lambda: robot.wrist.get("hardware_error") != 0)
    outcome = servo("torque", "recover")
    said = "torque is on again: wrist\ntorque is off again, as the robot file says (at_end: relax)\n"
    assert (outcome.code, outcome.out) == (0, said), outcome.err
    assert robot.wrist.limp


def test_servo_that_fails_to_recover_is_reported_limp(
    servo: Servo, robot: Three, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        "missions.plugins.setup.servo.joint_commands.RECOVERY_TIMEOUT", 0.0
    )  # it takes longer than that to start
    robot.wrist.set("torque_enable", 1)
    robot.wrist.overload()
    wait_until(lambda: robot.wrist.get("hardware_error") != 0)
    outcome = servo("torque", "recover")
    assert (outcome.code, outcome.out) == (1, "")
    assert "torque is still off: wrist" in outcome.err


def test_torque_does_not_go_on_where_a_servo_has_shut_down(servo: Servo, robot: Three) -> None:
    for each in (robot.elbow, robot.wrist):
        each.set("torque_enable", 1)
        each.overload()
    wait_until(lambda: robot.elbow.get("torque_limit") == 0 and robot.wrist.get("hardware_error") != 0)
    outcome = servo("torque", "on")
    assert (outcome.code, outcome.out) == (1, "waist (servo 1): torque on\n")
    for title in ("elbow (servo 2)", "wrist (servo 3)"):
        assert (
            f"{title}: has shut down; its torque stays off\n  try: free the joint, then `mission servo torque recover"
            in (outcome.err)
        )
    assert robot.elbow.get("torque_limit") == 0


def test_torque_on_sets_torque_and_speed_of_the_robot_file(servo: Servo, robot: Three) -> None:
    text = robot.path.read_text().replace("zero: 10 deg,", "zero: 10 deg, torque: 50 %,")
    robot.path.write_text(text)
    assert servo("torque", "on", "elbow").code == 0
    assert robot.elbow.get("torque_limit") == pytest.approx(512, abs=1)
    assert robot.elbow.get("moving_speed") == pytest.approx(120 / 360 * 60 / 0.111, abs=2)


def test_torque_that_does_not_stay_on_is_reported(servo: Servo, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        "missions.plugins.setup.servo.joint_commands.restore_settings", lambda *_, **__: None
    )  # as if it took the order and dropped it
    outcome = servo("torque", "on", "elbow")
    assert (outcome.code, outcome.out) == (1, "")
    assert "elbow (servo 2): its torque does not stay on" in outcome.err


def test_a_servo_of_protocol_2_restarts(servo: Servo, robot: Three) -> None:
    robot.wrist.set("torque_enable", 1)
    robot.wrist.overload()
    wait_until(lambda: robot.wrist.get("hardware_error") != 0)
    outcome = servo("torque", "restart", "wrist")
    assert outcome.code == 0, outcome.err
    assert (robot.wrist.get("hardware_error"), robot.wrist.limp) == (0, True)


def test_missing_servo_port_gives_a_hint(capsys: pytest.CaptureFixture[str]) -> None:
    outcome = command(capsys, "servo", "scan", "--port", "/dev/nothing_here")
    assert outcome.code == 3
    assert "/dev/nothing_here: no such device" in outcome.err
    assert "try: mission ports" in outcome.err


def test_without_a_robot_all_is_simulated(capsys: pytest.CaptureFixture[str]) -> None:
    outcome = command(capsys, "servo", "info", "elbow", "gripper")
    assert [line.split()[0] for line in outcome.out.splitlines()] == ["joint", "elbow", "gripper"]
    assert outcome.err == "simulated servos; add --robot or --port for real ones\n"


@pytest.mark.parametrize("line", ["torque recover", "move elbow 5 deg", "info elbow", "set all return_delay 250"])
def test_servo_commands_report_simulated_servos(line: str, capsys: pytest.CaptureFixture[str]) -> None:
    outcome = command(capsys, "servo", *line.split())
    assert outcome.code == 0, outcome.err
    assert "simulated servos; add --robot or --port for real ones\n" in outcome.err


def test_servo_commands_do_not_call_real_servos_simulated(servo: Servo) -> None:
    assert servo("info").err == ""
    assert servo("info", "--simulate").err == "simulated servos, because of --simulate\n"


@pytest.mark.parametrize(
    ("words", "rate"), [("--watch elbow", 5.0), ("elbow --watch", 5.0), ("--watch 20 elbow", 20.0)]
)
def test_watch_option_takes_only_a_rate(words: str, rate: float) -> None:
    context = info.make_context("info", words.split())
    assert (context.params["rate"], context.params["servos"]) == (rate, ("elbow",))


@pytest.mark.parametrize("number", ["-1", "254", "300"])
def test_servo_id_out_of_range_is_refused(servo: Servo, number: str) -> None:
    outcome = servo("set", "2", "id", number, "--yes")
    assert (outcome.code, "they go from 0 to 253" in outcome.err) == (2, True), outcome.err


@pytest.mark.parametrize(
    "words", [("torque", "restart"), ("torque", "restart", "elbow", "wrist"), ("torque", "recover", "elbow")]
)
def test_torque_commands_with_wrong_servo_counts_are_refused(servo: Servo, words: tuple[str, ...]) -> None:
    assert servo(*words).code == 2
