"""``mission ports``: what it prints of a desk, for people and for programs, and how it finds which is which."""

import json
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import pytest

from drivers.finding.hardware_scan import scan_hardware
from missions.plugins.setup.ports import device_lines, identify_device, watch_devices
from tests.drivers.desks import RecordedMachine
from tests.missions.command import Outcome, command

Mission = Callable[..., Outcome]


@pytest.fixture
def desk(tmp_path: Path) -> RecordedMachine:
    return RecordedMachine(tmp_path / "machine")


@pytest.fixture
def mission(capsys: pytest.CaptureFixture[str], desk: RecordedMachine) -> Mission:
    return lambda *arguments: command(capsys, "ports", "--root", str(desk.root), *arguments)


def test_ports_without_devices_gives_hints(mission: Mission) -> None:
    told = mission()
    assert told.code == 0
    assert told.out.startswith("no serial port: no adapter found")
    assert "lsusb" in told.out
    assert "no camera\nno sound card\nno game pad\n" in told.out


def test_ports_shows_device_name_and_problem_of_each_port(mission: Mission, desk: RecordedMachine) -> None:
    desk.port("ttyUSB0", "0403:6014", serial="FT1", by_id="usb-FTDI_FT1-if00-port0", latency=16)
    desk.process(812, "ModemManager", "/dev/ttyUSB0")
    desk.port("ttyACM0", "2341:0043", serial="A1")
    told = mission()
    assert told.code == 1
    wanted = (
        "/dev/ttyUSB0  FTDI FT232H (U2D2), 0403:6014\n"
        "  call it /dev/serial/by-id/usb-FTDI_FT1-if00-port0\n"
        "  in use by ModemManager (process 812)\n"
        "    try: sudo systemctl disable --now ModemManager  (it takes robots for modems)\n"
    )
    assert wanted in told.out
    assert told.out.startswith("/dev/ttyACM0  an Arduino, 2341:0043\n")
    assert "  not probed: opening it restarts an Arduino, which may move its servos\n" in told.out
    assert "    try: mission ports --ask /dev/ttyACM0  (hands off the robot)\n" in told.out


def test_unprobed_port_is_no_error(mission: Mission, desk: RecordedMachine) -> None:
    desk.port("ttyACM0", "2341:0043", serial="A1")
    assert mission().code == 0
    assert mission("--no-ask").code == 0


def test_programs_get_the_same_as_json(mission: Mission, desk: RecordedMachine) -> None:
    desk.port("ttyUSB0", "1a86:7523")
    desk.camera()
    told = json.loads(mission("--json").out)
    (port,) = told["ports"]
    assert (port["path"], port["answers"], port["usb"]["vendor"]) == ("/dev/ttyUSB0", None, "1a86")
    assert [trouble["fix"] for trouble in port["troubles"]] == [
        "mission ports --ask /dev/ttyUSB0  (hands off the robot)"
    ]
    assert told["cameras"][0]["name"] == "HD Webcam"


def test_missing_port_cannot_be_probed(mission: Mission) -> None:
    told = mission("--ask", "/dev/ttyUSB7")
    assert told.code == 2
    assert "--ask /dev/ttyUSB7: no such serial port" in told.err


def _step(steps: Iterator[Callable[[], object]]) -> None:
    next(steps, bool)()


def test_device_is_identified_by_unplugging_it(capsys: pytest.CaptureFixture[str], desk: RecordedMachine) -> None:
    desk.port("ttyUSB0", "1a86:55d3")
    desk.port("ttyUSB1", "1a86:55d3")
    steps = iter((lambda: desk.unplug("ttyUSB1"), lambda: None, lambda: desk.port("ttyUSB1", "1a86:55d3")))
    assert identify_device(desk.machine, partial(_step, steps)) == 0
    told = capsys.readouterr()
    assert "2 devices; now unplug the one that you want to identify" in told.err
    assert "it was /dev/ttyUSB1; now plug it in again" in told.err
    assert "in a robot file:  port: /dev/serial/by-path/pci0-usb-0:3:1.0-port0" in told.out


def test_where_nothing_is_plugged_in_nothing_can_be_found(
    capsys: pytest.CaptureFixture[str], desk: RecordedMachine
) -> None:
    assert identify_device(desk.machine, lambda: None) == 1
    assert "no device is plugged in" in capsys.readouterr().err


@pytest.mark.parametrize("as_json", [False, True])
def test_ports_watch_reports_changes_until_ctrl_c(
    capsys: pytest.CaptureFixture[str], desk: RecordedMachine, as_json: bool
) -> None:
    desk.port("ttyUSB0", "0403:6014", serial="FT1")

    def leave() -> None:
        raise KeyboardInterrupt

    steps = iter(
        (lambda: None, lambda: desk.port("ttyACM0", "16c0:0483", serial="T1"), lambda: desk.unplug("ttyUSB0"), leave)
    )
    watch_devices(
        desk.machine,
        scan_hardware(desk.machine),
        lambda: scan_hardware(desk.machine),
        partial(_step, steps),
        as_json=as_json,
    )
    told = capsys.readouterr().out.splitlines()
    if as_json:
        assert [[port["path"] for port in json.loads(line)["ports"]] for line in told] == [
            ["/dev/ttyACM0", "/dev/ttyUSB0"],
            ["/dev/ttyACM0"],
        ]
        return
    assert told[0] == "+ /dev/ttyACM0  Teensy, 16c0:0483"
    assert told[-1] == "- /dev/ttyUSB0"


def test_only_new_devices_are_shown(desk: RecordedMachine) -> None:
    desk.port("ttyUSB0", "0403:6014", serial="FT1")
    before = scan_hardware(desk.machine)
    desk.port("ttyACM0", "16c0:0483", serial="T1")
    after = scan_hardware(desk.machine)
    assert next(device_lines(after, after.paths - before.paths)) == "/dev/ttyACM0  Teensy, 16c0:0483"
