"""``mission doctor``: the computer alone, a robot on virtual devices, its report without secrets, and its cures."""

import ast
import json
import os
import re
import shlex
from collections.abc import Callable, Iterator
from contextlib import closing, suppress
from pathlib import Path

import click
import pytest

from config.defaults import config_folder
from drivers.api.driver import Driver, DriverContext, Finding
from drivers.kobuki.commands import COMMANDS, RequestExtra
from drivers.kobuki.virtual import VirtualKobuki
from drivers.kobuki.wire import KobukiFrameFinder, decode
from drivers.servos.virtual.chain import VirtualServoBus
from drivers.servos.virtual.servo import VirtualServo
from drivers.virtual.patient_clock import PatientClock
from drivers.virtual.terminal import PseudoTerminal, WireDevice
from missions.assembly.learnt_delays import MIN_SAMPLES, LearntDelays
from missions.library.drivers import load_robot
from missions.library.folders import checkup_file
from missions.plugins.setup.checkup import PartFinding, check_folders
from missions.plugins.setup.doctor.report import anonymise, private_words, report_text
from tests.drivers.desks import RecordedMachine, sent_instructions
from tests.missions.command import Outcome, command
from tests.missions.test_help import FILES, parsed

Mission = Callable[..., Outcome]

ROOT = Path(__file__).parents[2]

PING, READ = 1, 2

ROBOT = """robot: kit
base: {driver: kobuki, port: /dev/kobuki}
head:
  driver: arduino
  port: /dev/nano
  pan: {servo: 0, limits: [-80 deg, 80 deg]}
  tilt: {servo: 1, limits: [-60 deg, 20 deg]}
arm:
  driver: dynamixel
  port: /dev/u2d2
  joints: {shoulder: {id: 1, limits: [-90 deg, 90 deg]}, elbow: {id: 2, limits: [-90 deg, 90 deg]}}
voice: {driver: print}
"""


@pytest.fixture
def mission(capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Mission:
    monkeypatch.chdir(tmp_path)
    Path("kit.yaml").write_text(ROBOT)
    return lambda *arguments: command(capsys, "doctor", *arguments)


@pytest.fixture
def desk(tmp_path: Path) -> RecordedMachine:
    return RecordedMachine(tmp_path / "machine")


@pytest.fixture
def servos() -> list[VirtualServo]:
    return [VirtualServo(1), VirtualServo(2)]


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> PatientClock:
    """The command's clock, which waits for the virtual devices."""
    clock = PatientClock()
    monkeypatch.setattr("missions.plugins.setup.doctor.SystemClock", lambda: clock)
    return clock


@pytest.fixture
def plugged(desk: RecordedMachine, servos: list[VirtualServo], clock: PatientClock) -> Iterator[None]:
    """Plug a Kobuki, the arm and a Nano in."""
    devices: dict[str, WireDevice] = {"kobuki": VirtualKobuki(), "u2d2": VirtualServoBus(servos)}
    terminals = [PseudoTerminal(name, device, clock) for name, device in devices.items()]
    for number, (terminal, name) in enumerate(zip(terminals, devices, strict=True)):
        terminal.open()
        ids, serial = ("0403:6001", "kobuki_A6013") if name == "kobuki" else ("0403:6014", "FT4THVLX")
        desk.port(f"ttyUSB{number}", ids, serial=serial, behind=terminal.path, rule=name, latency=1)
    desk.port("ttyUSB7", "1a86:7523", rule="nano")
    yield
    for terminal in terminals:
        with closing(terminal):
            pass


def findings(outcome: Outcome) -> dict[tuple[str, str], dict[str, str]]:
    """What a command has found, by part and what it is about."""
    return {(each["part"], each["about"]): each for each in json.loads(outcome.out)["findings"]}


def test_a_computer_without_a_robot_is_looked_at_alone(mission: Mission, desk: RecordedMachine) -> None:
    told = mission("--root", str(desk.root))
    assert told.code == 0
    assert told.out.startswith("computer\n  ok      program: MissionTree ")
    assert "robot: no default robot is set on this computer\n" in told.out
    assert "try: mission robot use NAME, or: mission robot new\n" in told.out
    assert re.search(r"^0 wrong, \d+ warnings, \d+ ok$", told.out.splitlines()[-1])


@pytest.mark.usefixtures("plugged")
def test_doctor_lists_a_healthy_robot_and_does_not_reset_its_board(mission: Mission, desk: RecordedMachine) -> None:
    told = mission("--robot", "kit.yaml", "--root", str(desk.root), "--json")
    found = findings(told)
    assert told.code == 0
    assert found["base", "battery"]["message"] == "16.5 V"
    assert found["arm", "elbow (servo 2)"]["message"].startswith("AX-12A, firmware")
    nano = found["head", "port"]
    assert nano["verdict"] == "ok"
    assert "not probed" in nano["message"]
    assert json.loads(told.out)["ok"] is True
    assert found["voice", "driver"]["message"] == "print: not checked, because its driver has no check-up"
    assert found["base", "delay"]["message"] == "not learnt yet"
    kit = LearntDelays(load_robot(Path("kit.yaml")), simulated=False)
    kit.lag.seconds, kit.lag.spread, kit.lag.reports = 0.19, 0.003, MIN_SAMPLES
    kit.save()
    again = findings(mission("--robot", "kit.yaml", "--root", str(desk.root), "--json"))
    assert again["base", "delay"]["message"] == "190 ms, learnt in earlier runs"


@pytest.mark.usefixtures("plugged")
def test_doctor_reports_servo_faults_with_fixes_and_exits_with_1(
    mission: Mission, desk: RecordedMachine, servos: list[VirtualServo]
) -> None:
    servos[0].voltage = 9.0
    servos[1].overload()
    told = mission("--robot", "kit.yaml", "--root", str(desk.root))
    assert told.code == 1
    assert "  warning shoulder (servo 1): 9.0 V is low for a servo made for 12 V\n            try: charge" in told.out
    wanted = (
        "  wrong   elbow (servo 2): it has shut down: overload\n"
        "            try: remove the cause, then: mission servo torque recover --robot kit.yaml\n"
    )
    assert wanted in told.out


def test_doctor_reports_unplugged_parts(mission: Mission, desk: RecordedMachine) -> None:
    told = mission("--robot", "kit.yaml", "--root", str(desk.root), "--json")
    assert told.code == 1
    found = findings(told)
    for part, port in (("base", "/dev/kobuki"), ("head", "/dev/nano"), ("arm", "/dev/u2d2")):
        assert found[part, "port"]["message"] == f"no device at {port}"
        assert found[part, "port"]["fix"].startswith("mission ports")


def test_doctor_refuses_a_port_for_a_missing_part(mission: Mission) -> None:
    told = mission("--robot", "kit.yaml", "--port", "screen=/dev/ttyUSB0")
    assert (told.code, "the robot has no screen" in told.err) == (2, True)


def failing(keys: object, site: DriverContext) -> Iterator[Finding]:
    yield Finding("lamp", str(type(keys).__name__) + str(bool(site.clock)))
    raise ZeroDivisionError


@pytest.mark.usefixtures("plugged")
def test_failing_checkup_of_a_driver_does_not_stop_the_others(
    mission: Mission, desk: RecordedMachine, monkeypatch: pytest.MonkeyPatch
) -> None:
    from drivers.kobuki import declared  # noqa: PLC0415

    foreign = Driver("kobuki", "base", "", declared.KobukiKeys, make="", checkup=f"{__name__}:failing")
    monkeypatch.setattr(declared, "KOBUKI", foreign)
    found = findings(mission("--robot", "kit.yaml", "--root", str(desk.root), "--json"))
    assert found["base", "lamp"]["message"] == "KobukiKeysTrue"
    assert found["base", "driver"]["message"] == "the check-up of base.kobuki fails: ZeroDivisionError: "
    assert ("arm", "elbow (servo 2)") in found


class Logged:
    """A device on a wire that keeps what was sent to it."""

    def __init__(self, device: WireDevice) -> None:
        self._device = device
        self.sent: list[tuple[int, bytes]] = []

    @property
    def baud(self) -> int:
        return self._device.baud

    def feed(self, data: bytes, now: float) -> bytes:
        self.sent.append((self.baud, data))
        return self._device.feed(data, now)

    def poll(self, now: float) -> bytes:
        return self._device.poll(now)


def test_doctor_sends_only_read_requests(mission: Mission, desk: RecordedMachine, clock: PatientClock) -> None:
    servos = [VirtualServo(1), VirtualServo(2, model="XM430-W350")]  # of which one is not what the file says
    base, arm = Logged(VirtualKobuki()), Logged(VirtualServoBus(servos))
    terminals = list[PseudoTerminal]()
    for number, (name, device) in enumerate({"kobuki": base, "u2d2": arm}.items()):
        terminal = PseudoTerminal(name, device, clock)
        terminal.open()
        desk.port(f"ttyUSB{number}", "0403:6014", behind=terminal.path, rule=name)
        terminals.append(terminal)
    try:
        assert mission("--robot", "kit.yaml", "--root", str(desk.root)).code == 1
    finally:
        for terminal in terminals:
            terminal.close()
    assert arm.sent
    assert sent_instructions(arm.sent) <= {PING, READ}
    parts = [
        part
        for _, data in base.sent
        for frame in KobukiFrameFinder().feed(data)
        for part in decode(frame, COMMANDS).parts
    ]
    assert {type(part) for part in parts} <= {RequestExtra}


# The report


def test_doctor_reports_the_debug_port_of_a_raspberry_pi_5(
    mission: Mission, desk: RecordedMachine, tmp_path: Path
) -> None:
    desk.write("proc/device-tree/model", "Raspberry Pi 5 Model B Rev 1.0")
    desk.write("sys/class/tty/ttyAMA10/type", "32")
    (desk.root / "sys/class/tty/ttyAMA10/device").mkdir()
    desk.write("dev/ttyAMA10", "")
    (desk.root / "dev/serial0").symlink_to("ttyAMA10")
    rover = "robot: rover\nbase: {driver: waveshare, port: /dev/serial0, encoders: true, track: 0.2 m}\n"
    (tmp_path / "rover.yaml").write_text(rover)
    told = mission("--robot", str(tmp_path / "rover.yaml"), "--root", str(desk.root))
    assert told.code == 1
    assert "/dev/serial0: leads to the debug connector of this Raspberry Pi 5 (/dev/ttyAMA10)" in told.out
    assert "port: /dev/ttyAMA0" in told.out


@pytest.mark.usefixtures("plugged")
def test_doctor_report_is_anonymous(
    mission: Mission, desk: RecordedMachine, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("HOME", "/home/marvin")
    monkeypatch.setenv("USER", "marvin")
    desk.write("etc/hostname", "heart-of-gold")
    desk.write("etc/os-release", 'PRETTY_NAME="Raspberry Pi OS"')
    desk.write("proc/device-tree/model", "Raspberry Pi 5 Model B")
    told = mission("--robot", "kit.yaml", "--root", str(desk.root), "--report", "help.txt")
    assert told.out.splitlines()[-1] == "wrote help.txt; read it before you send it"
    text = (tmp_path / "help.txt").read_text()
    assert "Raspberry Pi 5 Model B" in text
    assert "Raspberry Pi OS" in text
    assert "numpy 2" in text
    assert "ok       base battery: 16.5 V" in text
    for secret in ("marvin", "heart-of-gold", "FT4THVLX", "A6013"):
        assert secret not in text


def test_names_keys_addresses_and_folders_are_taken_out_of_a_text() -> None:
    told = (
        "camera rtsp://ann:pass@192.168.1.7/live?token=abc1 of /home/ann/robots/kit.yaml on zaphod, "
        "key 3f9a8c7b6d5e4f3a2b1c0d9e, /dev/serial/by-id/usb-FTDI_USB__-__Serial_FT4THVLX-if00-port0"
    )
    assert anonymise(told, {"zaphod": "HOST", "ann": "USER"}) == (
        "camera rtsp://SECRET@ADDRESS/live?token=SECRET of ~/robots/kit.yaml on HOST, "
        "key SECRET, /dev/serial/by-id/usb-FTDI_USB__-__Serial_SERIAL-if00-port0"
    )


def test_private_words_are_those_of_this_machine(desk: RecordedMachine, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("USER", "trillian")
    desk.port("ttyUSB0", "0403:6014", serial="FT4THVLX")
    known = private_words(desk.machine)
    assert known["FT4THVLX"] == "SERIAL"
    assert known["trillian"] == "USER"
    assert "" not in known
    text = report_text(desk.machine, [PartFinding("arm", Finding("port", "at FT4THVLX, says trillian"))])
    assert text.endswith("ok       arm port: at SERIAL, says USER\n")


# The cures


def cures() -> Iterator[tuple[str, str]]:
    """Yield every `mission ...` in the texts of what looks at machines and devices, with its file."""
    files = [*ROOT.glob("drivers/*/checkup.py"), *ROOT.glob("drivers/*/probe.py"), *ROOT.glob("drivers/finding/*.py")]
    files += [ROOT / "missions/plugins/setup/checkup.py", *ROOT.glob("missions/plugins/setup/doctor/*.py")]
    for file in files:
        tree = ast.parse(file.read_text())
        documentation = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
        inner = {id(part) for node in ast.walk(tree) if isinstance(node, ast.JoinedStr) for part in node.values}
        for node in ast.walk(tree):
            if id(node) in documentation | inner:
                continue
            if isinstance(node, ast.JoinedStr):
                text = "".join(str(part.value) if isinstance(part, ast.Constant) else "1" for part in node.values)
            elif isinstance(node, ast.Constant) and isinstance(node.value, str):
                text = node.value
            else:
                continue
            for found in re.findall(r"\bmission (?:[a-z]+)(?: [^;,()`\s]+)*", text.replace("\n", " ; ")):
                yield file.name, found


def test_every_suggested_fix_is_a_valid_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name in FILES:
        Path(name).touch()
    told = list(cures())
    assert len(told) > 15
    for file, text in told:  # the words on the command itself are no command
        words = [word.replace("ROBOT", "humanoid").replace("NEW", "7") for word in shlex.split(text)[1:]]
        with suppress(click.exceptions.Exit):  # --help
            assert parsed(words).command.get_short_help_str(), file


@pytest.mark.usefixtures("plugged")
def test_suggested_fix_recovers_a_shut_down_servo(
    mission: Mission, desk: RecordedMachine, servos: list[VirtualServo], capsys: pytest.CaptureFixture[str]
) -> None:
    servos[1].overload()
    asked = ("--robot", "kit.yaml", "--root", str(desk.root), "--json")
    shut = findings(mission(*asked))["arm", "elbow (servo 2)"]
    assert shut["message"] == "it has shut down: overload"
    servos[1].load = 0.0  # the cause is removed
    cure = shlex.split(shut["fix"].partition("then: mission ")[2])
    port = str(Path(desk.root / "dev/u2d2").resolve())
    assert command(capsys, *cure, "--port", port).code == 0
    assert findings(mission(*asked))["arm", "elbow (servo 2)"]["verdict"] == "ok"


def test_checkup_file_for_the_studio_is_anonymous(mission: Mission, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("USER", "trillian")
    Path("kit.yaml").write_text(ROBOT.replace("/dev/kobuki", "/dev/trillian"))
    assert mission("--robot", "kit.yaml").code == 1
    kept = json.loads(checkup_file().read_text())
    told = {(each["part"], each["about"]): each for each in kept["ailing"]}
    assert kept["robot"] == "kit"
    assert told["base", "port"]["message"] == "no device at /dev/USER"
    assert told["base", "port"]["verdict"] == "wrong"
    assert all(each["verdict"] != "ok" for each in kept["ailing"])


def test_suggested_fix_for_a_second_arm_names_it(
    mission: Mission, desk: RecordedMachine, clock: PatientClock, tmp_path: Path
) -> None:
    file = tmp_path / "pair.yaml"
    file.write_text(
        "robot: pair\nright_arm:\n  kind: arm\n  driver: dynamixel\n  port: /dev/u2d2\n  joints:\n    lift: {id: 1}\n"
    )
    servo = VirtualServo(1)
    servo.overload()
    with closing(PseudoTerminal("u2d2", VirtualServoBus([servo]), clock)) as terminal:
        terminal.open()
        desk.port("ttyUSB0", "0403:6014", behind=terminal.path, rule="u2d2")
        told = mission("--robot", str(file), "--root", str(desk.root), "--json")
    assert findings(told)["right_arm", "lift (servo 1)"]["fix"].endswith(f"--robot {file} --arm right_arm")


def test_doctor_reports_the_default_robot(mission: Mission, desk: RecordedMachine) -> None:
    at = ("--root", str(desk.root))
    assert "robot: no default robot is set on this computer" in mission(*at).out
    file = config_folder() / "defaults.yaml"
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text("robot: nobody\n")
    gone = mission(*at)
    assert gone.code == 1
    assert (
        f"robot: this computer's own robot, set in {file}, cannot be used: {file}: 'robot': unknown robot 'nobody'"
        in gone.out
    )
    assert "try: mission robot use NAME, or: mission robot use --none" in gone.out
    Path("bad.yaml").write_text("robot: bad\nbase: {driver: kobuki}\n")
    file.write_text(f"robot: {Path('bad.yaml').absolute()}\n")
    bad = mission(*at)
    assert (bad.code, "cannot be used" in bad.out, "needs 'port'" in bad.out) == (1, True, True)
    file.write_text("robto: kit\n")
    assert "cannot be used" in mission(*at).out
    file.write_text(f"robot: {Path('kit.yaml').absolute()}\n")
    assert (
        f"robot: kit ({Path('kit.yaml').absolute()}), this computer's own, set in {file}: base, head, arm"
        in mission(*at).out
    )
    assert "this computer's own" not in mission("--robot", "kit.yaml", *at).out


def test_unwritable_folder_is_a_wrong_finding(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert list(check_folders()) == []
    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "file"))
    (found,) = check_folders()
    assert (found.verdict, found.message) == (
        "wrong", f"state folder {tmp_path}/file/missiontree: {tmp_path}/file is not a folder"
    )  # fmt: skip
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    monkeypatch.setattr(os, "access", lambda path, _: Path(path) != tmp_path)  # root may write everywhere
    (found,) = check_folders()
    assert found.message.endswith(f": {tmp_path} is not writable")
