"""``mission robot new``: from nothing to a mission, in few answers; left after each of them, and taken up again.

What is plugged in is virtual; the machine is recorded. Somebody answers the questions by what they ask for, and every
byte on the wires is kept.
"""

import json
import re
import sys
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, closing, contextmanager, suppress
from dataclasses import dataclass, field
from importlib.metadata import EntryPoint
from math import degrees
from pathlib import Path
from types import SimpleNamespace

import click
import cv2
import numpy as np
import pytest

from config.defaults import config_folder, load_defaults
from config.library import find_file
from config.robot import RobotConfig
from drivers.api import HeadPose
from drivers.arduino import wire as rosserial
from drivers.arduino.virtual import FIRST_SKETCH_ANGLES, VirtualRodney
from drivers.clock import SystemClock
from drivers.kobuki.virtual import VirtualKobuki
from drivers.servos import wire
from drivers.servos.declared import DynamixelKeys
from drivers.servos.feetech import FeetechKeys
from drivers.servos.virtual.chain import VirtualServoBus
from drivers.servos.virtual.servo import VirtualServo
from drivers.servos.wire import Protocol1Instruction
from drivers.sim.base_body import BaseBody
from drivers.transport import guardian_wire as lines
from drivers.virtual.terminal import PseudoTerminal, WireDevice
from drivers.waveshare.virtual import VirtualWaveshare
from missions.library.drivers import ENTRY_POINT_GROUP, load_robot
from missions.plugins.setup.robot.dialogue import Dialogue
from missions.plugins.setup.robot.new import new, run_dialogue
from tests.drivers.desks import RecordedMachine
from tests.drivers.sockets import Sockets
from tests.missions.command import command

PATIENCE = 0.03
"""Seconds that virtual devices on pseudo-terminals may be late, on a machine that has other things to do."""

MOST = 40
"""Answers within which a robot file is made."""


@dataclass
class Person:
    """Answers questions by what they ask for, else by Enter; leaves after ``stays`` answers."""

    answers: Mapping[str, str] = field(default_factory=dict)
    stays: int = 1000
    asked: list[str] = field(default_factory=list)

    def __call__(self, question: str, **_: object) -> str:
        if len(self.asked) >= self.stays:
            raise click.Abort
        self.asked.append(question)
        return next((answer for asks, answer in self.answers.items() if re.search(asks, question)), "")


class Workbench:
    """A recorded machine with virtual devices at its ports, and what is written to each of them.

    They are on pseudo-terminals only where they are to ``run``: to do more than answer.
    """

    def __init__(self, folder: Path, stack: ExitStack, patch: pytest.MonkeyPatch, *, run: bool = False) -> None:
        self.desk = RecordedMachine(folder / "machine")
        self._sockets = None if run else Sockets(patch)
        if self._sockets is not None:
            for room in ("device_scan", "servos"):
                patch.setattr(
                    f"missions.plugins.setup.robot.{room}.SystemClock", lambda clock=self._sockets.clock: clock
                )
        self.kept = folder / "state" / "robot_new.json"
        self.written: dict[str, list[bytes]] = {}
        self._stack, self._patch = stack, patch

    def plug(self, name: str, device: WireDevice, ids: str, serial: str = "") -> None:
        log, feed = self.written.setdefault(name, []), device.feed

        def logged(data: bytes, now: float) -> bytes:
            log.append(data)
            return feed(data, now)

        self._patch.setattr(device, "feed", logged)
        by_id, behind = f"usb-{serial}" if serial else "", ""
        if self._sockets is None:
            terminal = self._stack.enter_context(closing(PseudoTerminal(name, device, SystemClock())))
            terminal.open()
            behind = terminal.path
        port = self.desk.port(name, ids, serial=serial, by_id=by_id, behind=behind)
        if self._sockets is not None:
            self._sockets.devices[str(self.desk.machine.local_path(port))] = device

    def session(self, person: Person, *, yes: bool = False) -> None:
        self._patch.setattr(click, "prompt", person)
        with click.Context(new):
            run_dialogue(Dialogue(self.kept, yes=yes), self.desk.machine, None, extra_timeout=PATIENCE)

    def instructions(self, name: str) -> set[int]:
        """Return the instructions in frames of protocol 1.0, as Feetech's are too, that a port was sent."""
        return {packet.code for packet in wire.PacketParser().feed(b"".join(self.written[name]))}


@pytest.fixture
def bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Workbench]:
    with ExitStack() as stack:
        yield Workbench(tmp_path, stack, monkeypatch)


@pytest.fixture
def running(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Workbench]:
    """One whose devices run by themselves, for drivers with threads."""
    with ExitStack() as stack:
        yield Workbench(tmp_path, stack, monkeypatch, run=True)


def plug_turtlebot(bench: Workbench) -> VirtualRodney:
    nano = VirtualRodney(start_angles=FIRST_SKETCH_ANGLES)
    bench.plug("ttyUSB0", VirtualKobuki(), "0403:6001", "kobuki_7")
    bench.plug("ttyUSB1", VirtualServoBus([VirtualServo(number) for number in range(1, 11)]), "0403:6014", "FT7")
    bench.plug("ttyUSB2", nano, "1a86:7523")
    return nano


def plug_so101(bench: Workbench) -> VirtualServoBus:
    chain = VirtualServoBus([VirtualServo(number, model="STS3215") for number in range(1, 7)])
    bench.plug("ttyACM0", chain, "1a86:55d3", "5A7A01")
    return chain


READS = {Protocol1Instruction.PING, Protocol1Instruction.READ}
ROSIE = {"name of the robot": "rosie", "probe /dev/ttyUSB2": "y"}
ADA = {"name of the robot": "ada"}


def test_a_turtlebot_with_head_and_arm_greets_after_few_answers(
    bench: Workbench, capsys: pytest.CaptureFixture[str]
) -> None:
    nano = plug_turtlebot(bench)
    person = Person(ROSIE)
    bench.session(person)
    told = capsys.readouterr().out
    assert len(person.asked) < MOST
    assert "which of these robots is similar? its names, limits and values are used (turtlebot2_arm)" in person.asked
    config = load_robot(find_file("robots", "rosie"))
    assert config.parts == {"base", "head", "arm", "camera", "microphone", "voice", "screen"}
    assert load_defaults().robot == "rosie"
    text = (config_folder() / "robots/rosie.yaml").read_text()
    assert "port: /dev/serial/by-id/usb-kobuki_7" in text
    assert "# Maximum speed" in text
    rules = (config_folder() / "robots/rosie.rules").read_text()
    assert 'ATTRS{serial}=="kobuki_7", SYMLINK+="rosie_base"' in rules
    assert 'KERNELS=="1-3", SYMLINK+="rosie_head"' in rules
    assert "mission run greet --robot rosie --simulate" in told
    assert not bench.kept.exists()
    # Nothing moved, and nothing was written into a servo.
    assert bench.written["ttyUSB0"] == []
    assert bench.instructions("ttyUSB1") == READS
    assert nano.commands == []
    assert set(bench.written["ttyUSB2"]) == {rosserial.PROBE, lines.REPORT_REQUEST}
    ran = command(capsys, "run", "greet", "--simulate", "fast", "--eyes", "truth")
    assert ran.code == 0, ran.err


def test_an_so101_waves_after_few_answers(bench: Workbench, capsys: pytest.CaptureFixture[str]) -> None:
    plug_so101(bench)
    person = Person({**ADA, r"similar\?": "so101"})
    bench.session(person)
    assert len(person.asked) < MOST
    assert "next:" in (told := capsys.readouterr().out)
    assert "mission run wave --param gesture=arm_wave --robot ada --simulate" in told
    arm = load_robot(find_file("robots", "ada")).keys(DynamixelKeys)
    assert arm is not None
    assert [joint.id for joint in arm.joints.values()] == [1, 2, 3, 4, 5, 6]
    assert arm.port == "/dev/serial/by-id/usb-5A7A01"
    assert bench.instructions("ttyACM0") == READS
    ran = command(capsys, "run", "wave", "--param", "gesture=arm_wave", "--robot", "ada", "--simulate", "fast")
    assert ran.code == 0, ran.err


MINE = {
    name: {"id": number, "drive_mode": 0, "homing_offset": 10 * number, "range_min": 900, "range_max": 3000 + number}
    for number, name in enumerate(("pan", "lift", "elbow", "flex", "roll", "jaw"), 1)
}
"""A calibration of LeRobot's, with names of its own."""


def calibrate_so101(bench: Workbench) -> None:
    chain = plug_so101(bench)
    for servo, motor in zip(chain.servos, MINE.values(), strict=True):
        servo.set("position_offset", motor["homing_offset"])
        servo.set("min_position", motor["range_min"])
        servo.set("max_position", motor["range_max"])


@pytest.mark.parametrize("like", ["so101", "none"])
def test_robot_new_offers_a_lerobot_calibration(
    bench: Workbench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, like: str
) -> None:
    calibrate_so101(bench)
    monkeypatch.setenv("HF_LEROBOT_HOME", str(tmp_path))
    file = tmp_path / "calibration/robots/so_follower/mine.json"
    file.parent.mkdir(parents=True)
    file.write_text(json.dumps(MINE))
    (file.parent / "other.json").write_text(json.dumps({"pan": {**MINE["pan"], "homing_offset": 7}}))
    person = Person({**ADA, r"similar\?": like})
    bench.session(person)
    assert any(f"({file}): use this calibration?" in asked for asked in person.asked)
    assert not any("find the limits" in asked for asked in person.asked)
    arm = load_robot(find_file("robots", "ada")).keys(FeetechKeys)
    assert arm is not None
    assert arm.calibration == str(file)
    assert {name: joint.id for name, joint in arm.servos.items()} == {name: it["id"] for name, it in MINE.items()}
    assert all(joint.limits is None for joint in arm.joints.values())
    assert bench.instructions("ttyACM0") == READS


def test_robot_new_uses_servo_limits_without_a_calibration_file(
    bench: Workbench, capsys: pytest.CaptureFixture[str]
) -> None:
    calibrate_so101(bench)
    bench.session(Person({**ADA, r"similar\?": "so101"}))
    assert "were calibrated by another program" in capsys.readouterr().out
    arm = load_robot(find_file("robots", "ada")).keys(FeetechKeys)
    assert arm is not None
    low, high = (arm.joints["gripper"].servo_model.ticks(end) for end in arm.joints["gripper"].angle_limits)
    assert (low, high) == (900, 3006)


@pytest.mark.parametrize("model", ["pi_car", "wave_rover"])
def test_robot_new_creates_an_unplugged_car_from_a_shipped_one(
    bench: Workbench, capsys: pytest.CaptureFixture[str], model: str
) -> None:
    person = Person({"name of the robot": "beep", r"similar\?": model})
    bench.session(person)
    assert len(person.asked) < MOST
    config = load_robot(find_file("robots", "beep"))
    assert {kind: section.driver.name for kind, section in config.sections.items()} == {
        kind: section.driver.name for kind, section in load_robot(find_file("robots", model)).sections.items()
    }
    greeting = {"pi_car": "greet", "wave_rover": "square_3m"}[model]
    assert f"mission run {greeting} --robot beep --simulate" in capsys.readouterr().out
    if model == "pi_car":
        ran = command(capsys, "run", "greet", "--simulate", "fast", "--eyes", "truth")
        assert ran.code == 0, ran.err
        assert "Hello!" in ran.out


def test_robot_new_asks_for_the_joint_names_of_an_unknown_arm(bench: Workbench) -> None:
    bench.plug("ttyUSB0", VirtualServoBus([VirtualServo(4, model="MX-28"), VirtualServo(7)]), "0403:6014", "FT7")
    person = Person({"name of the robot": "kit", r"similar\?": "none", "servo 4": "hip", "servo 7": "knee"})
    bench.session(person)
    arm = load_robot(find_file("robots", "kit")).keys(DynamixelKeys)
    assert arm is not None
    assert {name: (joint.id, joint.model) for name, joint in arm.joints.items()} == {
        "hip": (4, "MX-28"),
        "knee": (7, "AX-12A"),
    }
    assert len(person.asked) < MOST


@pytest.mark.parametrize("robot", ["turtlebot", "so101", "pi_car"])
def test_robot_new_continues_after_an_interruption_at_any_question(bench: Workbench, robot: str) -> None:
    if robot != "pi_car":
        plug_turtlebot(bench) if robot == "turtlebot" else plug_so101(bench)
    answers = {
        "turtlebot": ROSIE,
        "so101": {**ADA, r"similar\?": "so101"},
        "pi_car": {"name of the robot": "beep", r"similar\?": "pi_car"},
    }[robot]
    asked: list[str] = []
    for _ in range(MOST):
        person = Person(answers, stays=1)
        with suppress(click.Abort):
            bench.session(person)
            break
        asked += person.asked
    else:
        pytest.fail(f"not done after {MOST} answers: {asked}")
    assert len(asked) == len(set(asked)), "nothing is asked twice"
    if robot == "pi_car":
        assert load_defaults().robot == "", "none of it is plugged in"
    else:
        assert find_file("robots", "mine").is_file()
    assert all(bench.instructions(name) <= READS for name in bench.written if name in {"ttyUSB1", "ttyACM0"})


def test_all_defaults_move_nothing_and_leave_an_arduino_alone(bench: Workbench) -> None:
    nano = plug_turtlebot(bench)
    person = Person()
    bench.session(person, yes=True)
    assert person.asked == []
    assert find_file("robots", "my_robot").is_file()
    assert load_defaults().robot == "", "this computer's robot stays as it was"
    assert nano.commands == []
    assert bench.written["ttyUSB2"] == []
    assert bench.instructions("ttyUSB1") == READS


def test_robot_new_asks_which_of_two_similar_robots(bench: Workbench, capsys: pytest.CaptureFixture[str]) -> None:
    plug_so101(bench)
    question = "which of these robots is similar? its names, limits and values are used"
    person = Person({**ADA, r"similar\?": "so101_leader"})
    bench.session(person)
    assert question in person.asked, "nothing is proposed"
    told = capsys.readouterr().out
    assert "so101: SO-101 follower arm, six Feetech STS3215; the computer's voice. (its arm holds its position)" in told
    assert "(the torque of its arm goes off at the end)" in told
    arm = load_robot(find_file("robots", "ada")).keys(DynamixelKeys)
    assert arm is not None
    assert arm.at_end == "relax"


def test_where_two_robots_fit_all_defaults_take_the_safe_one(bench: Workbench) -> None:
    plug_so101(bench)
    bench.session(Person(), yes=True)
    arm = load_robot(find_file("robots", "my_robot")).keys(DynamixelKeys)
    assert arm is not None
    assert arm.at_end == "hold"
    assert all(joint.torque <= 0.5 for joint in arm.joints.values())
    assert load_defaults().robot == ""


def test_defaults_taken_with_yes_are_not_saved_as_answers(bench: Workbench, monkeypatch: pytest.MonkeyPatch) -> None:
    plug_so101(bench)

    def cut(*_: object) -> None:
        raise click.Abort

    with monkeypatch.context() as patch:
        patch.setattr(sys.modules[run_dialogue.__module__], "write_new", cut)
        with pytest.raises(click.Abort):
            bench.session(Person(), yes=True)
    person = Person({**ADA, r"similar\?": "so101_leader"})
    bench.session(person)
    assert [asked for asked in person.asked if "name of the robot" in asked or "similar?" in asked] == [
        "what is the name of the robot? (my_robot)",
        "which of these robots is similar? its names, limits and values are used",
    ]
    arm = load_robot(find_file("robots", "ada")).keys(DynamixelKeys)
    assert arm is not None
    assert arm.at_end == "relax"


def test_yes_keeps_the_saved_choice_of_a_similar_robot(bench: Workbench) -> None:
    plug_so101(bench)
    with pytest.raises(click.Abort):
        bench.session(Person({**ADA, r"similar\?": "so101_leader"}, stays=2))
    bench.session(Person(), yes=True)
    arm = load_robot(find_file("robots", "ada")).keys(DynamixelKeys)
    assert arm is not None
    assert arm.at_end == "relax"


def test_servos_of_other_models_are_no_known_arm(bench: Workbench) -> None:
    servos = VirtualServoBus([VirtualServo(number, model="AX-18A") for number in range(1, 11)])
    bench.plug("ttyUSB1", servos, "0403:6014", "FT7")
    bench.session(Person({"name of the robot": "strong"}))
    arm = load_robot(find_file("robots", "strong")).keys(DynamixelKeys)
    assert arm is not None
    assert {joint.model for joint in arm.joints.values()} == {"AX-18A"}


def plug_strangers(bench: Workbench) -> None:
    servos = [VirtualServo(number, model="XM430-W350") for number in (1, 2, 3)]
    for stranger in servos[1:]:
        stranger.set("model_number", 1125)
    bench.plug("ttyUSB1", VirtualServoBus(servos), "0403:6014", "FT7")


def test_robot_new_asks_for_an_unknown_servo_model(bench: Workbench) -> None:
    plug_strangers(bench)
    person = Person({"name of the robot": "kit", "model is servo 2": "XM430-W350", "model is servo 3": "none"})
    bench.session(person)
    assert any("which model is servo 2, which reports number 1125?" in asked for asked in person.asked)
    arm = load_robot(find_file("robots", "kit")).keys(DynamixelKeys)
    assert arm is not None
    assert {joint.id: joint.model for joint in arm.joints.values()} == {1: "XM430-W350", 2: "XM430-W350"}


def test_all_defaults_leave_servos_of_unknown_models_out(bench: Workbench) -> None:
    plug_strangers(bench)
    bench.session(Person(), yes=True)
    arm = load_robot(find_file("robots", "my_robot")).keys(DynamixelKeys)
    assert arm is not None
    assert {joint.id: joint.model for joint in arm.joints.values()} == {1: "XM430-W350"}


def test_duplicate_servo_ids_are_changed_after_consent(bench: Workbench) -> None:
    one, other = VirtualServo(1, angle=0.4), VirtualServo(1, angle=-0.7)
    bench.plug("ttyUSB0", VirtualServoBus([one, other]), "0403:6014", "FT7")

    class Hand(Person):
        """Plugs in one servo after the other, as it is asked to."""

        def __call__(self, question: str, **told: object) -> str:
            if "connect only one servo" in question:
                done = sum("connect only one servo" in each for each in self.asked)
                one.present, other.present = done == 0, done == 1
                super().__call__(question)
                return ("1", "2", "done")[done]
            return super().__call__(question, **told)

    person = Hand({"name of the robot": "kit", r"similar\?": "none", "give them new IDs": "y", "into the EEPROM": "y"})
    bench.session(person)
    assert (one.number, other.number) == (1, 2)
    assert [each for each in person.asked if "EEPROM?" in each] == ["  AX-12A: write id 1 -> 2 into the EEPROM? [y/N]"]
    arm = load_robot(find_file("robots", "kit")).keys(DynamixelKeys)
    assert arm is not None
    assert [joint.id for joint in arm.joints.values()] == [1, 2]


def test_robot_new_writes_no_servo_without_consent(bench: Workbench, capsys: pytest.CaptureFixture[str]) -> None:
    bench.plug("ttyUSB0", VirtualServoBus([VirtualServo(1, angle=0.4), VirtualServo(1)]), "0403:6014", "FT7")
    with suppress(click.Abort):
        bench.session(Person({"name of the robot": "kit", r"similar\?": "none"}, stays=20))
    assert "two servos have the same ID" in capsys.readouterr().out
    assert bench.instructions("ttyUSB0") == READS


def test_joint_limits_are_measured_by_turning_the_limp_joint(bench: Workbench, monkeypatch: pytest.MonkeyPatch) -> None:
    servo = VirtualServo(1)
    bench.plug("ttyUSB0", VirtualServoBus([servo]), "0403:6014", "FT7")

    def turned(_: Dialogue, look: object, question: str) -> None:
        assert "turn each joint" in question
        assert callable(look)
        for angle in (-0.5, 0.9):
            servo.turn_by_hand(angle)
            look()

    monkeypatch.setattr(Dialogue, "watch_until_enter", turned)
    bench.session(Person({"name of the robot": "kit", r"similar\?": "none", "find the limits": "y"}))
    arm = load_robot(find_file("robots", "kit")).keys(DynamixelKeys)
    assert arm is not None
    lower, upper = (degrees(end) for end in arm.joints["joint1"].angle_limits)
    assert lower == pytest.approx(-28.6 + 2, abs=0.5)
    assert upper == pytest.approx(51.6 - 2, abs=0.5)


@pytest.mark.real_time
def test_robot_new_sets_flip_and_trim_of_a_head(running: Workbench) -> None:
    nano = plug_turtlebot(running)
    person = Person({**ROSIE, "may the head move": "y", "did it turn to ITS left": "n", "askew in tilt": "3"})
    running.session(person)
    head = load_robot(find_file("robots", "rosie")).head
    assert head is not None
    text = (config_folder() / "robots/rosie.yaml").read_text()
    assert re.search(r"pan: \{servo: 0, .*flip: true\}", text)
    assert re.search(r"tilt: \{servo: 1, .*flip: true, trim: 3 deg\}", text)
    moved = {index for index, _ in nano.commands}
    assert moved == {0, 1}
    assert all(80 <= angle <= 100 + 20 * index for index, angle in nano.commands)  # its sketch starts tilt at 120
    assert nano.max_step <= 10


@pytest.mark.parametrize(("grey", "told"), [(0, "the pictures are black"), (128, "have a single colour")])
def test_robot_new_reports_blank_camera_pictures(
    bench: Workbench, capsys: pytest.CaptureFixture[str], tmp_path: Path, grey: int, told: str
) -> None:
    picture = tmp_path / "dark.png"
    cv2.imwrite(str(picture), np.full((480, 640, 3), grey, np.uint8))
    person = Person(
        {
            "name of the robot": "kit",
            r"similar\?": "wave_rover",
            "does it have the base": "n",
            "camera source": str(picture),
        }
    )
    bench.session(person)
    assert told in capsys.readouterr().out


def test_robot_new_asks_again_for_an_invalid_name(bench: Workbench, capsys: pytest.CaptureFixture[str]) -> None:
    class Slow(Person):
        def __call__(self, question: str, **told: object) -> str:
            super().__call__(question, **told)
            names = [each for each in self.asked if "name of the robot" in each]
            return ("turtlebot2", "two words", "kit")[len(names) - 1] if "name of the robot" in question else ""

    bench.session(Slow())
    out = capsys.readouterr().out
    assert "turtlebot2 ships with MissionTree: choose another name" in out
    assert "'two words' is not a valid name" in out
    assert find_file("robots", "kit").is_file()


def test_robot_new_command_saves_answers_when_interrupted(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    root = str(RecordedMachine(tmp_path / "machine").root)
    monkeypatch.setattr(click, "prompt", Person({"name of the robot": "kit"}, stays=2))
    left = command(capsys, "robot", "new", "--root", root)
    assert left.code == 130
    assert "`mission robot new` continues" in left.err
    monkeypatch.setattr(click, "prompt", Person())
    done = command(capsys, "robot", "new", "--root", root)
    assert done.code == 0
    assert "what is the name of the robot?: kit  (saved answer)" in done.out
    assert find_file("robots", "kit").is_file()


@pytest.mark.parametrize("held", [{"a": 1}, "../../kit", "k" * 100_000, "two words"])
def test_saved_robot_name_is_validated_again(bench: Workbench, held: object) -> None:
    bench.kept.parent.mkdir(parents=True, exist_ok=True)
    bench.kept.write_text(json.dumps({"name": held}))
    bench.session(Person({"name of the robot": "kit"}))
    assert find_file("robots", "kit").is_file()


@pytest.mark.parametrize("held", ["null", "[1]", "3", "[" * 100_000])
def test_invalid_saved_answers_are_ignored(tmp_path: Path, held: str) -> None:
    kept = tmp_path / "robot_new.json"
    kept.write_text(held)
    assert not Dialogue(kept).has_answers


def test_robot_new_sets_flip_and_trim_of_an_i2c_head(bench: Workbench, monkeypatch: pytest.MonkeyPatch) -> None:
    looked: list[HeadPose] = []

    @contextmanager
    def opened_head(config: RobotConfig, ports: Mapping[str, str], *, head: str) -> Iterator[SimpleNamespace]:
        assert (config.name, ports, head) == ("beep", {}, "head")
        yield SimpleNamespace(look=looked.append)

    monkeypatch.setattr("missions.plugins.setup.robot.part_trials.open_head", opened_head)
    answers = {"name of the robot": "beep", r"similar\?": "pi_car", "may the head move": "y"}
    bench.session(Person({**answers, "did it turn to ITS left": "n", "askew in pan": "3"}))
    assert not looked  # there is no such bus on this machine
    (config_folder() / "robots/beep.yaml").unlink()
    bus = bench.desk.machine.local_path("/dev/i2c-1")
    bus.parent.mkdir(parents=True, exist_ok=True)
    bus.touch()
    bench.session(Person({**answers, "did it turn to ITS left": "n", "askew in pan": "3"}))
    assert len(looked) == 5
    pan = load_robot(find_file("robots", "beep")).sections["head"].keys.pan
    assert (pan.flip, round(degrees(pan.trim))) == (True, 3)


def test_robot_new_asks_which_of_two_bases(bench: Workbench, capsys: pytest.CaptureFixture[str]) -> None:
    bench.plug("ttyUSB0", VirtualKobuki(), "0403:6001", "kobuki_7")
    bench.plug("ttyUSB1", VirtualWaveshare(BaseBody(), track=0.17, unit=1.0, encoders=False), "10c4:ea60", "rover_1")
    person = Person(
        {"name of the robot": "kit", r"similar\?": "none", "which one": "waveshare at /dev/serial/by-id/usb-rover_1"}
    )
    bench.session(person)
    config = load_robot(find_file("robots", "kit"))
    assert config.sections["base"].driver.name == "waveshare"
    assert config.sections["base"].keys.port == "/dev/serial/by-id/usb-rover_1"
    out = capsys.readouterr().out
    assert "a robot has only one base: " in out
    assert bench.written["ttyUSB0"] == []


@pytest.mark.real_time
def test_robot_new_names_and_tries_a_second_head(running: Workbench) -> None:
    nano, mast = VirtualRodney(start_angles=FIRST_SKETCH_ANGLES), VirtualRodney(start_angles=FIRST_SKETCH_ANGLES)
    running.plug("ttyUSB0", nano, "1a86:7523", "one")
    running.plug("ttyUSB1", mast, "1a86:7523", "two")
    servos = {"pan servo": "0", "tilt servo": "1"}
    names = {"another head": "lidar_mast", "probe /dev": "y"}
    tried = {"may the lidar_mast move": "y", "did it turn to ITS left": "n"}
    running.session(Person({"name of the robot": "kit", r"similar\?": "none", **names, **servos, **tried}))
    config = load_robot(find_file("robots", "kit"))
    assert config.sections["head"].keys.port == "/dev/serial/by-id/usb-one"
    assert config.sections["lidar_mast"].driver.kind == "head"
    assert config.sections["lidar_mast"].keys.port == "/dev/serial/by-id/usb-two"
    assert nano.commands == []
    assert mast.commands
    assert [config.sections[name].keys.pan.flip for name in ("head", "lidar_mast")] == [False, True]
    assert "kit_lidar_mast" in (config_folder() / "robots/kit.rules").read_text()


def test_robot_new_names_a_second_arm_and_its_joints(bench: Workbench) -> None:
    plug_so101(bench)
    second = VirtualServoBus([VirtualServo(number, model="STS3215") for number in (1, 2)])
    bench.plug("ttyACM1", second, "1a86:55d3", "5A7A02")
    names = {"another arm": "right_arm", "servo 1 of the right_arm": "lift", "servo 2 of the right_arm": "grip"}
    bench.session(
        Person({**ADA, r"similar\?": "so101", "which one": "feetech at /dev/serial/by-id/usb-5A7A01", **names})
    )
    config = load_robot(find_file("robots", "ada"))
    assert config.extra_parts == {"right_arm": "arm"}
    keys = config.sections["right_arm"].keys
    assert {name: joint.id for name, joint in keys.joints.items()} == {"lift": 1, "grip": 2}
    assert keys.port == "/dev/serial/by-id/usb-5A7A02"
    assert config.arm is not None
    assert len(config.arm.limits) == 6
    assert bench.instructions("ttyACM1") == READS


def test_robot_new_adds_undetected_parts_by_driver(bench: Workbench, capsys: pytest.CaptureFixture[str]) -> None:
    parts = "head.arduino, head.arduino_second, voice.print"
    person = Person(
        {"name of the robot": "kit", r"similar\?": "none", "other parts": parts, "another head": "lidar_mast",
         r"head\.pan servo": "0", r"head\.tilt servo": "1", r"mast\.pan servo": "2", r"mast\.tilt servo": "3"}
    )  # fmt: skip
    bench.session(person)
    config = load_robot(find_file("robots", "kit"))
    drivers = {part: section.driver.name for part, section in config.sections.items()}
    assert drivers == {"head": "arduino", "lidar_mast": "arduino_second", "voice": "print"}
    assert "  voice: voice.auto, voice.espeak," in capsys.readouterr().out


def test_robot_new_offers_drivers_of_other_distributions(
    bench: Workbench, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(str(Path(__file__).parents[1] / "sample_distribution"))
    points = [
        EntryPoint("base.rover", "sample_robot.declared:ROVER", ENTRY_POINT_GROUP),
        EntryPoint("head.lame", "sample_robot.nowhere:LAME", ENTRY_POINT_GROUP),
    ]
    monkeypatch.setattr(
        "missions.library.drivers.entry_points_of", lambda group: points if group == ENTRY_POINT_GROUP else []
    )

    class Slow(Person):
        def __call__(self, question: str, **told: object) -> str:
            answer = super().__call__(question, **told)
            tries = sum("other parts" in each for each in self.asked)
            return ("head.lame", "base.rover")[tries - 1] if "other parts" in question else answer

    person = Slow({"name of the robot": "kit", r"similar\?": "none", "base port": "/dev/ttyUSB7", "base other": "n"})
    bench.session(person)
    config = load_robot(find_file("robots", "kit"))
    assert config.sections["base"].driver.name == "rover"
    out = capsys.readouterr().out
    assert re.search("^  base: base.kobuki, .*, base.rover$", out, re.MULTILINE)
    assert "'head.lame' cannot be used: head.lame = sample_robot.nowhere:LAME cannot be imported" in out


def test_the_arm_of_a_neck_is_added(bench: Workbench, capsys: pytest.CaptureFixture[str]) -> None:
    answers = {
        "name of the robot": "kit",
        r"similar\?": "none",
        "other parts": "head.dynamixel",
        "how many servos": "2",
        "servo 1 ": "pan",
        "servo 2 ": "tilt",
        "head.pan joint": "pan",
        "head.tilt joint": "tilt",
        "arm baud": "57600",
    }
    bench.session(Person(answers, stays=MOST))
    config = load_robot(find_file("robots", "kit"))
    assert config.parts == {"voice", "arm", "head"}
    assert config.sections["arm"].keys.baud == 57600
    out = capsys.readouterr().out
    assert "head.dynamixel needs an arm: arm.dynamixel is added" in out
    assert "  mission servo calibrate --robot kit   (the limits of its joints, by hand)\n" in out
    assert "  mission doctor --robot kit\n" in out


def test_a_neck_of_unknown_joints_is_left_out(bench: Workbench, capsys: pytest.CaptureFixture[str]) -> None:
    answers = {"name of the robot": "kit", r"similar\?": "none", "other parts": "head.dynamixel", "joint:": "neck"}
    bench.session(Person(answers, stays=MOST))
    assert load_robot(find_file("robots", "kit")).parts == {"voice", "arm"}
    assert "the same error again" not in capsys.readouterr().out


def test_without_a_device_all_defaults_write_no_robot(bench: Workbench) -> None:
    with pytest.raises(click.UsageError, match="no device of a robot found"):
        bench.session(Person(), yes=True)


def test_unsaved_answers_are_reported_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "state").touch()  # no folder, so that nothing can be written in it
    talk = Dialogue(tmp_path / "state" / "robot_new.json")
    for key in ("name", "like"):
        talk.save_answer(key, "kit")
    assert not talk.is_saved
    assert capsys.readouterr().out.count("answers cannot be saved") == 1
    (tmp_path / "state").unlink()
    talk.save_answer("base", "none")
    assert talk.is_saved
    assert Dialogue(tmp_path / "state" / "robot_new.json").has_answer("name")  # type: ignore[unreachable]
