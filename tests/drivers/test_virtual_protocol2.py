"""The virtual servos of protocol 2.0, asked with our own packets, in simulated time."""

from math import pi

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.servos import wire
from drivers.servos.models import MODELS, ServoModel
from drivers.servos.tables import TABLE_X, TABLE_X_CURRENT
from drivers.servos.virtual.chain import VirtualServoBus
from drivers.servos.virtual.protocol2 import CLEAR_TURNS, FAST_BULK_READ, FAST_SYNC_READ
from drivers.servos.virtual.servo import VirtualServo
from drivers.servos.wire import BROADCAST, Packet, ServoFault
from drivers.servos.wire2 import ALERT, STATUS, PacketParser2, Protocol2Error, Protocol2Instruction, crc, request
from tests.drivers.chains import chain, mixed_chain

NEW = [model for model in MODELS.values() if model.protocol == 2]
XL = "XL430-W250"


def word(value: int) -> bytes:
    return value.to_bytes(2, "little")


class Client:
    """Asks a virtual bus by our own packets, in simulated time; registers by their names in ``TABLE_X``."""

    def __init__(self, bus: VirtualServoBus) -> None:
        self.bus = bus
        self.now = 100.0

    def ask(self, servo: int, instruction: int, parameters: bytes = b"") -> list[Packet]:
        replies = PacketParser2().feed(self.bus.feed(request(servo, instruction, parameters), self.now))
        assert all(reply.code == STATUS for reply in replies)
        return replies

    def error(self, servo: int, instruction: int, parameters: bytes = b"") -> int:
        (reply,) = self.ask(servo, instruction, parameters)
        return reply.parameters[0]

    def read(self, servo: int, name: str) -> int:
        register = TABLE_X_CURRENT[name]
        (reply,) = self.ask(servo, Protocol2Instruction.READ, word(register.address) + word(register.size))
        return register.decode(reply.parameters[1:], register.address)

    def write(self, servo: int, name: str, value: int) -> int:
        register = TABLE_X_CURRENT[name]
        return self.error(servo, Protocol2Instruction.WRITE, word(register.address) + register.encode(value))

    def wait(self, seconds: float) -> None:
        for _ in range(round(seconds / 0.01)):
            self.now += 0.01
            assert self.bus.poll(self.now) == b""


@pytest.fixture
def client() -> Client:
    return Client(chain(3, XL))


@pytest.mark.parametrize(
    ("question", "answer"),
    [
        ("FF FF FD 00 01 03 00 01 19 4E", "FF FF FD 00 01 07 00 55 00 06 04 26 65 5D"),
        ("FF FF FD 00 01 07 00 02 84 00 04 00 1D 15", "FF FF FD 00 01 08 00 55 00 A6 00 00 00 8C C0"),
        ("FF FF FD 00 01 09 00 03 74 00 00 02 00 00 CA 89", "FF FF FD 00 01 04 00 55 00 A1 0C"),
        ("FF FF FD 00 01 09 00 04 68 00 C8 00 00 00 AE 8E", "FF FF FD 00 01 04 00 55 00 A1 0C"),
        ("FF FF FD 00 01 04 00 06 01 A1 E6", "FF FF FD 00 01 04 00 55 00 A1 0C"),
        ("FF FF FD 00 01 03 00 08 2F 4E", "FF FF FD 00 01 04 00 55 00 A1 0C"),
        ("FF FF FD 00 01 08 00 10 01 44 58 4C 22 B1 DC", "FF FF FD 00 01 04 00 55 00 A1 0C"),
        ("FF FF FD 00 FE 09 00 82 84 00 04 00 01 02 CE FA", None),
    ],
)
def test_published_packets_are_answered_as_published(question: str, answer: str | None) -> None:
    bus = chain(2, "XM430-W210")
    bus.servo(1).set("firmware", 38)
    bus.servo(1).turn_by_hand(bus.servo(1).model.angle(166))
    bus.servo(2).turn_by_hand(bus.servo(2).model.angle(2079))
    said = bus.feed(bytes.fromhex(question), 1.0)
    if answer is None:
        assert said.endswith(bytes.fromhex("FF FF FD 00 02 08 00 55 00 1F 08 00 00 BA BE"))
    else:
        assert said == bytes.fromhex(answer)


def test_published_ping_and_overload_replies_of_an_xl430_match() -> None:
    bus = chain(1, XL)
    pinged = bus.feed(bytes.fromhex("FF FF FD 00 01 03 00 01 19 4E"), 1.0)
    assert pinged == bytes.fromhex("FF FF FD 00 01 07 00 55 00 24 04 2D F4 DF")
    bus.servo(1).overload()
    alert = bus.feed(bytes.fromhex("FF FF FD 00 01 07 00 02 46 00 01 00 3C A3"), 1.0)
    assert alert == bytes.fromhex("FF FF FD 00 01 05 00 55 80 20 99 21")


def test_published_group_packets_reach_their_servos(client: Client) -> None:
    written = "FF FF FD 00 FE 11 00 83 74 00 04 00 01 96 00 00 00 02 AA 00 00 00 82 87"
    assert client.bus.feed(bytes.fromhex(written), client.now) == b""
    assert [client.read(n, "goal_position") for n in (1, 2, 3)] == [150, 170, 2048]
    read = "FF FF FD 00 FE 0D 00 92 01 90 00 02 00 02 92 00 01 00 1A 05"
    replies = PacketParser2().feed(client.bus.feed(bytes.fromhex(read), client.now))
    assert [(reply.id, reply.parameters[1:]) for reply in replies] == [(1, word(120)), (2, b"\x23")]
    everyone = PacketParser2().feed(client.bus.feed(bytes.fromhex("FF FF FD 00 FE 03 00 01 31 42"), client.now))
    assert [(reply.id, reply.parameters[1:]) for reply in everyone] == [(n, b"\x24\x04\x2d") for n in (1, 2, 3)]


@pytest.mark.parametrize("model", NEW, ids=lambda model: model.name)
def test_model_number_and_speed_are_those_of_the_model(model: ServoModel) -> None:
    client = Client(chain(1, model.name))
    (reply,) = client.ask(1, Protocol2Instruction.PING)
    assert int.from_bytes(reply.parameters[1:3], "little") == model.number
    for register in model.table.registers.values():
        if register.writable and register.eeprom and register.name not in ("id", "baud"):
            assert client.bus.servo(1).get(register) == model.default(register), register.name
    (whole,) = client.ask(1, Protocol2Instruction.READ, word(0) + word(model.table.size))
    assert len(whole.parameters) == 1 + model.table.size
    client.write(1, "profile_velocity", 40)
    assert client.write(1, "goal_position", model.centre_tick - 300) == Protocol2Error.NONE
    client.wait(0.1)
    assert client.bus.servo(1).angle == 0  # a goal does not switch the torque on
    client.write(1, "torque_enable", 1)
    client.wait(0.1)
    assert client.bus.servo(1).angle == pytest.approx(-0.1 * 40 * model.speed_unit, rel=0.02)
    assert (client.read(1, "present_velocity"), client.read(1, "moving")) == (-40, 1)
    client.wait(1.0)
    assert client.read(1, "present_position") == model.centre_tick - 300
    assert client.read(1, "moving") == 0


@pytest.mark.parametrize(
    ("name", "value", "error"),
    [
        ("led", 2, Protocol2Error.RANGE),
        ("goal_position", 4096, Protocol2Error.LIMIT),
        ("goal_position", 2_000_000, Protocol2Error.RANGE),
        ("goal_velocity", 300, Protocol2Error.LIMIT),
        ("present_position", 5, Protocol2Error.ACCESS),
        ("operating_mode", 7, Protocol2Error.RANGE),
        ("operating_mode", 5, Protocol2Error.RANGE),  # it measures no current
        ("goal_current", 5, Protocol2Error.ACCESS),
        ("led", 1, Protocol2Error.NONE),
    ],
)
def test_invalid_write_is_refused_without_changes(client: Client, name: str, value: int, error: Protocol2Error) -> None:
    client.ask(1, Protocol2Instruction.PING)
    before = bytes(client.bus.servo(1).table)
    assert client.write(1, name, value) == error
    assert (bytes(client.bus.servo(1).table) == before) is (error is not Protocol2Error.NONE)


def test_invalid_requests_are_refused_by_error_number(client: Client) -> None:
    assert client.error(1, 0x44) == Protocol2Error.INSTRUCTION
    assert client.error(1, Protocol2Instruction.ACTION) == Protocol2Error.INSTRUCTION
    assert client.error(1, Protocol2Instruction.WRITE, word(116)) == Protocol2Error.INSTRUCTION
    assert client.error(1, Protocol2Instruction.CLEAR, b"\x01\x02") == Protocol2Error.INSTRUCTION
    assert client.error(1, Protocol2Instruction.WRITE, word(116) + b"\x01\x02") == Protocol2Error.LENGTH
    assert client.error(1, Protocol2Instruction.READ, word(146) + word(40)) == Protocol2Error.RANGE
    damaged = bytearray(request(1, Protocol2Instruction.PING))
    damaged[-1] ^= 1
    (reply,) = PacketParser2().feed(client.bus.feed(bytes(damaged), client.now))
    assert reply.parameters[0] == Protocol2Error.CRC


def test_the_eeprom_is_closed_while_the_torque_is_on(client: Client) -> None:
    client.write(1, "torque_enable", 1)
    assert client.write(1, "return_delay", 0) == Protocol2Error.ACCESS
    client.write(1, "torque_enable", 0)
    assert client.write(1, "return_delay", 0) == Protocol2Error.NONE
    client.bus.servo(1).power_cycle()
    assert client.read(1, "return_delay") == 0


def test_position_limits_of_the_servo_bound_its_goal(client: Client) -> None:
    client.write(1, "max_position", 3000)
    assert client.write(1, "goal_position", 3001) == Protocol2Error.LIMIT
    goals = word(116) + word(4) + b"\x01" + (3001).to_bytes(4, "little") + b"\x02" + (2500).to_bytes(4, "little")
    client.ask(BROADCAST, Protocol2Instruction.SYNC_WRITE, goals)
    assert [client.read(n, "goal_position") for n in (1, 2)] == [2048, 2500]  # no clamping here


def test_registered_writes_start_together_on_action(client: Client) -> None:
    for servo in (1, 2):
        client.write(servo, "torque_enable", 1)
        client.error(servo, Protocol2Instruction.REG_WRITE, word(116) + (2100).to_bytes(4, "little"))
        assert client.read(servo, "registered") == 1
    client.wait(0.2)
    assert client.ask(BROADCAST, Protocol2Instruction.ACTION) == []
    client.wait(0.5)
    assert [client.read(n, "present_position") for n in (1, 2, 3)] == [2100, 2100, 2048]
    assert (
        client.error(1, Protocol2Instruction.REG_WRITE, word(116) + (9999).to_bytes(4, "little"))
        == Protocol2Error.LIMIT
    )
    assert client.read(1, "registered") == 0


def test_sync_read_stops_at_a_missing_servo(client: Client) -> None:
    def heard(*servos: int) -> list[int]:
        return [
            reply.id
            for reply in client.ask(BROADCAST, Protocol2Instruction.SYNC_READ, word(132) + word(4) + bytes(servos))
        ]

    assert heard(3, 1, 2) == [3, 1, 2]
    client.bus.servo(1).present = False
    assert heard(3, 1, 2) == [3]
    assert heard(2, 3) == [2, 3]
    client.bus.servo(2).set("status_return_level", 0)
    assert heard(2, 3) == []


def test_a_fast_reading_is_one_packet_with_a_crc_after_each_part(client: Client) -> None:
    client.bus.servo(2).temperature = 50.0
    asked = request(BROADCAST, FAST_SYNC_READ, word(146) + word(1) + b"\x01\x02\x03")
    said = client.bus.feed(asked, client.now)
    parts = bytes.fromhex("00 01 23"), bytes.fromhex("00 02 32"), bytes.fromhex("00 03 23")
    frame = bytes.fromhex("FF FF FD 00 FE 10 00 55")
    for part in parts:
        frame += part
        frame += word(crc(frame))
    assert said == frame
    client.bus.servo(2).present = False
    assert client.bus.feed(asked, client.now) == frame[:13]
    mixed = b"\x01" + word(146) + word(1) + b"\x03" + word(144) + word(2)
    (reply,) = client.ask(BROADCAST, FAST_BULK_READ, mixed)
    assert reply.parameters[:3] == bytes.fromhex("00 01 23")
    assert reply.parameters[5:] == bytes.fromhex("00 03 78 00")


def test_bulk_write_gives_each_servo_its_data(client: Client) -> None:
    data = b"\x01" + word(65) + word(1) + b"\x01" + b"\x03" + word(104) + word(4) + (50).to_bytes(4, "little")
    assert client.ask(BROADCAST, Protocol2Instruction.BULK_WRITE, data) == []
    assert (client.read(1, "led"), client.read(3, "goal_velocity")) == (1, 50)


def test_an_overload_latches_with_an_alert_until_a_reboot(client: Client) -> None:
    servo = client.bus.servo(1)
    client.write(1, "torque_enable", 1)
    servo.load = 1.5
    client.wait(1.2)
    assert client.error(1, Protocol2Instruction.PING) == ALERT
    assert client.read(1, "hardware_error") == 32
    assert (servo.faults, servo.limp) == (ServoFault.OVERLOAD, True)
    servo.load = 0.0
    client.write(1, "torque_enable", 1)
    client.wait(0.1)
    assert client.read(1, "torque_enable") == 0
    client.error(1, Protocol2Instruction.REBOOT)
    client.wait(0.1)
    assert client.ask(1, Protocol2Instruction.PING) == []
    client.wait(0.2)
    assert client.error(1, Protocol2Instruction.PING) == Protocol2Error.NONE
    assert client.write(1, "torque_enable", 1) == Protocol2Error.NONE
    assert client.read(1, "torque_enable") == 1


def test_heat_and_damage_latch_but_a_weak_supply_passes(client: Client) -> None:
    hot, shocked, weak = client.bus.servos
    hot.temperature, shocked.damage, weak.voltage = 90.0, ServoFault.SHOCK, 5.0
    client.wait(0.02)
    assert [client.read(n, "hardware_error") for n in (1, 2, 3)] == [4, 16, 1]
    hot.temperature, shocked.damage, weak.voltage = 30.0, ServoFault(0), 12.0
    client.wait(0.02)
    assert [client.read(n, "hardware_error") for n in (1, 2, 3)] == [4, 16, 0]


def test_velocity_mode_turns_endlessly_and_counts_turns(client: Client) -> None:
    client.write(1, "operating_mode", 1)
    client.write(1, "torque_enable", 1)
    client.write(1, "goal_velocity", -200)
    client.wait(3.0)
    assert client.read(1, "present_velocity") == -200
    assert client.read(1, "present_position") < -4096
    assert client.error(1, Protocol2Instruction.CLEAR, CLEAR_TURNS) == Protocol2Error.FAILED
    client.write(1, "goal_velocity", 0)
    client.wait(0.05)
    assert client.error(1, Protocol2Instruction.CLEAR, CLEAR_TURNS) == Protocol2Error.NONE
    assert 0 <= client.read(1, "present_position") <= 4095


@pytest.mark.parametrize(("mode", "name", "share"), [(16, "goal_pwm", 442), (0, "goal_current", 596)])
def test_pwm_and_current_modes_turn_in_proportion(mode: int, name: str, share: int) -> None:
    client = Client(chain(1, "XM430-W350"))
    client.write(1, "operating_mode", mode)
    client.write(1, "torque_enable", 1)
    client.write(1, name, share)
    client.wait(0.5)
    assert client.bus.servo(1).angle == pytest.approx(0.25 * MODELS["XM430-W350"].free_speed, rel=0.05)


def test_in_extended_position_mode_a_goal_may_be_turns_away(client: Client) -> None:
    client.write(1, "operating_mode", 4)
    client.write(1, "torque_enable", 1)
    assert client.write(1, "goal_position", 2048 - 2 * 4096) == Protocol2Error.NONE
    client.wait(3.0)
    assert client.read(1, "present_position") == 2048 - 2 * 4096
    assert client.bus.servo(1).angle == pytest.approx(-4 * pi, abs=0.002)


def test_homing_offset_and_reverse_mode_shift_positions(client: Client) -> None:
    servo = client.bus.servo(1)
    client.write(1, "homing_offset", 100)
    client.write(1, "drive_mode", 1 | 8)
    servo.turn_by_hand(servo.model.tick * 50)
    client.wait(0.01)
    assert client.read(1, "present_position") == 2048 - 50 + 100
    client.write(1, "goal_position", 2248)  # bit 3 of the drive mode: this switches the torque on
    client.wait(1.0)
    assert client.read(1, "present_position") == 2248
    assert servo.angle == pytest.approx(-100 * servo.model.tick)


def test_bus_watchdog_stops_the_servo_and_locks_goals_until_cleared(client: Client) -> None:
    client.write(1, "torque_enable", 1)
    client.write(1, "profile_velocity", 20)
    client.write(1, "goal_position", 4000)
    client.write(1, "bus_watchdog", 5)
    client.wait(0.5)
    stopped = client.read(1, "present_position")
    assert client.read(1, "bus_watchdog") == -1
    assert stopped < 2300
    assert client.write(1, "goal_position", 2048) == Protocol2Error.RANGE
    assert client.write(1, "bus_watchdog", 0) == Protocol2Error.NONE
    assert client.write(1, "goal_position", 2048) == Protocol2Error.NONE


@pytest.mark.parametrize(
    ("option", "number", "baud"), [(b"\xff", 1, 57_600), (b"\x01", 2, 57_600), (b"\x02", 2, 1_000_000)]
)
def test_factory_reset_keeps_the_selected_settings(option: bytes, number: int, baud: int) -> None:
    client = Client(VirtualServoBus([VirtualServo(2, model=XL)]))
    client.write(2, "max_position", 3000)
    assert client.error(2, Protocol2Instruction.FACTORY_RESET, option) == Protocol2Error.NONE
    client.wait(0.02)
    assert client.bus.baud == baud
    assert client.read(number, "max_position") == 4095


def test_both_protocols_live_on_one_wire_each_deaf_to_the_other() -> None:
    bus = mixed_chain("AX-12A", XL)
    old, new = wire.request(1, wire.Protocol1Instruction.PING), request(2, Protocol2Instruction.PING)
    assert wire.PacketParser().feed(bus.feed(old, 1.0)) == [Packet(1, 0)]
    assert [packet.id for packet in PacketParser2().feed(bus.feed(new, 1.3))] == [2]
    assert bus.feed(wire.request(2, wire.Protocol1Instruction.PING), 1.6) == b""
    assert bus.feed(request(1, Protocol2Instruction.PING), 1.9) == b""


def test_two_servos_with_one_id_answer_on_top_of_each_other(client: Client) -> None:
    client.write(2, "id", 1)
    client.bus.servos[1].turn_by_hand(0.7)
    (reply,) = client.ask(1, Protocol2Instruction.READ, word(132) + word(4))
    assert not reply.intact
    assert [packet.id for packet in client.ask(BROADCAST, Protocol2Instruction.PING)] == [1, 3]


def test_paced_sync_read_replies_leave_in_turn() -> None:
    bus = chain(3, XL, paced=True)
    for servo in bus.servos:
        servo.set("return_delay", 10)
    bus.feed(request(BROADCAST, Protocol2Instruction.SYNC_READ, word(132) + word(4) + b"\x01\x02\x03"), 5.0)
    asked, replied = 17 * 10e-6, 15 * 10e-6 + 20e-6
    for number in (1, 2, 3):
        due = bus.next_poll_time()
        assert due == pytest.approx(5.0 + asked + number * replied)
        assert due is not None
        assert PacketParser2().feed(bus.poll(due))[0].id == number


@given(data=st.lists(st.binary(max_size=40), max_size=5))
def test_arbitrary_bytes_do_not_break_the_bus(data: list[bytes]) -> None:
    bus = chain(2, XL)
    for step, piece in enumerate(data):
        bus.feed(piece, step * 0.01)
    bus.feed(b"", 10.0)
    assert PacketParser2().feed(bus.feed(request(1, Protocol2Instruction.PING), 20.0))[-1].id in (1, 2)


@given(
    instruction=st.sampled_from(list(Protocol2Instruction)), parameters=st.binary(max_size=20), everyone=st.booleans()
)
def test_arbitrary_requests_do_not_break_the_bus(
    instruction: Protocol2Instruction, parameters: bytes, everyone: bool
) -> None:
    bus = chain(2, "XM430-W210")
    bus.feed(request(BROADCAST if everyone else 1, instruction, parameters), 1.0)
    for servo in bus.servos:
        servo.advance(2.0)
        assert all(
            register.lower <= servo.get(register) <= register.upper
            for register in servo.model.table.registers.values()
            if register.writable
        )


def test_the_tables_of_all_models_agree_on_where_the_tests_look() -> None:
    for model in NEW:
        for name, register in TABLE_X.registers.items():
            if name in model.table and name != "present_load":
                assert model.table[name].address == register.address
