"""The census of a wire: who is found where, what is said of each, and that nothing is changed by asking."""

from contextlib import closing
from math import radians

import pytest

from drivers.errors import NotConnected
from drivers.servos import wire2
from drivers.servos.bus import ServoAddress
from drivers.servos.bus_scan import ScannedServo, scan_bus
from drivers.servos.models import MODELS
from drivers.servos.units import baud_code
from drivers.servos.virtual.chain import VirtualServoBus
from drivers.servos.virtual.servo import VirtualServo
from drivers.servos.wire import BROADCAST, Protocol1Instruction, ServoFault
from tests.drivers.fault_injection import FaultInjection
from tests.drivers.wired import Wired

FEW = range(8)


def wired(*servos: VirtualServo, injection: FaultInjection | None = None) -> Wired:
    return Wired(VirtualServoBus(servos, injection=injection))


def at_rate(chain: VirtualServoBus, number: int, baud: int) -> None:
    """Set a servo of a chain to a rate of its own, as if it had always been there."""
    servo = chain.servo(number)
    servo.set("baud", baud_code(baud, servo.model.protocol))
    chain.poll(0.0)
    chain.poll(1e-6)


def one(found: list[ScannedServo]) -> ScannedServo:
    assert len(found) == 1
    return found[0]


@pytest.mark.parametrize("name", MODELS)
def test_every_model_is_recognised_and_described(name: str) -> None:
    servo = VirtualServo(5, model=name, angle=radians(30))
    volts = servo.voltage - 0.5
    servo.voltage, servo.temperature = volts, 41.0
    found = one(list(scan_bus(wired(servo).bus(), [1_000_000], ids=FEW)))
    model = MODELS[name]
    assert (found.address, found.baud) == (ServoAddress(5, model.protocol), 1_000_000)
    assert (found.model, found.number) == (model, model.number)
    assert found.firmware == servo.get("firmware")
    assert found.position is not None
    assert abs(found.position - radians(30)) <= model.tick
    assert found.voltage == pytest.approx(volts)
    assert found.temperature == 41.0
    assert not found.faults
    assert not found.has_damaged_replies


def test_servos_are_found_at_every_rate_and_in_both_protocols() -> None:
    line = wired(VirtualServo(1), VirtualServo(2, model="RX-64"), VirtualServo(3, model="XL430-W250"))
    at_rate(line.chain, 2, 57_600)
    found = list(scan_bus(line.bus(), [57_600, 1_000_000], ids=FEW))
    assert [(row.baud, row.address) for row in found] == [
        (57_600, ServoAddress(2, 1)),
        (1_000_000, ServoAddress(1, 1)),
        (1_000_000, ServoAddress(3, 2)),
    ]


def test_scan_covers_only_the_given_ids_rates_and_protocols() -> None:
    line = wired(VirtualServo(1), VirtualServo(2), VirtualServo(3, model="XL430-W250"))
    bus = line.bus()
    assert [row.address for row in scan_bus(bus, [1_000_000], (1,), ids=[2, 3])] == [ServoAddress(2, 1)]
    assert [row.address for row in scan_bus(bus, [1_000_000], (2,), ids=[2, 3])] == [ServoAddress(3, 2)]
    assert list(scan_bus(bus, [], ids=FEW)) == []


def test_the_highest_id_of_each_protocol_is_looked_for() -> None:
    line = wired(VirtualServo(253), VirtualServo(252, model="XL430-W250"))
    found = [row.address for row in scan_bus(line.bus(), [1_000_000], ids=range(250, 300))]
    assert found == [ServoAddress(253, 1), ServoAddress(252, 2)]


def test_in_protocol_2_all_are_called_at_once_first() -> None:
    line = wired(VirtualServo(1, model="XL430-W250"))
    list(scan_bus(line.bus(), [1_000_000], (2,), ids=FEW))
    assert line.sent[0] == wire2.request(BROADCAST, Protocol1Instruction.PING)


def test_servo_missed_by_the_broadcast_is_pinged_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    line = wired(VirtualServo(1, model="XL430-W250"), VirtualServo(2, model="XL430-W250"))
    bus = line.bus()
    monkeypatch.setattr(bus, "find_servos", lambda **_: iter(()))
    assert [row.address.id for row in scan_bus(bus, [1_000_000], (2,), ids=FEW)] == [1, 2]


@pytest.mark.parametrize("name", ["AX-12A", "XM430-W210"])
def test_faults_of_a_servo_are_in_the_scan(name: str) -> None:
    servo = VirtualServo(1, model=name)
    servo.temperature = 95.0
    servo.overload()
    servo.advance(0.0)
    found = one(list(scan_bus(wired(servo).bus(), [1_000_000], ids=FEW)))
    assert found.faults == ServoFault.OVERHEATING | ServoFault.OVERLOAD
    assert found.temperature == 95.0


def test_unknown_model_is_listed_by_its_number() -> None:
    servo = VirtualServo(4)
    servo.set("model_number", 361)
    found = one(list(scan_bus(wired(servo).bus(), [1_000_000], ids=FEW)))
    assert (found.number, found.model, found.position) == (361, None, None)
    assert not found.has_damaged_replies


def test_duplicate_ids_are_detected_by_damaged_readings() -> None:
    pair = VirtualServo(3, angle=radians(40)), VirtualServo(3, angle=radians(-70))
    found = one(list(scan_bus(wired(*pair).bus(), [1_000_000], ids=FEW)))
    assert (found.address.id, found.number) == (3, 12)
    assert found.has_damaged_replies
    assert found.position is None


def test_duplicate_ids_of_different_models_are_detected() -> None:
    pair = VirtualServo(3), VirtualServo(3, model="AX-18A")
    found = one(list(scan_bus(wired(*pair).bus(), [1_000_000], ids=FEW)))
    assert (found.address, found.number, found.has_damaged_replies) == (ServoAddress(3, 1), None, True)


def test_servo_with_a_damaged_reply_is_asked_again() -> None:
    servos = [VirtualServo(number) for number in range(1, 7)]
    line = wired(*servos, injection=FaultInjection(seed=6, flip=0.2))
    found = list(scan_bus(line.bus(), [1_000_000], (1,), ids=FEW))
    assert [row.address.id for row in found] == [1, 2, 3, 4, 5, 6]
    assert any(row.has_damaged_replies for row in found)
    assert all(row.number in {12, None} for row in found)


def test_nothing_is_written_to_anyone() -> None:
    line = wired(VirtualServo(1), VirtualServo(2, model="XL430-W250"))
    eeprom = [servo.table[:24] for servo in line.chain.servos]
    list(scan_bus(line.bus(), [1_000_000], ids=FEW))
    assert {packet[7 if packet.startswith(wire2.HEADER) else 4] for packet in line.sent} <= {
        Protocol1Instruction.PING,
        Protocol1Instruction.READ,
    }
    assert [servo.table[:24] for servo in line.chain.servos] == eeprom
    assert all(servo.limp for servo in line.chain.servos)


def test_baud_rate_is_restored_after_a_scan() -> None:
    line = wired(VirtualServo(1))
    bus = line.bus()
    assert len(list(scan_bus(bus, [9600, 1_000_000, 57_600], ids=FEW))) == 1
    assert bus.baud == line.rates[-1] == 1_000_000


def test_baud_rate_is_restored_after_an_abandoned_scan() -> None:
    line = wired(VirtualServo(1))
    at_rate(line.chain, 1, 57_600)
    bus = line.bus()
    with closing(scan_bus(bus, [57_600, 9600], ids=FEW)) as rows:
        assert next(rows).baud == bus.baud == 57_600
    assert bus.baud == line.rates[-1] == 1_000_000


def test_unsupported_scan_rate_restores_the_baud_rate() -> None:
    line = wired(VirtualServo(1))
    line.beyond = {4_500_000}
    bus = line.bus()
    with pytest.raises(NotConnected, match="4500000"):
        list(scan_bus(bus, [4_500_000], ids=FEW))
    assert bus.baud == 1_000_000


def test_a_pulled_plug_ends_the_census_and_keeps_the_rate() -> None:
    line = wired(VirtualServo(1), VirtualServo(2))
    bus = line.bus()
    rows = scan_bus(bus, [57_600, 1_000_000], (1,), ids=FEW)
    assert next(rows).address.id == 1
    line.plugged = False
    with pytest.raises(NotConnected, match="unplugged"):
        next(rows)
    assert bus.baud == 1_000_000


def test_a_missing_id_costs_only_milliseconds() -> None:
    line = wired(VirtualServo(1))
    before = line.clock.now()
    list(scan_bus(line.bus(), [1_000_000], (1,)))
    assert line.clock.now() - before < 254 * 6e-3


@pytest.mark.parametrize("model", ["AX-12A", "XL430-W250"])
def test_servo_that_only_answers_pings_is_found(model: str) -> None:
    mute = VirtualServo(4, model=model)
    mute.set("status_return_level", 0)
    line = wired(VirtualServo(2, model=model), mute)
    found = {row.address.id: row for row in scan_bus(line.bus(), [1_000_000], ids=range(253))}
    assert sorted(found) == [2, 4]
    assert found[4].answers_ping_only
    assert not found[2].answers_ping_only
