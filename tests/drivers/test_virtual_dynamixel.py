"""The virtual servos, asked with our own packets without a terminal, and by the plain Dynamixel SDK over one."""

from collections.abc import Iterator
from math import radians

import dynamixel_sdk as sdk
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.clock import SystemClock
from drivers.dynamixel import models as m
from drivers.dynamixel.wire import BROADCAST, Fault, Instruction, Packet, Parser, request
from drivers.virtual.ax12 import VirtualAX12
from drivers.virtual.dynamixel import VirtualServoBus
from drivers.virtual.terminal import Terminal
from tests.drivers.chains import chain


class Client:
    """Asks a virtual bus by our own packets, in simulated time."""

    def __init__(self, bus: VirtualServoBus) -> None:
        self.bus = bus
        self.now = 100.0

    def ask(self, servo: int, instruction: int, parameters: bytes = b"") -> list[Packet]:
        return Parser().feed(self.bus.feed(request(servo, instruction, parameters), self.now))

    def read(self, servo: int, register: m.Register) -> int:
        (reply,) = self.ask(servo, Instruction.READ, bytes((register.address, register.size)))
        return register.decode(reply.parameters, register.address)

    def write(self, servo: int, register: m.Register, value: int) -> Fault:
        (reply,) = self.ask(servo, Instruction.WRITE, bytes((register.address,)) + register.encode(value))
        return Fault(reply.code)

    def wait(self, seconds: float) -> None:
        for _ in range(round(seconds / 0.01)):
            self.now += 0.01
            assert self.bus.poll(self.now) == b""


@pytest.fixture
def client() -> Client:
    return Client(chain(3))


def test_published_packets_are_answered_as_published() -> None:
    bus = chain(1)
    bus.servo(1).temperature = 32
    for question, answer in [
        ("FF FF 01 02 01 FB", "FF FF 01 02 00 FC"),
        ("FF FF 01 04 02 2B 01 CC", "FF FF 01 03 00 20 DB"),
        ("FF FF 01 04 02 00 02 F6", "FF FF 01 04 00 0C 00 EE"),
    ]:
        assert bus.feed(bytes.fromhex(question), 0.0) == bytes.fromhex(answer)
    bus.servo(1).temperature = 35
    eight = bus.feed(bytes.fromhex("FF FF 01 04 02 24 08 CC"), 0.0)
    assert eight == bytes.fromhex("FF FF 01 0A 00 00 02 00 00 00 00 78 23 57")


def test_a_new_servo_holds_the_defaults_of_its_manual(client: Client) -> None:
    for register in m.MODELS["AX-12A"].registers:
        if register.writable and register not in (m.ID, m.GOAL_POSITION):
            assert client.read(2, register) == m.MODELS["AX-12A"].default(register), register.name
    assert client.read(2, m.ID) == 2
    assert client.read(2, m.GOAL_POSITION) == client.read(2, m.PRESENT_POSITION) == 512
    assert client.read(2, m.PRESENT_VOLTAGE) == 120


def test_nobody_answers_for_a_missing_servo_or_to_everyone(client: Client) -> None:
    client.bus.servo(2).present = False
    assert client.ask(2, Instruction.PING) == []
    assert client.ask(9, Instruction.PING) == []
    assert client.ask(BROADCAST, Instruction.PING) == []
    assert client.ask(BROADCAST, Instruction.WRITE, bytes((m.LED.address, 1))) == []
    assert [servo.get(m.LED) for servo in client.bus.servos] == [1, 0, 1]


def test_writing_a_goal_switches_the_torque_on_and_turns_the_shaft_at_the_set_speed(client: Client) -> None:
    servo = client.bus.servo(1)
    speed = round(1.0 / servo.model.speed_unit)
    client.write(1, m.MOVING_SPEED, speed)
    assert servo.limp
    assert client.write(1, m.GOAL_POSITION, 812) == Fault(0)
    assert client.read(1, m.TORQUE_ENABLE) == 1
    client.wait(0.5)
    assert servo.angle == pytest.approx(0.5, rel=0.01)
    assert client.read(1, m.MOVING) == 1
    assert m.signed(client.read(1, m.PRESENT_SPEED)) == speed
    assert m.signed(client.read(1, m.PRESENT_LOAD)) > 0
    client.wait(1.5)
    assert client.read(1, m.PRESENT_POSITION) == 812
    assert client.read(1, m.MOVING) == client.read(1, m.PRESENT_SPEED) == 0


def test_speed_0_means_as_fast_as_the_motor_can(client: Client) -> None:
    servo = client.bus.servo(1)
    client.write(1, m.GOAL_POSITION, 200)
    client.wait(0.1)
    assert servo.angle == pytest.approx(-0.1 * servo.model.free_speed, rel=0.01)
    assert m.signed(client.read(1, m.PRESENT_SPEED)) < 0


def test_a_limp_shaft_turns_by_hand_and_a_stiff_one_does_not(client: Client) -> None:
    servo = client.bus.servo(1)
    servo.turn_by_hand(0.5)
    client.wait(0.1)
    assert client.read(1, m.PRESENT_POSITION) == servo.model.ticks(0.5)
    client.write(1, m.GOAL_POSITION, servo.model.ticks(0.5))
    client.wait(0.1)
    servo.turn_by_hand(-1.0)
    assert servo.angle == pytest.approx(0.5, abs=servo.model.tick)
    client.write(1, m.TORQUE_ENABLE, 0)
    servo.turn_by_hand(-1.0)
    client.wait(0.1)
    assert servo.angle == -1.0


@pytest.mark.parametrize(
    ("register", "value", "fault"),
    [
        (m.TORQUE_ENABLE, 2, Fault.RANGE),
        (m.GOAL_POSITION, 1024, Fault.RANGE),
        (m.PRESENT_POSITION, 5, Fault.RANGE),
        (m.MODEL_NUMBER, 18, Fault.RANGE),
        (m.STATUS_RETURN_LEVEL, 3, Fault.RANGE),
        (m.LED, 1, Fault(0)),
    ],
)
def test_what_does_not_fit_is_refused_and_changes_nothing(
    client: Client, register: m.Register, value: int, fault: Fault
) -> None:
    before = client.read(1, register)
    assert client.write(1, register, value) == fault
    assert client.read(1, register) == (before if fault else value)


def test_a_goal_outside_the_angle_limits_is_refused_and_does_not_move_it(client: Client) -> None:
    client.write(1, m.CCW_ANGLE_LIMIT, 600)
    assert client.write(1, m.GOAL_POSITION, 601) == Fault.ANGLE_LIMIT
    client.wait(0.2)
    assert client.bus.servo(1).angle == 0
    assert client.bus.servo(1).limp


def test_reads_beyond_the_table_and_of_nothing_are_refused(client: Client) -> None:
    for parameters in (b"\x30\x03", b"\x00\x00", b"\x00"):
        (reply,) = client.ask(1, Instruction.READ, parameters)
        assert (Fault(reply.code), reply.parameters) == (Fault.RANGE, b"")
    (whole,) = client.ask(1, Instruction.READ, bytes((0, 50)))
    assert whole.parameters == bytes(client.bus.servo(1).table)


def test_unknown_instructions_factory_reset_and_an_action_without_a_write_are_refused(client: Client) -> None:
    for instruction in (0x55, Instruction.FACTORY_RESET, Instruction.ACTION, Instruction.WRITE):
        (reply,) = client.ask(1, instruction)
        assert Fault(reply.code) == Fault.INSTRUCTION


def test_a_damaged_request_is_answered_with_the_checksum_bit_and_not_obeyed() -> None:
    bus = chain(1)
    damaged = bytearray(request(1, Instruction.WRITE, bytes((m.LED.address, 1))))
    damaged[-1] ^= 1
    (reply,) = Parser().feed(bus.feed(bytes(damaged), 0.0))
    assert Fault(reply.code) == Fault.CHECKSUM
    assert bus.servo(1).get(m.LED) == 0


def test_registered_writes_start_together_on_action(client: Client) -> None:
    for servo in (1, 2):
        client.ask(servo, Instruction.REG_WRITE, bytes((m.GOAL_POSITION.address,)) + m.GOAL_POSITION.encode(600))
        assert client.read(servo, m.REGISTERED) == 1
    client.wait(0.2)
    assert [servo.angle for servo in client.bus.servos] == [0, 0, 0]
    assert client.ask(BROADCAST, Instruction.ACTION) == []
    client.wait(0.5)
    assert [servo.get(m.PRESENT_POSITION) for servo in client.bus.servos] == [600, 600, 512]
    assert client.read(1, m.REGISTERED) == 0


def test_one_sync_write_reaches_all_it_names(client: Client) -> None:
    blocks = b"".join(bytes((n,)) + m.GOAL_POSITION.encode(500 + n) + m.MOVING_SPEED.encode(100) for n in (1, 3))
    assert client.ask(BROADCAST, Instruction.SYNC_WRITE, bytes((30, 4)) + blocks) == []
    assert [client.read(n, m.GOAL_POSITION) for n in (1, 2, 3)] == [501, 512, 503]
    assert client.ask(BROADCAST, Instruction.SYNC_WRITE, b"\x1e") == []


def test_the_status_return_level_decides_what_is_answered(client: Client) -> None:
    client.write(2, m.STATUS_RETURN_LEVEL, 2)
    client.ask(2, Instruction.WRITE, bytes((m.STATUS_RETURN_LEVEL.address, 1)))
    assert client.ask(2, Instruction.WRITE, bytes((m.LED.address, 1))) == []
    assert client.read(2, m.LED) == 1
    client.ask(2, Instruction.WRITE, bytes((m.STATUS_RETURN_LEVEL.address, 0)))
    assert client.ask(2, Instruction.READ, bytes((m.LED.address, 1))) == []
    assert len(client.ask(2, Instruction.PING)) == 1


def test_a_new_id_is_answered_to_from_then_on(client: Client) -> None:
    assert client.write(1, m.ID, 7) == Fault(0)
    assert client.ask(1, Instruction.PING) == []
    assert client.ask(7, Instruction.PING) == [Packet(7, 0)]


def test_two_servos_with_one_id_answer_on_top_of_each_other(client: Client) -> None:
    client.write(2, m.ID, 1)
    client.bus.servos[1].turn_by_hand(0.7)
    assert client.ask(1, Instruction.PING) == [Packet(1, 0)]
    (reply,) = client.ask(1, Instruction.READ, bytes((m.PRESENT_POSITION.address, 2)))
    assert not reply.intact


def test_a_new_rate_holds_once_the_reply_has_left(client: Client) -> None:
    for servo in (1, 2, 3):
        assert client.bus.baud == 1_000_000
        client.write(servo, m.BAUD, 34)
    client.wait(0.01)
    assert client.bus.baud == 57_600
    assert client.ask(2, Instruction.PING) == [Packet(2, 0)]
    client.write(2, m.BAUD, 1)
    client.wait(0.01)
    assert client.bus.baud == 57_600
    assert client.ask(2, Instruction.PING) == []


def test_the_lock_closes_the_eeprom_until_the_power_is_cut(client: Client) -> None:
    client.write(1, m.RETURN_DELAY, 9)
    client.write(1, m.LED, 1)
    client.write(1, m.LOCK, 1)
    assert client.write(1, m.RETURN_DELAY, 0) == Fault.RANGE
    assert client.write(1, m.LOCK, 0) == Fault.RANGE
    assert client.write(1, m.LED, 0) == Fault(0)
    client.bus.servo(1).power_cycle()
    assert client.read(1, m.RETURN_DELAY) == 9
    assert client.write(1, m.RETURN_DELAY, 0) == Fault(0)


def test_at_power_on_the_ram_starts_from_its_defaults_and_the_torque_limit_from_the_eeprom(client: Client) -> None:
    client.write(1, m.MAX_TORQUE, 400)
    client.write(1, m.GOAL_POSITION, 600)
    client.wait(1.0)
    client.bus.servo(1).power_cycle()
    client.wait(0.1)
    assert client.read(1, m.TORQUE_LIMIT) == 400
    assert client.read(1, m.TORQUE_ENABLE) == 0
    assert client.read(1, m.GOAL_POSITION) == client.read(1, m.PRESENT_POSITION) == 600


def test_an_overload_shuts_it_down_until_the_torque_limit_is_set_anew(client: Client) -> None:
    servo = client.bus.servo(1)
    client.write(1, m.GOAL_POSITION, 900)
    client.wait(0.1)
    servo.burden = -1.2
    client.wait(0.5)
    stopped = servo.angle
    assert client.read(1, m.PRESENT_LOAD) == m.unsigned(-1023)
    assert client.read(1, m.MOVING) == 0
    client.wait(0.7)
    (reply,) = client.ask(1, Instruction.PING)
    assert Fault(reply.code) == Fault.OVERLOAD
    assert servo.alarm
    assert servo.limp
    assert client.read(1, m.TORQUE_LIMIT) == 0
    servo.burden = 0.0
    client.wait(0.1)
    assert Fault(client.ask(1, Instruction.PING)[0].code) == Fault.OVERLOAD
    assert client.write(1, m.TORQUE_LIMIT, 1023) == Fault(0)
    client.write(1, m.TORQUE_ENABLE, 1)
    client.wait(2.0)
    assert servo.angle > stopped
    assert client.read(1, m.PRESENT_POSITION) == 900


def test_a_latched_overload_and_a_weak_supply_are_told_in_every_reply(client: Client) -> None:
    client.bus.servo(1).overload()
    client.bus.servo(1).voltage = 5.0
    client.wait(0.01)
    assert Fault(client.ask(1, Instruction.PING)[0].code) == Fault.OVERLOAD | Fault.VOLTAGE
    assert Fault(client.ask(2, Instruction.PING)[0].code) == Fault(0)


def test_an_overheated_servo_stays_shut_down_until_it_has_cooled(client: Client) -> None:
    servo = client.bus.servo(1)
    servo.temperature = 75
    client.wait(0.1)
    client.write(1, m.TORQUE_LIMIT, 1023)
    assert client.read(1, m.TORQUE_LIMIT) == 0
    servo.temperature = 50
    client.wait(0.1)
    assert client.write(1, m.TORQUE_LIMIT, 1023) == Fault(0)
    assert client.read(1, m.TORQUE_LIMIT) == 1023


def test_in_wheel_mode_it_turns_without_end_in_both_directions(client: Client) -> None:
    servo = client.bus.servo(1)
    client.write(1, m.CW_ANGLE_LIMIT, 0)
    client.write(1, m.CCW_ANGLE_LIMIT, 0)
    client.write(1, m.TORQUE_ENABLE, 1)
    client.write(1, m.MOVING_SPEED, 512 | m.CLOCKWISE)
    client.wait(0.1)
    assert servo.angle == pytest.approx(-0.1 * servo.model.free_speed * 512 / 1023, rel=0.01)
    client.write(1, m.MOVING_SPEED, 1023)
    angles = []
    for _ in range(30):
        client.wait(0.05)
        angles.append(servo.angle)
    assert max(angles) > 2.5
    assert min(angles) < -2.5


def test_a_packet_that_stops_half_way_is_forgotten_after_a_tenth_of_a_second() -> None:
    ping = request(1, Instruction.PING)
    whole, late = chain(1), chain(1)
    assert whole.feed(ping[:3], 1.0) + whole.feed(ping[3:], 1.05) != b""
    assert late.feed(ping[:3], 1.0) + late.feed(ping[3:], 1.2) == b""
    assert late.feed(ping, 1.3) != b""


@given(data=st.lists(st.binary(max_size=40), max_size=5))
def test_no_bytes_whatsoever_upset_it(data: list[bytes]) -> None:
    bus = chain(2)
    for step, piece in enumerate(data):
        bus.feed(piece, step * 0.01)
    bus.feed(b"", 10.0)
    assert Parser().feed(bus.feed(request(1, Instruction.PING), 20.0))[-1].id in (1, 2)


@given(address=st.integers(0, 60), data=st.binary(min_size=1, max_size=12))
def test_a_write_is_carried_out_whole_or_not_at_all(address: int, data: bytes) -> None:
    servo = VirtualAX12(1)
    client = Client(VirtualServoBus([servo]))
    client.wait(0.01)
    before = bytes(servo.table)
    replies = client.ask(1, Instruction.WRITE, bytes((address,)) + data)
    if replies and replies[0].code & (Fault.RANGE | Fault.ANGLE_LIMIT):
        assert bytes(servo.table) == before
    else:
        assert all(
            register.lower <= servo.get(register) <= register.upper
            for register in servo.model.registers
            if register.writable
        )


@pytest.fixture
def plugged() -> Iterator[Terminal]:
    terminal = Terminal("servos", chain(3), SystemClock())
    terminal.open()
    yield terminal
    terminal.close()


def test_the_plain_sdk_pings_reads_and_writes(plugged: Terminal) -> None:
    device = plugged.device
    assert isinstance(device, VirtualServoBus)
    port = sdk.PortHandler(plugged.path)
    packets = sdk.Protocol1PacketHandler()
    assert port.openPort()
    try:
        assert packets.ping(port, 1) == (12, 0, 0)
        assert packets.write2ByteTxRx(port, 1, m.GOAL_POSITION.address, 1023) == (0, 0)
        assert packets.read2ByteTxRx(port, 1, m.GOAL_POSITION.address) == (1023, 0, 0)
        assert packets.write1ByteTxRx(port, 1, m.TORQUE_ENABLE.address, 5) == (0, Fault.RANGE)
        group = sdk.GroupSyncWrite(port, packets, m.MOVING_SPEED.address, 2)
        assert group.addParam(1, [10, 0])
        assert group.addParam(2, [20, 0])
        assert group.txPacket() == sdk.COMM_SUCCESS
        assert packets.read2ByteTxRx(port, 2, m.MOVING_SPEED.address) == (20, 0, 0)
        assert packets.regWriteTxRx(port, 3, m.LED.address, 1, [1]) == (0, 0)
        assert packets.action(port, BROADCAST) == sdk.COMM_SUCCESS
        assert packets.read1ByteTxRx(port, 3, m.LED.address) == (1, 0, 0)
        device.servo(3).present = False
        assert packets.ping(port, 3) == (0, sdk.COMM_RX_TIMEOUT, 0)
        assert packets.factoryReset(port, 1) == (sdk.COMM_SUCCESS, Fault.INSTRUCTION)
        port.setBaudRate(57_600)
        assert packets.ping(port, 1) == (0, sdk.COMM_RX_TIMEOUT, 0)
    finally:
        port.closePort()


def test_shafts_start_where_they_are_put_and_a_missing_id_is_named() -> None:
    bus = VirtualServoBus([VirtualAX12(4, angle=radians(30))])
    assert bus.servo(4).angle == radians(30)
    with pytest.raises(KeyError, match="ID 5"):
        bus.servo(5)
