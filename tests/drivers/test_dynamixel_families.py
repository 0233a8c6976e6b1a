"""Servos of other families on the wire: found, named, and written to where their own table has the register."""

import json
from contextlib import closing
from functools import partial
from pathlib import Path

import pytest

from config.diagnostics import InvalidFileError, SourceText
from drivers.api.driver import resolve_name
from drivers.errors import DeviceFault
from drivers.finding.port_probe import run_probe
from drivers.servos.bus import ServoAddress
from drivers.servos.bus_scan import scan_bus
from drivers.servos.declared import ARM as DYNAMIXEL
from drivers.servos.feetech import ARM as FEETECH
from drivers.servos.identification import require_unique_id
from drivers.servos.joint import Joint, JointSpec
from drivers.servos.joint_setup import find_mismatch
from drivers.servos.models import MODELS, ServoModel, find_model
from drivers.servos.settings import apply_changes, plan_changes
from drivers.servos.virtual.chain import VirtualServoBus
from drivers.servos.virtual.servo import VirtualServo
from drivers.virtual.terminal import PseudoTerminal
from missions.library.drivers import parse_robot
from tests.drivers.desks import HandAsked
from tests.drivers.lines import direct_bus
from tests.drivers.table_servos import TableServo, TableServos
from tests.missions.command import Outcome, command
from tests.missions.servo_bench import patient

SCS = b"\x05\x04"
"""What an SCS0009 says that it is: series 5, model 4."""


def known(number: int) -> ServoModel:
    model = find_model(number)
    assert model is not None
    return model


FAMILIES = {
    350: "XL-320",
    1210: "XC330-T181",
    1220: "XC330-T288",
    1230: "XC330-M181",
    1240: "XC330-M288",
    1130: "XM540-W150",
    1120: "XM540-W270",
    1180: "XW540-T140",
    1170: "XW540-T260",
    1100: "XH540-W270",
    1110: "XH540-W150",
    1070: "XC430-W150",
    1090: "2XL430-W250",
    0x0405: "SCS0009",
    0x0504: "SCS0009",
    0x0F05: "SCS15",
    0x1905: "SCS115",
    0x2305: "SCS215",
    10: "RX-10",
    360: "MX-12W",
    521: "STS3032",
    777: "STS3215",
    2825: "STS3250",
    11272: "SM8512BL",
}


@pytest.mark.parametrize(("number", "name"), FAMILIES.items())
def test_servo_family_is_recognised_by_its_number(number: int, name: str) -> None:
    servo = TableServo(known(number), 4, number.to_bytes(2, "little"))
    bus, _, _ = direct_bus(TableServos(servo))  # type: ignore[arg-type]
    (found,) = scan_bus(bus, [1_000_000], ids=range(8))
    assert found.model is not None
    assert found.model.name == name
    assert found.address.id == 4
    assert found.voltage == pytest.approx(servo.model.nominal_voltage)
    assert found.position == pytest.approx(0.0)
    assert servo.written == []


@pytest.mark.parametrize(("number", "name"), FAMILIES.items())
def test_port_probe_names_the_servo_model(number: int, name: str) -> None:
    servo = TableServo(known(number), 4, number.to_bytes(2, "little"))
    probe = FEETECH if servo.model.protocol == "STS" else DYNAMIXEL
    answer = run_probe(resolve_name(probe.probe), HandAsked(TableServos(servo)))
    assert answer is not None
    assert [(unit.id, unit.model, unit.trouble) for unit in answer.units] == [(4, name, "")]
    other = DYNAMIXEL if probe is FEETECH else FEETECH
    assert run_probe(resolve_name(other.probe), HandAsked(TableServos(servo))) is None
    assert servo.written == []


@pytest.mark.parametrize(("number", "address"), [(350, 3), (1240, 7), (1120, 7), (0x0405, 5), (0x2305, 5), (521, 5)])
def test_new_id_is_written_to_the_register_of_its_table(number: int, address: int) -> None:
    servo = TableServo(known(number), 1, number.to_bytes(2, "little"))
    bus, _, _ = direct_bus(TableServos(servo))  # type: ignore[arg-type]
    at = ServoAddress(1, servo.model.protocol)
    apply_changes(bus, at, servo.model.table, plan_changes(bus, at, servo.model.table, {"id": 9}))
    assert (address, b"\x09") in servo.written
    opens = {48, 55} & {at for at, _ in servo.written}
    assert {at for at, _ in servo.written} - opens == {address}
    assert require_unique_id(bus, ServoAddress(9, servo.model.protocol)).number == number


def test_words_of_an_scs_are_big_endian() -> None:
    scs = known(0x0405)
    servo = TableServo(scs, 1, SCS)
    assert servo.table[9:13] == b"\x00\x00\x03\xff"
    bus, _, _ = direct_bus(TableServos(servo))  # type: ignore[arg-type]
    at = ServoAddress(1, "STS")
    apply_changes(bus, at, scs.table, plan_changes(bus, at, scs.table, {"max_position": 900}))
    assert (11, b"\x03\x84") in servo.written


def test_servo_with_a_mismatched_table_is_not_written() -> None:
    stranger = VirtualServo(1, model="XL430-W250")
    stranger.set("model_number", 350)  # an XL-320 by its number alone
    bus, _, _ = direct_bus(VirtualServoBus([stranger]))
    with pytest.raises(DeviceFault, match="its table is not that of an XL-320"):
        require_unique_id(bus, ServoAddress(1, 2))


def test_undriven_model_is_not_suggested_for_the_robot_file() -> None:
    servo = TableServo(known(350), 1)
    bus, _, _ = direct_bus(TableServos(servo))  # type: ignore[arg-type]
    joint = Joint("neck", JointSpec(1, "XL430-W250"), MODELS["XL430-W250"])
    assert find_mismatch(bus, joint) == "is model 350 (XL-320), not 1060 (XL430-W250)"
    assert "write model" not in joint.hint
    assert "not driven" in joint.hint
    assert servo.written == []


@pytest.mark.parametrize(("driver", "model"), [("dynamixel", "XL-320"), ("feetech", "SCS0009")])
def test_robot_file_with_an_undriven_model_is_refused(driver: str, model: str) -> None:
    text = f"robot: small\narm:\n  driver: {driver}\n  port: /dev/x\n  joints:\n    neck: {{id: 1, model: {model}}}\n"
    with pytest.raises(InvalidFileError, match="XL-320 and SCS0009, are recognised and set up, but not driven"):
        parse_robot(SourceText("small.yaml", text))


def _run(capsys: pytest.CaptureFixture[str], port: str, line: str) -> Outcome:
    return command(capsys, *line.split(), "--port", port)


def test_servo_commands_support_an_undriven_model(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    clock = patient(monkeypatch)
    servo = TableServo(known(0x0405), 1, SCS)
    with closing(PseudoTerminal("servos", TableServos(servo), clock)) as terminal:
        terminal.open()
        run = partial(_run, capsys, terminal.path)
        scan = run("servo scan --ids 0-3 --json")
        assert json.loads(scan.out)["model"] == "SCS0009"
        assert "SCS0009" in run("servo info 1").out
        assert run("servo set 1 id 2 --yes").code == 0
        assert servo.get("id") == 2


@pytest.mark.parametrize(("model", "name"), [("AX-12A", "?"), ("XM430-W350", "XM430-W350")])
def test_ping_only_servo_gives_a_hint_in_ports(model: str, name: str) -> None:
    mute = VirtualServo(4, model=model)
    mute.set("status_return_level", 0)
    answer = run_probe(resolve_name(DYNAMIXEL.probe), HandAsked(VirtualServoBus([mute])))
    assert answer is not None
    assert [(unit.id, unit.model) for unit in answer.units] == [(4, name)]
    assert "status return level is 0" in answer.trouble
    assert "mission servo set 4 status_return_level 2" in answer.hint


# --- 7.4 V and 12 V ---------------------------------------------------------------------------------------------------


def fed(model: str, volts: float, *, highest: int | None = None) -> tuple[str, str]:
    servo = VirtualServo(1, model=model)
    if highest is not None:
        servo.set("highest_voltage", highest)
    servo.voltage = volts
    bus, _, _ = direct_bus(VirtualServoBus([servo]))
    joint = Joint("elbow", JointSpec(1, model), MODELS[model])
    told = find_mismatch(bus, joint)
    assert servo.limp
    return told, joint.hint


@pytest.mark.parametrize(
    ("model", "volts", "made"), [("STS3215", 12.2, "7.4 V"), ("XL330-M288", 12.0, "5 V"), ("XC330-M288", 12.0, "5 V")]
)
def test_overvoltage_is_refused_before_torque(model: str, volts: float, made: str) -> None:
    told, cure = fed(model, volts)
    assert f"gets {volts:.1f} V, but allows" in told
    assert f"made for {made}" in told
    assert "switch its supply off" in cure


@pytest.mark.parametrize(
    ("model", "volts", "highest"),
    [
        ("STS3215", 12.2, 140),
        ("STS3215", 8.4, None),
        ("AX-12A", 12.6, None),
        ("MX-28", 16.8, None),
        ("XL330-M288", 5.2, None),
    ],
)
def test_a_charged_battery_and_the_version_for_12_volts_are_driven(
    model: str, volts: float, highest: int | None
) -> None:
    assert fed(model, volts, highest=highest)[0] == ""
