"""Ten desks: what is said of each is right, nothing that could move is sent, and nobody is disturbed."""

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from drivers.api.driver import resolve_name
from drivers.arduino import wire as rosserial
from drivers.arduino.virtual import VirtualRodney
from drivers.clock import SystemClock
from drivers.errors import NotConnected
from drivers.finding.hardware_scan import find_cameras, find_game_pads, find_sound_cards, make_prober, scan_hardware
from drivers.finding.machine import HostMachine
from drivers.finding.port_probe import PortScan, driver_by_serial_number, identify_device, probing_drivers, run_probe
from drivers.finding.serial_ports import SerialPortInfo, UsbDevice, find_portless_adapters, find_serial_ports
from drivers.kobuki.virtual import VirtualKobuki
from drivers.rplidar.virtual import VirtualRPLidar
from drivers.rplidar.wire import START_BYTE, RPLidarCommand
from drivers.servos.units import baud_code
from drivers.servos.virtual.chain import VirtualServoBus
from drivers.servos.virtual.servo import VirtualServo
from drivers.servos.wire import Protocol1Instruction
from drivers.sim.base_body import BaseBody
from drivers.transport import guardian_wire as lines
from drivers.transport.ports import is_raspberry_pi_5, leads_to_debug_connector, open_port
from drivers.virtual.terminal import PseudoTerminal, WireDevice
from drivers.waveshare.virtual import VirtualWaveshare
from missions.library.drivers import DriverTable
from tests.drivers.desks import HandAsked, RecordedMachine, gives_pictures, sent_instructions
from tests.drivers.fault_injection import FaultInjection

DRIVERS = probing_drivers(DriverTable().iter_drivers())
READS = {Protocol1Instruction.PING, Protocol1Instruction.READ}


@pytest.fixture
def desk(tmp_path: Path) -> RecordedMachine:
    return RecordedMachine(tmp_path / "machine")


def adapter(ids: str, serial: str = "", path: str = "/dev/ttyUSB0") -> SerialPortInfo:
    vendor, _, product = ids.partition(":")
    return SerialPortInfo(path, path, usb=UsbDevice(vendor, product, serial))


def asked(port: SerialPortInfo, device: WireDevice | None, *, consent: bool = False) -> tuple[PortScan, HandAsked]:
    wire = HandAsked(device)
    return identify_device(port, DRIVERS, wire, consent=consent), wire


# --- desk 1: two adapters alike ---------------------------------------------------------------------------------------


def test_identical_adapters_are_named_by_their_usb_socket(desk: RecordedMachine) -> None:
    for name in ("ttyUSB0", "ttyUSB1"):
        desk.port(name, "1a86:55d3", by_id="usb-1a86_USB_Single_Serial-if00")
    one, other = find_serial_ports(desk.machine)
    assert [one.call, other.call] == [f"/dev/serial/by-path/pci0-usb-0:{number}:1.0-port0" for number in (1, 2)]
    for port, socket in ((one, "1-1"), (other, "1-2")):
        (trouble,) = port.troubles
        assert f"only socket {socket} distinguishes them" in trouble.message
        assert "mission ports --find" in trouble.fix


def test_single_adapter_is_named_by_its_serial_number_or_udev_rule(desk: RecordedMachine) -> None:
    desk.port("ttyUSB0", "0403:6014", serial="FT1", by_id="usb-FTDI_FT1-if00-port0")
    desk.port("ttyUSB1", "0403:6001", serial="kobuki_A", by_id="usb-kobuki_A", rule="kobuki")
    arm, base = find_serial_ports(desk.machine)
    assert arm.call == "/dev/serial/by-id/usb-FTDI_FT1-if00-port0"
    assert base.call == "/dev/kobuki"
    assert not arm.troubles
    assert not base.troubles


# --- desk 2: a port in use --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("program", "cure"),
    [("ModemManager", "disable --now ModemManager"), ("brltty", "mask --now brltty"), ("python3", "fuser -v")],
)
def test_port_in_use_is_not_opened_and_its_program_is_named(desk: RecordedMachine, program: str, cure: str) -> None:
    path = desk.port("ttyUSB0", "0403:6014", serial="FT1")
    desk.process(812, program, path, "/dev/null")
    (port,) = find_serial_ports(desk.machine)
    assert port.shut is not None
    assert port.shut.message == f"in use by {program} (process 812)"
    assert cure in port.shut.fix
    heard, wire = asked(port, VirtualServoBus([VirtualServo(1)]), consent=True)
    assert heard.skip_reason == port.shut
    assert wire.sent == []


def test_port_in_use_by_a_run_names_the_run_and_its_stop_command(desk: RecordedMachine) -> None:
    path = desk.port("ttyUSB0", "0403:6014", serial="FT1")
    desk.process(812, "python3", path)
    (desk.root / "proc/812/cmdline").write_text("python3\0-m\0missions\0run\0greet\0", encoding="utf-8")
    (port,) = find_serial_ports(desk.machine)
    assert port.shut is not None
    assert port.shut.message == "in use by mission run greet (process 812)"
    assert port.shut.fix == "mission stop --end 812"


# --- desk 3: no rights ------------------------------------------------------------------------------------------------


def test_without_the_right_the_group_is_named(desk: RecordedMachine) -> None:
    desk.port("ttyUSB0", "0403:6014", serial="FT1")
    group = (desk.root / "dev/ttyUSB0").group()
    (port,) = find_serial_ports(desk.stranger())
    assert port.shut is not None
    if group == "root":
        assert "belongs to root alone" in port.shut.message
    else:
        assert f"usermod -a -G {group} $USER" in port.shut.fix
    (allowed,) = find_serial_ports(desk.stranger((desk.root / "dev/ttyUSB0").stat().st_gid))
    assert allowed.shut is None


# --- desk 4: the wrong rate -------------------------------------------------------------------------------------------


def test_servo_at_an_unusual_rate_is_found_without_writes() -> None:
    chain = VirtualServoBus([VirtualServo(3, model="AX-12A"), VirtualServo(4, model="AX-12A")], 250_000)
    heard, wire = asked(adapter("0403:6014"), chain)
    assert heard.device is not None
    assert heard.device.title == "arm.dynamixel"
    assert heard.device.result.keys == {"baud": 250_000}
    assert [(unit.id, unit.model) for unit in heard.device.result.units] == [(3, "AX-12A"), (4, "AX-12A")]
    assert sent_instructions(wire.sent) == READS


def test_new_servo_at_another_rate_gives_a_hint() -> None:
    new = VirtualServo(1, model="MX-28")
    chain = VirtualServoBus([VirtualServo(2), VirtualServo(3), new])
    new.set("baud", baud_code(57_600, 1))
    chain.poll(0.0)
    chain.poll(1e-6)
    heard, _ = asked(adapter("0403:6014"), chain)
    assert heard.trouble is not None
    assert heard.trouble.message == "servos at 2 rates on one wire"
    assert heard.trouble.fix == "mission servo set 1 baud 1000000 --baud 57600 --port /dev/ttyUSB0"


# --- desk 5: a silent servo -------------------------------------------------------------------------------------------


def test_servos_without_power_are_silence_and_the_power_is_named_first() -> None:
    silent = VirtualServo(1)
    silent.present = False
    heard, wire = asked(adapter("0403:6014"), VirtualServoBus([silent]))
    assert heard.device is None
    assert heard.trouble is not None
    assert "no reply; probed: arm.dynamixel" in heard.trouble.message
    assert heard.trouble.fix.startswith("switch on the power")
    assert "mission servo scan --all-bauds --port /dev/ttyUSB0" in heard.trouble.fix
    assert sent_instructions(wire.sent) == {Protocol1Instruction.PING}
    assert len({baud for baud, _ in wire.sent}) == 12


# --- desk 6: two servos of one ID -------------------------------------------------------------------------------------


@pytest.mark.parametrize(("model", "other"), [("AX-12A", "AX-12A"), ("XL430-W250", "XL430-W250")])
def test_duplicate_servo_ids_are_reported_with_a_hint(model: str, other: str) -> None:
    chain = VirtualServoBus([VirtualServo(1, model=model, angle=0.3), VirtualServo(1, model=other, angle=-1.1)])
    heard, wire = asked(adapter("0403:6014"), chain)
    assert heard.trouble is not None
    assert heard.trouble.message == "ID 1: damaged replies; two servos may have it"
    assert "unplug all but one" in heard.trouble.fix
    assert sent_instructions(wire.sent) == READS


# --- desk 7: a camera, of which no picture is taken here --------------------------------------------------------------


def test_camera_in_use_is_reported_with_its_program(desk: RecordedMachine) -> None:
    path = desk.camera("Black Box")
    (camera,) = find_cameras(desk.machine, gives_pictures)
    assert (camera.path, camera.name, camera.trouble) == (path, "Black Box", None)
    assert camera.usb is not None
    desk.process(99, "cheese", path)
    (camera,) = find_cameras(desk.machine, gives_pictures)
    assert camera.trouble is not None
    assert camera.trouble.message == "in use by cheese (process 99)"


def test_csi_camera_is_reported_with_a_hint(desk: RecordedMachine) -> None:
    desk.camera("unicam-image")
    (camera,) = find_cameras(desk.machine, gives_pictures)
    assert camera.source == "tcp://127.0.0.1:8888"
    assert camera.trouble is not None
    assert "OpenCV cannot read" in camera.trouble.message
    assert "rpicam-vid" in camera.trouble.fix


# --- desk 8: a Kobuki, on and off -------------------------------------------------------------------------------------


def test_a_kobuki_is_only_listened_to() -> None:
    heard, wire = asked(adapter("0403:6001", "kobuki_AH02"), VirtualKobuki())
    assert heard.device is not None
    assert heard.device.title == "base.kobuki"
    assert "battery at 16" in heard.device.result.about
    assert wire.bytes_sent == b""


def test_switched_off_kobuki_is_recognised_by_its_adapter() -> None:
    heard, wire = asked(adapter("0403:6001", "kobuki_AH02"), None)
    assert heard.trouble is not None
    assert heard.trouble.message == "a Kobuki, by its adapter, but it is silent"
    assert "switch it on" in heard.trouble.fix
    assert wire.bytes_sent == b""
    kobuki = driver_by_serial_number(adapter("0403:6001", "kobuki_AH02"), DRIVERS)
    assert kobuki is not None
    assert driver_by_serial_number(adapter("0403:6001", "A50285BI"), DRIVERS) is None


# --- desk 9: a Teensy, and an Arduino that would start anew -----------------------------------------------------------


def test_teensy_reports_its_topics_and_its_servos_do_not_move() -> None:
    teensy = VirtualRodney(baud=500_000, tacho=True, native_usb=True)
    heard, wire = asked(adapter("16c0:0483", path="/dev/ttyACM0"), teensy)
    assert heard.device is not None
    assert heard.device.title == "head.arduino"
    assert heard.device.result.keys == {"baud": 500_000}
    assert "servo" in heard.device.result.about
    assert teensy.commands == []
    assert {data for _, data in wire.sent} <= {b"", rosserial.PROBE, lines.REPORT_REQUEST}


def test_board_that_resets_on_open_is_not_opened_without_consent() -> None:
    nano = VirtualRodney()
    port = adapter("1a86:7523")
    heard, wire = asked(port, nano)
    assert heard.skip_reason is not None
    assert "restarts an Arduino, which may move its servos" in heard.skip_reason.message
    assert "mission ports --ask /dev/ttyUSB0" in heard.skip_reason.fix
    assert wire.sent == []
    heard, wire = asked(port, nano, consent=True)
    assert heard.device is not None
    assert heard.device.title == "head.arduino"
    assert nano.commands == []


def test_booting_board_is_probed_again() -> None:
    heard, _ = asked(adapter("2341:0043"), VirtualRodney(boot_delay=2.5), consent=True)
    assert heard.device is not None
    assert heard.device.result.keys == {"baud": 57_600}


def test_printer_and_builtin_ports_are_not_probed_without_consent() -> None:
    for port in (adapter("1d50:6029"), SerialPortInfo("/dev/ttyS0", "/dev/ttyS0")):
        heard, wire = asked(port, VirtualServoBus([VirtualServo(1)]))
        assert heard.skip_reason is not None
        assert f"mission ports --ask {port.path}" in heard.skip_reason.fix
        assert wire.sent == []


def test_scanning_lidar_is_stopped_and_identified() -> None:
    lidar = VirtualRPLidar(lambda bearings, _: bearings * 0 + 2.0, model="a2", streaming=True)
    heard, wire = asked(adapter("10c4:ea60"), lidar)
    assert heard.device is not None
    assert heard.device.title == "range.rplidar"
    assert heard.device.result.keys == {"baud": 115_200, "model": "a2"}
    assert {data[1] for _, data in wire.sent if data.startswith(bytes([START_BYTE]))} == {
        RPLidarCommand.STOP,
        RPLidarCommand.INFO,
    }


@pytest.mark.parametrize("number", [1, 9])
def test_feetech_and_dynamixel_servos_are_distinguished_by_their_table(number: int) -> None:
    """An STS3215 with ID 9 has the 9 where a Dynamixel has it, too: in its model number."""
    chain = VirtualServoBus([VirtualServo(number, model="STS3215"), VirtualServo(12, model="STS3215")])
    heard, wire = asked(adapter("1a86:55d3"), chain)
    assert heard.device is not None
    assert heard.device.title == "arm.feetech"
    assert [(unit.id, unit.model, unit.trouble) for unit in heard.device.result.units] == [
        (number, "STS3215", ""),
        (12, "STS3215", ""),
    ]
    assert sent_instructions(wire.sent) == READS
    others, _ = asked(adapter("0403:6014"), chain)
    assert others.device is None


@pytest.mark.parametrize("echo", [0.0, 1.0])
@pytest.mark.parametrize(("model", "usb", "volts"), [("STS3215", "1a86:55d3", 12.2), ("AX-12A", "0403:6014", 5.0)])
def test_servos_at_a_wrong_voltage_answer_though_with_the_bytes_of_the_ping(
    model: str, usb: str, volts: float, echo: float
) -> None:
    fed = [VirtualServo(number, model=model) for number in (1, 2, 3)]
    for servo in fed:
        servo.voltage = volts
    heard, wire = asked(adapter(usb), VirtualServoBus(fed, injection=FaultInjection(1, echo=echo)))
    assert heard.device is not None
    told = [(unit.id, unit.model, unit.trouble) for unit in heard.device.result.units]
    assert told == [(number, model, "voltage") for number in (1, 2, 3)]
    assert sent_instructions(wire.sent) == READS


@pytest.mark.parametrize("number", [1, 9])
def test_dynamixels_on_a_ch343_adapter_are_recognised(number: int) -> None:
    chain = VirtualServoBus([VirtualServo(number, model="XL330-M077"), VirtualServo(3, model="AX-12A")])
    heard, _ = asked(adapter("1a86:55d3"), chain)
    assert heard.device is not None
    assert heard.device.title == "arm.dynamixel"
    assert {unit.model for unit in heard.device.result.units} == {"XL330-M077", "AX-12A"}


def test_waveshare_rover_is_identified_by_one_report() -> None:
    rover = VirtualWaveshare(BaseBody(), track=0.2, unit=0.4, encoders=False)
    heard, wire = asked(adapter("10c4:ea60"), rover)
    assert heard.device is not None
    assert heard.device.title == "base.waveshare"
    assert "V" in heard.device.result.about
    assert rover.commanded == (0.0, 0.0)
    assert b'{"T":1,' not in wire.bytes_sent


# --- desk 10: nothing at all ------------------------------------------------------------------------------------------


def test_an_empty_desk_is_empty(desk: RecordedMachine) -> None:
    found = scan_hardware(desk.machine)
    assert (found.ports, found.portless_adapters, found.cameras, found.sound_cards, found.game_pads) == (
        (),
        (),
        (),
        (),
        (),
    )


# --- what else there is -----------------------------------------------------------------------------------------------


def test_adapter_taken_by_brltty_is_reported(desk: RecordedMachine) -> None:
    desk.usb("1a86:7523")
    desk.process(300, "brltty")
    ((usb, trouble),) = find_portless_adapters(desk.machine)
    assert usb.ids == "1a86:7523"
    assert trouble.message == "it has no port: brltty has taken it"


def test_adapter_with_high_latency_is_reported_with_a_hint(desk: RecordedMachine) -> None:
    desk.port("ttyUSB0", "0403:6014", serial="FT1", latency=16)
    (port,) = find_serial_ports(desk.machine)
    (trouble,) = port.troubles
    assert "delays bytes by 16 ms" in trouble.message
    assert "/sys/bus/usb-serial/devices/ttyUSB0/latency_timer" in trouble.fix


def test_the_empty_uarts_of_a_computer_are_no_ports(desk: RecordedMachine) -> None:
    for name, kind in (("ttyS0", "4"), ("ttyS1", "0")):
        desk.write(f"sys/class/tty/{name}/type", kind)
        (desk.root / f"sys/class/tty/{name}/device").mkdir()
        desk.write(f"dev/{name}", "")
    assert [port.path for port in find_serial_ports(desk.machine)] == ["/dev/ttyS0"]


def uart(desk: RecordedMachine, name: str, link: str = "") -> None:
    """Give a computer a port of its own, with another name, if wanted."""
    desk.write(f"sys/class/tty/{name}/type", "32")
    (desk.root / f"sys/class/tty/{name}/device").mkdir()
    desk.write(f"dev/{name}", "")
    if link:
        (desk.root / f"dev/{link}").symlink_to(name)


BOARDS = (
    ("Raspberry Pi 5 Model B Rev 1.0\0", "", True),
    ("Raspberry Pi 500 Rev 1.0\0", "", True),
    ("Raspberry Pi Compute Module 5 Rev 1.0\0", "", True),
    ("a board of somebody else's\0", "someone,board\0brcm,bcm2712\0", True),
    ("Raspberry Pi 4 Model B Rev 1.5\0", "raspberrypi,4-model-b\0brcm,bcm2711\0", False),
    ("Raspberry Pi 3 Model B Plus Rev 1.3\0", "", False),
    ("", "", False),
)


@pytest.mark.parametrize(("model", "compatible", "is_5"), BOARDS)
def test_raspberry_pi_5_debug_port_is_distinguished_from_the_pins(
    desk: RecordedMachine, model: str, compatible: str, *, is_5: bool
) -> None:
    for name, text in (("model", model), ("compatible", compatible)):
        if text:
            desk.write(f"proc/device-tree/{name}", text)
    uart(desk, "ttyAMA0")
    uart(desk, "ttyAMA10", "serial0")
    pins, debug = find_serial_ports(desk.machine)
    assert is_raspberry_pi_5(desk.root) is is_5
    assert (pins.call, debug.call) == ("/dev/ttyAMA0", "/dev/ttyAMA10" if is_5 else "/dev/serial0")
    assert pins.title == ("the pins GPIO 14 and 15" if is_5 else "a port of the computer itself")
    assert ("debug connector" in debug.title and "/dev/ttyAMA0, after dtparam=uart0=on" in debug.title) is is_5
    own = {
        port: leads_to_debug_connector(port, desk.root) for port in ("/dev/ttyAMA10", "/dev/ttyAMA0", "/dev/ttyUSB0")
    }
    assert not any(own.values()), "its own name is meant so"
    assert leads_to_debug_connector("/dev/serial0", desk.root) is is_5


def test_debug_port_is_not_opened(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("drivers.transport.ports.leads_to_debug_connector", lambda port: port == "/dev/serial0")
    with pytest.raises(NotConnected, match=r"^base: /dev/serial0: leads to the debug connector of this Raspb") as told:
        open_port("base", "/dev/serial0", 115_200)
    assert told.value.hint.startswith("port: /dev/ttyAMA0  (GPIO 14 and 15, after dtparam=uart0=on")


def test_raspberry_pi_5_with_serial0_on_the_pins_uses_ttyama0(desk: RecordedMachine) -> None:
    desk.write("proc/device-tree/model", "Raspberry Pi 5 Model B Rev 1.1\0")
    uart(desk, "ttyAMA0", "serial0")
    (pins,) = find_serial_ports(desk.machine)
    assert pins.call == "/dev/ttyAMA0"
    assert not leads_to_debug_connector("/dev/serial0", desk.root)


def test_sound_cards_and_gamepads_are_listed(desk: RecordedMachine) -> None:
    desk.write("proc/asound/cards", " 1 [C920           ]: USB-Audio - HD Pro Webcam C920\n      Webcam at usb-1")
    desk.write("proc/asound/pcm", "01-00: USB Audio : USB Audio : capture 1")
    desk.write(
        "proc/bus/input/devices",
        'N: Name="AT Keyboard"\nH: Handlers=kbd event0\n\nN: Name="Xbox Pad"\nH: Handlers=event7 js0\n',
    )
    desk.write("dev/input/event7", "")
    (card,) = find_sound_cards(desk.machine)
    assert (card.number, card.name, card.hears, card.speaks) == (1, "HD Pro Webcam C920", True, False)
    (pad,) = find_game_pads(desk.machine)
    assert (pad.path, pad.name) == ("/dev/input/event7", "Xbox Pad")


PUBLISHED = {
    "0403:6014": ("FF FF 01 02 01 FB", "FF FF FD 00 FE 03 00 01 31 42"),  # ROBOTIS e-Manual: ping 1; ping of all
    "10c4:ea60": ("A5 25", "A5 50"),  # SLAMTEC, RPLIDAR interface protocol: STOP, GET_INFO
    "16c0:0483": ("FF FE 00 00 FF 00 00 FF",),  # rosserial: the request for topics
}
"""Requests as the makers have published them."""


@pytest.mark.parametrize("ids", PUBLISHED)
def test_probes_match_the_published_requests(ids: str) -> None:
    _, wire = asked(adapter(ids), None)
    for published in PUBLISHED[ids]:
        assert any(bytes.fromhex(published) in data for _, data in wire.sent), published


def test_a_bad_line_makes_no_wrong_value_of_ten_thousand_questions() -> None:
    """One in a hundred replies befalls each of seven mishaps: what is said of a servo is true, or that it is unsure."""
    questions, lost = 0, 0
    for seed in range(40):
        for driver, models in (("dynamixel", ("AX-12A", "MX-28")), ("dynamixel", ("XL430-W250", "XL330-M077")),
                               ("feetech", ("STS3215", "STS3215"))):  # fmt: skip
            mishaps = dict.fromkeys(("drop", "flip", "split", "noise", "echo", "late", "truncate"), 0.01)
            servos = [VirtualServo(number, model=model) for number, model in zip((2, 7), models, strict=True)]
            wire = HandAsked(VirtualServoBus(servos, injection=FaultInjection(seed, **mishaps)))
            probe = next(each.probe for each in DRIVERS if each.name == driver and each.kind == "arm")
            answer = run_probe(resolve_name(probe), wire)
            questions += len(wire.sent)
            assert answer is not None
            assert answer.keys == {"baud": 1_000_000}
            sure = {unit.id: unit.model for unit in answer.units if unit.model != "?"}
            assert sure.items() <= dict(zip((2, 7), models, strict=True)).items()
            lost += 2 - len(sure)
    assert questions > 9000
    assert lost <= 5


def test_device_holders_are_found_on_this_machine() -> None:
    with subprocess.Popen(
        [sys.executable, "-c", "f = open('/dev/full'); print(flush=True); input()"],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
    ) as program:  # fmt: skip
        assert program.stdout is not None
        program.stdout.readline()
        held = HostMachine().device_holders().get("/dev/full", [])
        program.communicate("\n")
    assert program.pid in {process.pid for process in held}


@pytest.mark.real_time
def test_port_unplugged_during_a_probe_is_reported_and_closed(desk: RecordedMachine) -> None:
    class Pulled(VirtualServoBus):
        """A chain whose plug is pulled at the fifth question."""

        def feed(self, data: bytes, now: float) -> bytes:
            del now
            pulled.append(data)
            if len(pulled) == 5:
                terminal.unplug()
            return b""

    pulled: list[bytes] = []
    with closing(PseudoTerminal("servos", Pulled([VirtualServo(1)]), SystemClock())) as terminal:
        terminal.open()
        desk.port("ttyUSB0", "0403:6014", serial="FT1", behind=terminal.path)
        (plug,) = scan_hardware(desk.machine, make_prober(desk.machine, DRIVERS, SystemClock())).ports
    assert plug.scan is not None
    assert plug.scan.device is None
    assert plug.scan.trouble is not None
    assert "ttyUSB0" in plug.scan.trouble.message
    assert len(pulled) == 5


def test_port_taken_during_a_scan_is_left_alone(desk: RecordedMachine) -> None:
    with closing(PseudoTerminal("servos", VirtualServoBus([VirtualServo(1)]), SystemClock())) as terminal:
        terminal.open()
        desk.port("ttyUSB0", "0403:6014", serial="FT1", behind=terminal.path)
        with closing(open_port("somebody", terminal.path, 115_200)):
            (plug,) = scan_hardware(desk.machine, make_prober(desk.machine, DRIVERS, SystemClock())).ports
    assert plug.scan is not None
    assert plug.scan.trouble is not None
    assert "in use" in plug.scan.trouble.message


@pytest.fixture
def kobuki_at_the_port(desk: RecordedMachine) -> Iterator[PseudoTerminal]:
    with closing(PseudoTerminal("kobuki", VirtualKobuki(), SystemClock())) as terminal:
        terminal.open()
        desk.port("ttyUSB0", "0403:6001", serial="kobuki_1", behind=terminal.path)
        yield terminal


@pytest.mark.usefixtures("kobuki_at_the_port")
def test_real_port_is_opened_probed_and_closed(desk: RecordedMachine) -> None:
    found = scan_hardware(desk.machine, make_prober(desk.machine, DRIVERS, SystemClock(), extra_timeout=2.0))
    ((port, heard),) = found.identified
    assert heard.device is not None
    assert (port.path, heard.device.title) == ("/dev/ttyUSB0", "base.kobuki")


@pytest.mark.parametrize("model", ["AX-12A", "STS3215", "XL330-M288"])
def test_late_probe_replies_are_assigned_to_their_servos(model: str) -> None:
    """A busy machine hands answers on 20 ms late: no servo is missed, none is taken for two."""
    device = VirtualServoBus([VirtualServo(number, model=model) for number in (4, 5, 17)])
    heard, _ = asked(adapter("1a86:55d3"), Late(device))
    assert heard.device is not None
    assert heard.trouble is None
    assert [(unit.id, unit.model, unit.trouble) for unit in heard.device.result.units] == [
        (number, model, "") for number in (4, 5, 17)
    ]


class Late(VirtualServoBus):
    """A chain whose answers arrive 20 ms after they have left."""

    def __init__(self, chain: VirtualServoBus) -> None:
        super().__init__(chain.servos)
        self._on_its_way: list[tuple[float, bytes]] = []

    def feed(self, data: bytes, now: float) -> bytes:
        self._on_its_way.append((now + 0.02, super().feed(data, now)))
        return self.poll(now)

    def poll(self, now: float) -> bytes:
        self._on_its_way.append((now + 0.02, super().poll(now)))
        come = [each for each in self._on_its_way if each[0] <= now]
        self._on_its_way = [each for each in self._on_its_way if each[0] > now]
        return b"".join(said for _, said in come)


def test_circular_symlink_resolves_to_itself(tmp_path: Path) -> None:
    (tmp_path / "loop").symlink_to("loop")
    assert HostMachine(tmp_path).resolve("/loop") == "/loop"


def test_pipe_is_not_read_and_an_endless_file_is_truncated(
    desk: RecordedMachine,
) -> None:
    folder = desk.root / "sys"
    os.mkfifo(folder / "product")
    desk.write("sys/serial", "7" * 1_000_000)
    assert desk.machine.read_text("/sys/product") == ""
    assert len(desk.machine.read_text("/sys/serial")) == 4096
