"""``mission servo home``: Feetech servos calibrated by hand, in their EEPROM and in a file that LeRobot reads."""

import json
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from math import radians
from pathlib import Path

import pytest

from drivers.clock import Clock
from drivers.servos.bus import ServoAddress, ServoBus
from drivers.servos.calibration import HALF_TURN
from drivers.servos.joint import Joint, JointSpec
from drivers.servos.models import MODELS
from drivers.servos.virtual.chain import VirtualServoBus
from drivers.servos.virtual.servo import VirtualServo
from drivers.virtual.patient_clock import PatientClock
from drivers.virtual.terminal import PseudoTerminal
from missions.plugins.setup.servo.home import HomedServo, offset_for
from tests.cases import each
from tests.drivers.wired import Wired
from tests.missions.command import Outcome, command
from tests.missions.servo_bench import by_hand, patient

Mission = Callable[[str], Outcome]
STS = MODELS["STS3215"]
LEROBOT = Path(__file__).parent.parent / "other_programs" / "lerobot_client.py"

FILE = """\
robot: two
arm:
  driver: feetech
  port: PORT
  at_end: relax
  joints:
    elbow: {id: 1}
    jaw: {id: 2, zero_at: lowest}
"""


@pytest.fixture
def mission(capsys: pytest.CaptureFixture[str]) -> Mission:
    return lambda line: command(capsys, *line.split())


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> PatientClock:
    return patient(monkeypatch)


@pytest.fixture
def servos(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, clock: PatientClock) -> Iterator[VirtualServoBus]:
    """Two servos with their robot file in the folder of the test."""
    monkeypatch.chdir(tmp_path)
    servos = VirtualServoBus([VirtualServo(1, model="STS3215", angle=1.0), VirtualServo(2, model="STS3215")])
    with running(servos, clock) as port:
        Path("two.yaml").write_text(FILE.replace("PORT", port))
        yield servos


@contextmanager
def running(servos: VirtualServoBus, clock: Clock) -> Iterator[str]:
    terminal = PseudoTerminal("servos", servos, clock)
    terminal.open()
    try:
        yield terminal.path
    finally:
        terminal.close()


def turned(servos: VirtualServoBus, *angles: float) -> Iterator[None]:
    """Turn all servos by hand to these angles from where they stood (degrees), one after the other."""
    assert all(servo.limp for servo in servos.servos)
    stood = [servo.angle for servo in servos.servos]
    for angle in angles:
        for servo, place in zip(servos.servos, stood, strict=True):
            servo.turn_by_hand(place + radians(angle))
        yield


@pytest.mark.real_time
def test_home_writes_servos_and_a_restorable_file(
    servos: VirtualServoBus, clock: PatientClock, mission: Mission, monkeypatch: pytest.MonkeyPatch
) -> None:
    elbow, jaw = servos.servos
    elbow.set("torque_enable", 1)
    by_hand(monkeypatch, clock, turned(servos, -60.0, 50.0, 0.0))
    outcome = mission("servo home --robot two.yaml --into two.json --seconds 0.3 --yes")
    assert outcome.code == 0, outcome.err
    told = json.loads(Path("two.json").read_text())
    low, high = (HALF_TURN + round(radians(angle) / STS.tick) for angle in (-58.0, 48.0))
    for servo, name, offset in ((elbow, "elbow", round(1.0 / STS.tick) + 1), (jaw, "jaw", 1)):
        assert told[name]["id"] == servo.number
        assert told[name]["drive_mode"] == 0
        assert told[name]["homing_offset"] == servo.get("position_offset") == pytest.approx(offset, abs=1)
        assert told[name]["range_min"] == servo.get("min_position") == pytest.approx(low, abs=2)
        assert told[name]["range_max"] == servo.get("max_position") == pytest.approx(high, abs=2)
        assert servo.get("lock") == 1
        assert servo.limp
        servo.power_cycle()
        assert servo.get("position_offset") == told[name]["homing_offset"]
    assert f"add to the robot file: calibration: {Path('two.json').absolute()}" in outcome.out
    if find_spec("lerobot") is not None:
        for servo in (elbow, jaw):
            servo.turn_by_hand(servo.angle + radians(20))
        port = Path("two.yaml").read_text().split("port: ")[1].split()[0]
        client = [sys.executable, str(LEROBOT), "recognised", port, "two.json"]
        seen = json.loads(subprocess.run(client, capture_output=True, text=True, check=True).stdout)
        assert seen["is calibrated"]
        # Its 0 is the middle of the range, -5 degrees from the middle that was shown.
        assert seen["positions"] == pytest.approx({"elbow": 25.0, "jaw": 25.0}, abs=0.5)
    Path("two.yaml").write_text(Path("two.yaml").read_text().replace("at_end", "calibration: two.json\n  at_end"))
    jaw.factory_reset("id")
    outcome = mission("servo torque on --robot two.yaml")
    assert "has position offset 0, its calibration says 1" in outcome.err
    assert mission("servo home --restore --robot two.yaml --yes").code == 0
    assert mission("servo torque on --robot two.yaml").code == 0
    assert "the servos have these values already" in mission("servo home --restore --robot two.yaml --yes").out
    assert "calibrate with the program that wrote it" in mission("servo calibrate --robot two.yaml --seconds 1").err


def test_home_writes_nothing_after_too_little_motion(servos: VirtualServoBus, mission: Mission) -> None:
    outcome = mission("servo home --robot two.yaml --into two.json --seconds 0.3 --yes")
    assert outcome.code == 1
    assert "hardly moved" in outcome.out
    assert not Path("two.json").exists()
    assert [servo.get("position_offset") for servo in servos.servos] == [0, 0]


@pytest.mark.usefixtures("servos")
@each(
    ("line", "words"),
    [
        ("servo home --robot two.yaml --seconds 1 --yes", "--into so101.json"),
        ("servo home --robot two.yaml --into two.json --seconds 1", "add --yes"),
        ("servo home --robot two.yaml --into two.json --yes", "--seconds N"),
        ("servo home --robot turtlebot2_arm --into two.json --yes", "no Feetech servos"),
    ],
)
def test_home_reports_missing_arguments_before_joints_go_limp(mission: Mission, line: str, words: str) -> None:
    outcome = mission(line)
    assert outcome.code == 2
    assert words in outcome.err


@each("before", [0, 700, -2000])
@each("angle", [0.0, 2.9, -3.1])
def test_homing_offset_makes_the_present_position_half_a_turn(angle: float, before: int) -> None:
    servo = VirtualServo(1, model="STS3215", angle=angle)
    servo.set("position_offset", before)
    bus, place = Wired(VirtualServoBus([servo])).bus(), STS.table["present_position"]
    servo.set("position_offset", offset_for(bus.read(ServoAddress(1, "STS"), place), before))
    assert abs(bus.read(ServoAddress(1, "STS"), place) - HALF_TURN) <= 1


def test_range_up_to_the_encoder_seam_is_accepted() -> None:
    servo = VirtualServo(1, model="STS3215", angle=radians(170))
    bus: ServoBus = Wired(VirtualServoBus([servo])).bus()
    joint = Joint("roll", JointSpec(1, "STS3215"), STS)
    shown = bus.read(joint.address, STS.table["present_position"])
    homed = HomedServo(joint, 0, offset_for(shown, 0))
    for angle in (300, 349, 200, 60, 0, -5):  # of the servo: its own steps begin anew at 180
        servo.turn_by_hand(radians(angle))
        homed.sample(bus)
    assert homed.problem(0) == ""
    assert (homed.highest - homed.lowest) * STS.tick == pytest.approx(radians(354), abs=0.01)


def test_range_over_the_encoder_seam_is_refused_unless_a_whole_turn() -> None:
    servo = VirtualServo(1, model="STS3215", angle=radians(170))
    bus: ServoBus = Wired(VirtualServoBus([servo])).bus()
    joint = Joint("roll", JointSpec(1, "STS3215"), STS)
    homed = HomedServo(joint, 0, offset_for(bus.read(joint.address, STS.table["present_position"]), 0))
    for angle in (250, 300, 200, 60, -15):  # 130 degrees from where it stood one way, 185 the other
        servo.turn_by_hand(radians(angle))
        homed.sample(bus)
    assert "wrap around" in homed.problem(0)
    assert "--no-stops" in homed.problem(0)
    servo.turn_by_hand(radians(-65))
    homed.sample(bus)
    assert homed.problem(20) == ""
    found = homed.calibration(20, 0)
    assert (found.homing_offset, found.range_min, found.range_max) == (homed.offset, 0, 4095)


@pytest.mark.real_time
def test_a_joint_without_stops_need_not_be_turned(
    servos: VirtualServoBus, clock: PatientClock, mission: Mission, monkeypatch: pytest.MonkeyPatch
) -> None:
    elbow, jaw = servos.servos
    by_hand(monkeypatch, clock, turned_one(elbow, -60.0, 50.0))
    outcome = mission("servo home --robot two.yaml --into two.json --no-stops jaw --seconds 0.3 --yes")
    assert outcome.code == 0, outcome.err
    assert "turns all the way round" in outcome.out
    told = json.loads(Path("two.json").read_text())["jaw"]
    assert (told["range_min"], told["range_max"]) == (0, 4095)
    assert (jaw.get("min_position"), jaw.get("max_position")) == (0, 4095)
    wrong = mission("servo home elbow --robot two.yaml --into two.json --no-stops jaw --seconds 0.3 --yes")
    assert wrong.code == 2
    assert "jaw is not one of the calibrated joints" in wrong.err


def turned_one(servo: VirtualServo, *angles: float) -> Iterator[None]:
    stood = servo.angle
    for angle in angles:
        servo.turn_by_hand(stood + radians(angle))
        yield


# --- what LeRobot has calibrated is kept ------------------------------------------------------------------------------


@pytest.fixture
def lerobot(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the calibration file of LeRobot's that the servos were calibrated with, in its folder."""
    monkeypatch.setenv("HF_LEROBOT_CALIBRATION", str(tmp_path / "cache"))
    file = tmp_path / "cache/robots/so101_follower/mine.json"
    file.parent.mkdir(parents=True)
    motor = {"drive_mode": 0, "homing_offset": -1000, "range_min": 900, "range_max": 3000}
    file.write_text(json.dumps({"elbow": {"id": 1, **motor}, "jaw": {"id": 2, **motor}}))
    return file


def as_lerobot_sets(servo: VirtualServo) -> None:
    servo.set("position_offset", -1000)
    servo.set("min_position", 900)
    servo.set("max_position", 3000)
    servo.turn_by_hand((1948 - 1000 - 2048) * STS.tick)  # it shows 1948


def test_missing_calibration_file_is_suggested_for_narrow_limits(
    servos: VirtualServoBus, mission: Mission, lerobot: Path
) -> None:
    for servo in servos.servos:
        as_lerobot_sets(servo)
    for line in ("servo move elbow 10 deg --robot two.yaml", "robot check two.yaml", "doctor --robot two.yaml"):
        outcome = mission(line)
        told = outcome.out + outcome.err
        assert f"calibration: {lerobot}" in told, line
        assert "servo set" not in told
        assert "servo home" not in told
    text = Path("two.yaml").read_text()
    Path("two.yaml").write_text(text.replace("at_end", f"calibration: {lerobot}\n  at_end"))
    assert mission("servo move elbow 10 deg --robot two.yaml").code == 0


def test_matching_calibration_file_is_suggested_instead_of_an_old_one(
    servos: VirtualServoBus, mission: Mission, lerobot: Path
) -> None:
    old = json.loads(lerobot.read_text())
    for motor in old.values():
        motor["homing_offset"] = 77
    Path("old.json").write_text(json.dumps(old))
    text = Path("two.yaml").read_text()
    Path("two.yaml").write_text(text.replace("at_end", "calibration: old.json\n  at_end"))
    for servo in servos.servos:
        as_lerobot_sets(servo)
    told = mission("servo torque on --robot two.yaml").err
    assert f"LeRobot has recalibrated it: write calibration: {lerobot}" in told
    assert "restore" not in told
    before = [bytes(servo.table[:40]) for servo in servos.servos]
    outcome = mission("servo home --restore --robot two.yaml --yes")
    assert outcome.code != 0
    assert f"{lerobot} will no longer match them" in outcome.err
    assert [bytes(servo.table[:40]) for servo in servos.servos] == before
    lerobot.unlink()
    told = mission("servo torque on --robot two.yaml").err
    assert "name the file of that calibration" in told
    assert "restore" not in told


@each(
    ("content", "words"),
    [
        (None, "name the file as `ls` shows it"),
        ("{}", "no motors"),
        ('{"elbow": {"id": 1}}', "lacks 'homing_offset'"),
        (
            '{"homing_offset": [0], "drive_mode": [0], "start_pos": [0], "end_pos": [1], "motor_names": ["elbow"]}',
            "from before June 2025",
        ),
    ],
)
def test_a_wrong_calibration_file_leads_to_no_new_calibration(
    servos: VirtualServoBus, mission: Mission, content: str | None, words: str
) -> None:
    if content is not None:
        Path("mine.json").write_text(content)
    text = Path("two.yaml").read_text()
    Path("two.yaml").write_text(text.replace("at_end", "calibration: mine.json\n  at_end"))
    outcome = mission("servo torque on --robot two.yaml")
    assert outcome.code != 0
    assert words in outcome.err
    assert "servo home" not in outcome.err
    assert all(servo.limp for servo in servos.servos)
