"""Torque goes off when somebody holds the arm: after Enter at a terminal, after --yes without one."""

import io
import os
import sys
from collections.abc import Callable, Iterator
from errno import ENOSPC
from math import radians, sin
from pathlib import Path
from stat import S_ISDIR
from typing import Any, Self

import pytest

from config.yaml_edit import rewrite
from config.yaml_writer import write_new
from drivers.servos.models import MODELS
from drivers.servos.settings import apply_changes
from drivers.servos.virtual.chain import VirtualServoBus
from drivers.servos.virtual.servo import VirtualServo
from drivers.virtual.patient_clock import PatientClock
from drivers.virtual.terminal import PseudoTerminal
from missions.plugins.setup.servo import calibration_origin
from missions.plugins.setup.servo.home import HomedServo
from tests.missions.command import Outcome, command
from tests.missions.servo_bench import Three, by_hand, patient, three
from tests.missions.test_servo_home import FILE

Run = Callable[[str], Outcome]

COMMANDS = [
    "servo record shown --joint elbow --seconds 0.2 --robot three.yaml",
    "servo calibrate elbow --seconds 0.2 --robot three.yaml",
    "servo torque off elbow --robot three.yaml",
    "servo set elbow return_delay 0 --robot three.yaml",
    "servo set elbow id 9 --robot three.yaml",
    "servo set elbow baud 500000 --robot three.yaml",
    "servo set elbow torque_enable 0 --robot three.yaml",
]


class TypingTerminal(io.StringIO):
    """A terminal at which somebody answers every question with yes."""

    def isatty(self) -> bool:
        return True

    def fileno(self) -> int:
        return 0


class Person:
    """Somebody at the keys, who looks at ``stiff`` servos before pressing Enter, or ``gives_up``."""

    gives_up = False

    def __init__(self, look: Callable[[], bool]) -> None:
        self.look = look
        self.seen: list[bool] = []

    def __call__(self, descriptor: int) -> Self:  # noqa: ARG002 - as Keys is made
        return self

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """Leave the keys."""

    def read(self, timeout: float) -> str:  # noqa: ARG002 - as Keys has it
        self.seen.append(self.look())
        if len(self.seen) < 4:
            return ""
        if self.gives_up:
            raise KeyboardInterrupt
        return "enter"


@pytest.fixture
def robot(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Three]:
    monkeypatch.chdir(tmp_path)
    with three(Path("three.yaml"), patient(monkeypatch), at_end="hold") as found:
        found.elbow.set("torque_enable", 1)
        yield found


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Run:
    return lambda line: command(capsys, *line.split())


@pytest.fixture
def person(robot: Three, monkeypatch: pytest.MonkeyPatch) -> Person:
    found = Person(lambda: not robot.elbow.limp)
    monkeypatch.setattr("missions.plugins.setup.servo.connections.KeyReader", found)
    monkeypatch.setattr(sys, "stdin", TypingTerminal("y\n" * 9))
    return found


@pytest.mark.parametrize("line", COMMANDS)
def test_torque_stays_on_until_enter(robot: Three, run: Run, person: Person, line: str) -> None:
    outcome = run(line)
    assert "goes off: hold the arm" in outcome.err, outcome.err
    assert person.seen[:4] == [True] * 4
    assert robot.elbow.limp or "record" in line


@pytest.mark.parametrize("line", COMMANDS)
def test_ctrl_c_before_enter_changes_nothing(robot: Three, run: Run, person: Person, line: str) -> None:
    person.gives_up = True
    before = bytes(robot.elbow.table[:24])
    assert run(line).code == 130
    assert not robot.elbow.limp
    assert bytes(robot.elbow.table[:24]) == before


@pytest.mark.parametrize("line", COMMANDS)
def test_without_a_terminal_stiff_joints_stay_stiff_but_for_yes(robot: Three, run: Run, line: str) -> None:
    outcome = run(line)
    assert outcome.code == 2
    assert "--yes" in outcome.err
    assert not robot.elbow.limp
    run(f"{line} --yes")
    assert robot.elbow.limp is ("record" not in line)  # which ends with at_end: hold


WEAKER = [
    *("torque_limit 0", "torque_limit 500", "punch 0", "cw_compliance_slope 254", "ccw_compliance_margin 255"),
    *("goal_pwm 0", "position_p_gain 0"),
]


def weakened(robot: Three, wish: str) -> tuple[str, VirtualServo]:
    """Return the command for a wish, and the stiff servo that it is for."""
    joint = "wrist" if wish.startswith(("goal_pwm", "position_p_gain")) else "elbow"
    robot.wrist.set("torque_enable", 1)
    return f"servo set {joint} {wish} --robot three.yaml", getattr(robot, joint)


@pytest.mark.parametrize("wish", WEAKER)
def test_a_stiff_joint_gets_less_force_after_enter(robot: Three, run: Run, person: Person, wish: str) -> None:
    line, servo = weakened(robot, wish)
    name, value = wish.split()
    before = servo.get(name)
    person.look = lambda: servo.get(name) == before
    outcome = run(line)
    assert "will hold with less force: hold the arm" in outcome.err
    assert (outcome.code, person.seen, servo.get(name)) == (0, [True] * 4, int(value)), outcome.err


@pytest.mark.parametrize("wish", WEAKER)
def test_weakening_a_stiff_joint_without_a_terminal_needs_yes(robot: Three, run: Run, wish: str) -> None:
    line, servo = weakened(robot, wish)
    name, value = wish.split()
    before = servo.get(name)
    outcome = run(line)
    assert (outcome.code, "--yes" in outcome.err, servo.get(name)) == (2, True, before), outcome.err
    assert run(f"{line} --yes").code == 0
    assert servo.get(name) == int(value)


def test_limp_or_strengthened_joint_needs_no_consent(robot: Three, run: Run) -> None:
    robot.elbow.set("torque_limit", 100)
    assert run("servo set elbow torque_limit 1023 --robot three.yaml").code == 0
    assert run("servo set waist torque_limit 100 --robot three.yaml").code == 0
    assert (robot.elbow.get("torque_limit"), robot.waist.get("torque_limit")) == (1023, 100)


def test_a_restart_waits_for_enter(robot: Three, run: Run, person: Person) -> None:
    robot.wrist.set("torque_enable", 1)
    person.look = lambda: not robot.wrist.limp
    outcome = run("servo torque restart wrist --robot three.yaml")
    assert (outcome.code, person.seen) == (0, [True] * 4), outcome.err


# Looking before a long procedure


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> PatientClock:
    return patient(monkeypatch)


@pytest.fixture
def arm(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, clock: PatientClock) -> Iterator[VirtualServo]:
    """A stiff STS3215 with its robot file."""
    monkeypatch.chdir(tmp_path)
    servo, jaw = VirtualServo(1, model="STS3215"), VirtualServo(2, model="STS3215")
    servo.set("torque_enable", 1)
    terminal = PseudoTerminal("servos", VirtualServoBus([servo, jaw]), clock)
    terminal.open()
    Path("two.yaml").write_text(FILE.replace("PORT", terminal.path))
    yield servo
    terminal.close()


def blocked(path: Path, how: str) -> str:
    """Make a place where nothing can be written; return its name."""
    if how == "missing folder":
        return "nowhere/found.json"
    if how == "folder":
        path.mkdir()
    elif how == "pipe":
        os.mkfifo(path)
    elif how == "link into nowhere":
        path.symlink_to("nowhere/found.json")
    elif how == "link to itself":
        path.symlink_to(path.name)
    elif how == "file for a folder":
        Path("plain").write_text("")
        return "plain/found.json"
    elif how == "full disk":
        path.symlink_to("/dev/full")
    return path.name


HOWS = [
    *("missing folder", "folder", "pipe", "link into nowhere", "link to itself", "file for a folder", "full disk"),
]


@pytest.mark.parametrize("how", HOWS)
def test_home_checks_its_file_before_joints_go_limp(arm: VirtualServo, run: Run, how: str) -> None:
    before = bytes(arm.table[:40])
    outcome = run(f"servo home --robot two.yaml --into {blocked(Path('found.json'), how)} --seconds 0.2 --yes")
    assert outcome.code == 2, outcome.err
    assert "--into" in outcome.err
    assert not arm.limp
    assert bytes(arm.table[:40]) == before


def test_a_full_disk_is_noticed_before_anything_goes_limp(
    arm: VirtualServo, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(_: int) -> None:
        raise OSError(ENOSPC, "No space left on device")

    monkeypatch.setattr("missions.cli.outputs.os.fsync", full)
    outcome = run("servo home --robot two.yaml --into found.json --seconds 0.2 --yes")
    assert (outcome.code, "df -h" in outcome.err) == (2, True), outcome.err
    assert not arm.limp
    assert not Path("found.json").exists()
    assert [each.name for each in Path().iterdir()] == ["two.yaml"]


@pytest.mark.parametrize("how", HOWS)
def test_play_checks_its_csv_file_before_motion(arm: VirtualServo, run: Run, how: str) -> None:
    Path("nod.yaml").write_text("gesture: nod\nkeyframes:\n  - {at: 0 s, elbow: 5 deg}\n  - {at: 1 s, elbow: 9 deg}\n")
    before = arm.get("goal_position")
    outcome = run(f"servo play nod.yaml --robot two.yaml --csv {blocked(Path('found.csv'), how)}")
    assert (outcome.code, "--csv" in outcome.err) == (2, True), outcome.err
    assert arm.get("goal_position") == before


@pytest.mark.parametrize("how", HOWS)
def test_record_checks_its_file_before_joints_go_limp(arm: VirtualServo, run: Run, how: str) -> None:
    name = blocked(Path("found.json"), how)
    outcome = run(f"servo record shown --robot two.yaml -o {name} --force --seconds 0.2 --yes")
    assert outcome.code == 2, outcome.err
    assert not arm.limp


def turned(servo: VirtualServo) -> Iterator[None]:
    """Turn a limp servo by hand, to and fro."""
    for step in range(60):
        servo.turn_by_hand(radians(20) * sin(step / 5))
        yield


def test_unwritable_recording_is_saved_elsewhere(
    arm: VirtualServo, run: Run, monkeypatch: pytest.MonkeyPatch, clock: PatientClock
) -> None:
    by_hand(monkeypatch, clock, turned(arm))
    monkeypatch.setenv("XDG_STATE_HOME", str(Path("state").absolute()))
    monkeypatch.setattr("missions.cli.outputs._write_file", _fail)
    outcome = run("servo record shown --robot two.yaml --seconds 1 --yes")
    assert outcome.code == 1, outcome.err
    assert arm.limp  # at_end: relax
    (saved,) = Path("state/missiontree/rescued").iterdir()
    assert str(saved) in outcome.err
    assert "gesture: shown" in saved.read_text()


def _fail(*_: object) -> None:
    raise OSError(28, "No space left on device")


def test_home_changes_no_servo_with_an_unwritable_calibration(
    arm: VirtualServo, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(Path("state").absolute()))
    monkeypatch.setattr("missions.cli.outputs._write_file", _fail)
    monkeypatch.setattr(HomedServo, "problem", lambda *_: "")
    outcome = run("servo home --robot two.yaml --into found.json --seconds 0.2 --yes")
    assert outcome.code == 1
    assert arm.get("position_offset") == 0
    (saved,) = Path("state/missiontree/rescued").iterdir()
    assert '"elbow"' in saved.read_text()


class Disk:
    """What a power cut would leave: content and names of files as of the last ``fsync`` of each file and folder."""

    def __init__(self, patch: pytest.MonkeyPatch) -> None:
        self._content: dict[int, bytes] = {}
        self._names: dict[str, int] = {}
        self._sync = os.fsync
        patch.setattr(os, "fsync", self._fsync)

    def _fsync(self, number: int) -> None:
        self._sync(number)
        found, path = os.fstat(number), f"/proc/self/fd/{number}"
        if S_ISDIR(found.st_mode):
            self._names |= {each.path: each.stat().st_ino for each in os.scandir(Path(path).readlink())}
        else:
            self._content[found.st_ino] = Path(path).read_bytes()

    def read(self, path: Path) -> bytes:
        """Return the content of a file after a power cut; nothing where its name or its content is lost."""
        return self._content.get(self._names.get(str(path.absolute()), -1), b"")


@pytest.mark.parametrize("anew", [True, False])
def test_a_calibration_is_on_the_disk_before_any_servo_is_changed(
    arm: VirtualServo, run: Run, monkeypatch: pytest.MonkeyPatch, anew: bool
) -> None:
    files = [Path("found.json"), Path("found.servos.json")]
    if not anew:
        files[0].write_text(CALIBRATION)
    disk, kept = Disk(monkeypatch), list[bool]()

    def apply_after_look(*words: Any) -> bool:
        kept.extend(disk.read(each) == each.read_bytes() for each in files)
        return apply_changes(*words)

    monkeypatch.setattr(sys.modules[HomedServo.__module__], "apply_changes", apply_after_look)
    monkeypatch.setattr(HomedServo, "problem", lambda *_: "")
    outcome = run("servo home elbow --robot two.yaml --into found.json --seconds 0.2 --yes")
    assert (outcome.code, kept) == (0, [True, True]), outcome.err
    assert arm.get("max_position") != 4095
    if not anew:
        assert disk.read(Path("found.json.bak")) == Path("found.json.bak").read_bytes()


def test_robot_files_are_synced_to_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    disk, path = Disk(monkeypatch), tmp_path / "mine.yaml"
    write_new(path, "robot: mine\n")
    assert disk.read(path) == b"robot: mine\n"
    rewrite(path, "robot: other\n")
    assert disk.read(path) == b"robot: other\n"


# Restoring

CALIBRATION = (
    '{"elbow": {"id": 1, "drive_mode": 0, "homing_offset": 0, "range_min": 1000, "range_max": 3000}, '
    '"jaw": {"id": 2, "drive_mode": 0, "homing_offset": 0, "range_min": 1000, "range_max": 3000}}'
)
RESTORE = "servo home --restore --robot two.yaml --into found.json --yes"


def settings(servo: VirtualServo) -> list[int]:
    return [servo.get(name) for name in ("position_offset", "min_position", "max_position")]


def test_a_restore_into_the_servos_of_the_calibration(arm: VirtualServo, run: Run) -> None:
    Path("found.json").write_text(CALIBRATION)
    outcome = run(RESTORE)
    assert outcome.code == 0, outcome.err
    assert settings(arm) == [0, 1000, 3000]


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        ('"elbow"', '"arm_elbow"', "has no motor 'elbow'; it has arm_elbow, jaw"),
        ('"id": 1', '"id": 7', "motor 'elbow' has ID 7, the joint 1"),
        ('"homing_offset": 0, "range_min": 1000', '"homing_offset": 1500, "range_min": 1000', "beyond its range"),
    ],
)
def test_a_restore_refuses_a_calibration_of_other_servos(
    arm: VirtualServo, run: Run, before: str, after: str, words: str
) -> None:
    Path("found.json").write_text(CALIBRATION.replace(before, after, 1))
    outcome = run(RESTORE)
    assert outcome.code == 3, outcome.err
    assert words in outcome.err
    assert settings(arm) == [0, 0, 4095]
    assert not arm.limp


def break_origin(how: str) -> None:
    """Leave a file of origins that does not say which servos were calibrated."""
    file, entry = Path("found.servos.json"), {"model_number": 777, "firmware": 2563}
    whole = calibration_origin.settings_text({"elbow": entry, "jaw": entry})
    broken = {
        "empty": "",
        "truncated": whole[:40],
        "zeros": "\0" * len(whole),
        "list": "[1]",
        "no servos": "{}",
        "entry without settings": '{"elbow": {}}',
        "entry that is none": '{"elbow": 7}',
        "entry without firmware": '{"elbow": {"model_number": 777}}',
        "words for numbers": whole.replace("777", '"777"'),
        "truth for a number": whole.replace("777", "true"),
        "brackets": "[" * 100_000,
        "too large": whole + " " * calibration_origin.MAX_FILE_BYTES,
    }
    if how == "folder":
        file.mkdir()
    elif how == "pipe":
        os.mkfifo(file)
    elif how == "link into nowhere":
        file.symlink_to("nowhere.json")
    elif how == "no text":
        file.write_bytes(b"\xff\xfe")
    else:
        file.write_text(broken[how])


BREAKS = [
    *("empty", "truncated", "zeros", "list", "no servos", "entry without settings", "entry that is none"),
    *("entry without firmware", "words for numbers", "truth for a number", "brackets", "too large", "folder", "pipe"),
    *("link into nowhere", "no text"),
]


@pytest.mark.parametrize("how", BREAKS)
def test_restore_with_an_unreadable_origin_is_refused(arm: VirtualServo, run: Run, how: str) -> None:
    Path("found.json").write_text(CALIBRATION)
    break_origin(how)
    outcome = run(RESTORE)
    assert (outcome.code, "found.servos.json: the servos of this calibration are unknown" in outcome.err) == (
        3,
        True,
    ), outcome.err
    assert "--other-servos" in outcome.err
    assert settings(arm) == [0, 0, 4095]
    assert not arm.limp
    assert run(f"{RESTORE} --other-servos").code == 0
    assert settings(arm) == [0, 1000, 3000]


@pytest.mark.parametrize("how", [each for each in BREAKS if each not in ("folder", "pipe", "link into nowhere")])
def test_home_with_an_unreadable_origin_is_refused(arm: VirtualServo, run: Run, how: str) -> None:
    Path("found.json").write_text(CALIBRATION)
    break_origin(how)
    before = Path("found.servos.json").read_bytes()
    outcome = run("servo home elbow --robot two.yaml --into found.json --seconds 0.2 --yes")
    assert (outcome.code, "mv found.servos.json found.servos.json.bad" in outcome.err) == (3, True), outcome.err
    assert not arm.limp
    assert Path("found.servos.json").read_bytes() == before
    assert Path("found.json").read_text() == CALIBRATION


def test_a_restore_refuses_servos_with_other_firmware_or_settings(arm: VirtualServo, run: Run) -> None:
    Path("found.json").write_text(CALIBRATION)
    registers = [each for each in MODELS["STS3215"].table.registers.values() if each.eeprom]
    same = {each.name: arm.get(each) for each in registers if each.name not in calibration_origin.NOT_COMPARED}
    Path("found.servos.json").write_text(calibration_origin.settings_text({"elbow": {**same, "return_delay": 9}}))
    outcome = run(RESTORE)
    assert (outcome.code, "return_delay 0, was 9" in outcome.err) == (3, True), outcome.err
    assert settings(arm) == [0, 0, 4095]
    Path("found.servos.json").write_text(calibration_origin.settings_text({"elbow": {**same, "firmware": 9}}))
    outcome = run(RESTORE)
    assert (outcome.code, "the calibration is of 9" in outcome.err) == (3, True), outcome.err
    assert settings(arm) == [0, 0, 4095]
    assert run(f"{RESTORE} --other-servos").code == 0
    assert settings(arm) == [0, 1000, 3000]
