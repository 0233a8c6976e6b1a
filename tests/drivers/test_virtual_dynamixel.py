"""The virtual servos of protocol 1.0, asked with our own packets, in simulated time."""

from math import degrees, pi, radians

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.servos import tables as m
from drivers.servos.models import MODELS, ServoModel
from drivers.servos.register import Register
from drivers.servos.virtual.chain import VirtualServoBus
from drivers.servos.virtual.servo import VirtualServo
from drivers.servos.wire import BROADCAST, Packet, PacketParser, Protocol1Instruction, ServoFault, request
from tests.drivers.chains import chain, mixed_chain

OLD = [model for model in MODELS.values() if model.protocol == 1]


class Client:
    """Asks a virtual bus by our own packets, in simulated time."""

    def __init__(self, bus: VirtualServoBus) -> None:
        self.bus = bus
        self.now = 100.0

    def ask(self, servo: int, instruction: int, parameters: bytes = b"") -> list[Packet]:
        return PacketParser().feed(self.bus.feed(request(servo, instruction, parameters), self.now))

    def read(self, servo: int, register: Register) -> int:
        (reply,) = self.ask(servo, Protocol1Instruction.READ, bytes((register.address, register.size)))
        return register.decode(reply.parameters, register.address)

    def write(self, servo: int, register: Register, value: int) -> ServoFault:
        (reply,) = self.ask(servo, Protocol1Instruction.WRITE, bytes((register.address,)) + register.encode(value))
        return ServoFault(reply.code)

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


def test_new_servo_has_the_defaults_of_the_manual(client: Client) -> None:
    for register in MODELS["AX-12A"].table.registers.values():
        if register.writable and register not in (m.ID, m.GOAL_POSITION):
            assert client.read(2, register) == MODELS["AX-12A"].default(register), register.name
    assert client.read(2, m.ID) == 2
    assert client.read(2, m.GOAL_POSITION) == client.read(2, m.PRESENT_POSITION) == 512
    assert client.read(2, m.PRESENT_VOLTAGE) == 120


def test_missing_servo_and_broadcast_get_no_reply(client: Client) -> None:
    client.bus.servo(2).present = False
    assert client.ask(2, Protocol1Instruction.PING) == []
    assert client.ask(9, Protocol1Instruction.PING) == []
    assert client.ask(BROADCAST, Protocol1Instruction.PING) == []
    assert client.ask(BROADCAST, Protocol1Instruction.WRITE, bytes((m.LED.address, 1))) == []
    assert [servo.get(m.LED) for servo in client.bus.servos] == [1, 0, 1]


def test_writing_a_goal_switches_the_torque_on_and_turns_the_shaft_at_the_set_speed(client: Client) -> None:
    servo = client.bus.servo(1)
    speed = round(1.0 / servo.model.speed_unit)
    client.write(1, m.MOVING_SPEED, speed)
    assert servo.limp
    assert client.write(1, m.GOAL_POSITION, 812) == ServoFault(0)
    assert client.read(1, m.TORQUE_ENABLE) == 1
    client.wait(0.5)
    assert servo.angle == pytest.approx(0.5, rel=0.01)
    assert client.read(1, m.MOVING) == 1
    assert client.read(1, m.PRESENT_SPEED) == speed
    assert client.read(1, m.PRESENT_LOAD) > 0
    client.wait(1.5)
    assert client.read(1, m.PRESENT_POSITION) == 812
    assert client.read(1, m.MOVING) == client.read(1, m.PRESENT_SPEED) == 0


def test_speed_0_means_as_fast_as_the_motor_can(client: Client) -> None:
    servo = client.bus.servo(1)
    client.write(1, m.GOAL_POSITION, 200)
    client.wait(0.1)
    assert servo.angle == pytest.approx(-0.1 * servo.model.free_speed, rel=0.01)
    assert client.read(1, m.PRESENT_SPEED) < 0


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
        (m.TORQUE_ENABLE, 2, ServoFault.RANGE),
        (m.GOAL_POSITION, 1024, ServoFault.RANGE),
        (m.PRESENT_POSITION, 5, ServoFault.RANGE),
        (m.MODEL_NUMBER, 18, ServoFault.RANGE),
        (m.STATUS_RETURN_LEVEL, 3, ServoFault.RANGE),
        (m.LED, 1, ServoFault(0)),
    ],
)
def test_invalid_write_is_refused_without_changes(
    client: Client, register: Register, value: int, fault: ServoFault
) -> None:
    before = client.read(1, register)
    assert client.write(1, register, value) == fault
    assert client.read(1, register) == (before if fault else value)


def test_goal_outside_the_angle_limits_is_refused(client: Client) -> None:
    client.write(1, m.CCW_ANGLE_LIMIT, 600)
    assert client.write(1, m.GOAL_POSITION, 601) == ServoFault.ANGLE_LIMIT
    client.wait(0.2)
    assert client.bus.servo(1).angle == 0
    assert client.bus.servo(1).limp


def test_reads_beyond_the_table_and_of_nothing_are_refused(client: Client) -> None:
    for parameters in (b"\x30\x03", b"\x00\x00", b"\x00"):
        (reply,) = client.ask(1, Protocol1Instruction.READ, parameters)
        assert (ServoFault(reply.code), reply.parameters) == (ServoFault.RANGE, b"")
    (whole,) = client.ask(1, Protocol1Instruction.READ, bytes((0, 50)))
    assert whole.parameters == bytes(client.bus.servo(1).table)


def test_unknown_instructions_and_an_action_without_a_write_are_refused(client: Client) -> None:
    for instruction in (0x55, Protocol1Instruction.ACTION, Protocol1Instruction.WRITE):
        (reply,) = client.ask(1, instruction)
        assert ServoFault(reply.code) == ServoFault.INSTRUCTION


def test_a_damaged_request_is_answered_with_the_checksum_bit_and_not_obeyed() -> None:
    bus = chain(1)
    damaged = bytearray(request(1, Protocol1Instruction.WRITE, bytes((m.LED.address, 1))))
    damaged[-1] ^= 1
    (reply,) = PacketParser().feed(bus.feed(bytes(damaged), 0.0))
    assert ServoFault(reply.code) == ServoFault.CHECKSUM
    assert bus.servo(1).get(m.LED) == 0


def test_registered_writes_start_together_on_action(client: Client) -> None:
    for servo in (1, 2):
        client.ask(
            servo, Protocol1Instruction.REG_WRITE, bytes((m.GOAL_POSITION.address,)) + m.GOAL_POSITION.encode(600)
        )
        assert client.read(servo, m.REGISTERED) == 1
    client.wait(0.2)
    assert [servo.angle for servo in client.bus.servos] == [0, 0, 0]
    assert client.ask(BROADCAST, Protocol1Instruction.ACTION) == []
    client.wait(0.5)
    assert [client.read(servo, m.PRESENT_POSITION) for servo in (1, 2, 3)] == [600, 600, 512]
    assert client.read(1, m.REGISTERED) == 0


def test_sync_write_reaches_all_named_servos(client: Client) -> None:
    blocks = b"".join(bytes((n,)) + m.GOAL_POSITION.encode(500 + n) + m.MOVING_SPEED.encode(100) for n in (1, 3))
    assert client.ask(BROADCAST, Protocol1Instruction.SYNC_WRITE, bytes((30, 4)) + blocks) == []
    assert [client.read(n, m.GOAL_POSITION) for n in (1, 2, 3)] == [501, 512, 503]
    assert client.ask(BROADCAST, Protocol1Instruction.SYNC_WRITE, b"\x1e") == []


def test_status_return_level_selects_the_replies(client: Client) -> None:
    client.write(2, m.STATUS_RETURN_LEVEL, 2)
    client.ask(2, Protocol1Instruction.WRITE, bytes((m.STATUS_RETURN_LEVEL.address, 1)))
    assert client.ask(2, Protocol1Instruction.WRITE, bytes((m.LED.address, 1))) == []
    assert client.read(2, m.LED) == 1
    client.ask(2, Protocol1Instruction.WRITE, bytes((m.STATUS_RETURN_LEVEL.address, 0)))
    assert client.ask(2, Protocol1Instruction.READ, bytes((m.LED.address, 1))) == []
    assert len(client.ask(2, Protocol1Instruction.PING)) == 1


def test_a_new_id_is_answered_to_from_then_on(client: Client) -> None:
    assert client.write(1, m.ID, 7) == ServoFault(0)
    assert client.ask(1, Protocol1Instruction.PING) == []
    assert client.ask(7, Protocol1Instruction.PING) == [Packet(7, 0)]


def test_two_servos_with_one_id_answer_on_top_of_each_other(client: Client) -> None:
    client.write(2, m.ID, 1)
    client.bus.servos[1].turn_by_hand(0.7)
    assert client.ask(1, Protocol1Instruction.PING) == [Packet(1, 0)]
    (reply,) = client.ask(1, Protocol1Instruction.READ, bytes((m.PRESENT_POSITION.address, 2)))
    assert not reply.intact


def test_a_new_rate_holds_once_the_reply_has_left(client: Client) -> None:
    for servo in (1, 2, 3):
        assert client.bus.baud == 1_000_000
        client.write(servo, m.BAUD, 34)
    client.wait(0.01)
    assert client.bus.baud == 57_600
    assert client.ask(2, Protocol1Instruction.PING) == [Packet(2, 0)]
    client.write(2, m.BAUD, 1)
    client.wait(0.01)
    assert client.bus.baud == 57_600
    assert client.ask(2, Protocol1Instruction.PING) == []


def test_the_lock_closes_the_eeprom_until_the_power_is_cut(client: Client) -> None:
    client.write(1, m.RETURN_DELAY, 9)
    client.write(1, m.LED, 1)
    client.write(1, m.LOCK, 1)
    assert client.write(1, m.RETURN_DELAY, 0) == ServoFault.RANGE
    assert client.write(1, m.LOCK, 0) == ServoFault.RANGE
    assert client.write(1, m.LED, 0) == ServoFault(0)
    client.bus.servo(1).power_cycle()
    assert client.read(1, m.RETURN_DELAY) == 9
    assert client.write(1, m.RETURN_DELAY, 0) == ServoFault(0)


def test_power_on_resets_ram_and_loads_the_torque_limit(client: Client) -> None:
    client.write(1, m.MAX_TORQUE, 400)
    client.write(1, m.GOAL_POSITION, 600)
    client.wait(1.0)
    client.bus.servo(1).power_cycle()
    client.wait(0.1)
    assert client.read(1, m.TORQUE_LIMIT) == 400
    assert client.read(1, m.TORQUE_ENABLE) == 0
    assert client.read(1, m.GOAL_POSITION) == client.read(1, m.PRESENT_POSITION) == 600


def test_overload_shuts_down_until_the_torque_limit_is_set(client: Client) -> None:
    servo = client.bus.servo(1)
    client.write(1, m.GOAL_POSITION, 900)
    client.wait(0.1)
    servo.load = -1.2
    client.wait(0.5)
    stopped = servo.angle
    assert client.read(1, m.PRESENT_LOAD) == -1023
    assert client.read(1, m.MOVING) == 0
    client.wait(0.7)
    (reply,) = client.ask(1, Protocol1Instruction.PING)
    assert ServoFault(reply.code) == ServoFault.OVERLOAD
    assert servo.limp
    assert client.read(1, m.TORQUE_LIMIT) == 0
    servo.load = 0.0
    client.wait(0.1)
    assert ServoFault(client.ask(1, Protocol1Instruction.PING)[0].code) == ServoFault.OVERLOAD
    assert client.write(1, m.TORQUE_LIMIT, 1023) == ServoFault(0)
    client.write(1, m.TORQUE_ENABLE, 1)
    client.wait(2.0)
    assert servo.angle > stopped
    assert client.read(1, m.PRESENT_POSITION) == 900


def test_overload_and_undervoltage_are_in_every_reply(client: Client) -> None:
    client.bus.servo(1).overload()
    client.bus.servo(1).voltage = 5.0
    client.wait(0.01)
    assert ServoFault(client.ask(1, Protocol1Instruction.PING)[0].code) == ServoFault.OVERLOAD | ServoFault.VOLTAGE
    assert ServoFault(client.ask(2, Protocol1Instruction.PING)[0].code) == ServoFault(0)


def test_overheated_servo_stays_shut_down_until_cool(client: Client) -> None:
    servo = client.bus.servo(1)
    servo.temperature = 75
    client.wait(0.1)
    client.write(1, m.TORQUE_LIMIT, 1023)
    assert client.read(1, m.TORQUE_LIMIT) == 0
    servo.temperature = 50
    client.wait(0.1)
    assert client.write(1, m.TORQUE_LIMIT, 1023) == ServoFault(0)
    assert client.read(1, m.TORQUE_LIMIT) == 1023


def test_wheel_mode_turns_endlessly_in_both_directions(client: Client) -> None:
    servo = client.bus.servo(1)
    client.write(1, m.CW_ANGLE_LIMIT, 0)
    client.write(1, m.CCW_ANGLE_LIMIT, 0)
    client.write(1, m.TORQUE_ENABLE, 1)
    client.write(1, m.MOVING_SPEED, -512)
    client.wait(0.1)
    assert servo.angle == pytest.approx(-0.1 * servo.model.free_speed * 512 / 1023, rel=0.01)
    client.write(1, m.MOVING_SPEED, 1023)
    angles = []
    for _ in range(30):
        client.wait(0.05)
        angles.append(servo.angle)
    assert max(angles) > 2.5
    assert min(angles) < -2.5


def test_partial_packet_expires_after_100_ms() -> None:
    ping = request(1, Protocol1Instruction.PING)
    whole, late = chain(1), chain(1)
    assert whole.feed(ping[:3], 1.0) + whole.feed(ping[3:], 1.05) != b""
    assert late.feed(ping[:3], 1.0) + late.feed(ping[3:], 1.2) == b""
    assert late.feed(ping, 1.3) != b""


@given(data=st.lists(st.binary(max_size=40), max_size=5))
def test_arbitrary_bytes_do_not_break_the_bus(data: list[bytes]) -> None:
    bus = chain(2)
    for step, piece in enumerate(data):
        bus.feed(piece, step * 0.01)
    bus.feed(b"", 10.0)
    assert PacketParser().feed(bus.feed(request(1, Protocol1Instruction.PING), 20.0))[-1].id in (1, 2)


@given(address=st.integers(0, 60), data=st.binary(min_size=1, max_size=12))
def test_a_write_is_carried_out_whole_or_not_at_all(address: int, data: bytes) -> None:
    servo = VirtualServo(1)
    client = Client(VirtualServoBus([servo]))
    client.wait(0.01)
    before = bytes(servo.table)
    replies = client.ask(1, Protocol1Instruction.WRITE, bytes((address,)) + data)
    if replies and replies[0].code & (ServoFault.RANGE | ServoFault.ANGLE_LIMIT):
        assert bytes(servo.table) == before
    else:
        assert all(
            register.lower <= servo.get(register) <= register.upper
            for register in servo.model.table.registers.values()
            if register.writable
        )


def test_servo_starts_at_its_angle_and_a_missing_id_is_named() -> None:
    bus = VirtualServoBus([VirtualServo(4, angle=radians(30))])
    assert bus.servo(4).angle == radians(30)
    with pytest.raises(KeyError, match="ID 5"):
        bus.servo(5)


@pytest.mark.parametrize("model", OLD, ids=lambda model: model.name)
def test_model_number_and_speed_are_those_of_the_model(model: ServoModel) -> None:
    client = Client(chain(1, model.name))
    servo, table = client.bus.servo(1), model.table
    assert client.read(1, table["model_number"]) == model.number
    (whole,) = client.ask(1, Protocol1Instruction.READ, bytes((0, table.size)))
    assert len(whole.parameters) == table.size
    client.write(1, table["moving_speed"], 40)
    assert client.write(1, table["goal_position"], model.centre_tick + 100) == ServoFault(0)
    client.wait(0.1)
    assert servo.angle == pytest.approx(0.1 * 40 * model.speed_unit, rel=0.02)
    assert client.read(1, table["present_speed"]) == 40
    client.wait(100 * model.tick / (40 * model.speed_unit))
    assert client.read(1, table["present_position"]) == model.centre_tick + 100
    assert client.read(1, table["moving"]) == 0


@pytest.mark.parametrize("model", OLD, ids=lambda model: model.name)
def test_a_goal_beyond_the_limits_is_clamped_in_a_sync_write_and_refused_in_a_plain_one(model: ServoModel) -> None:
    client = Client(chain(1, model.name))
    table, limit = model.table, model.last_tick - 100
    goal = table["goal_position"]
    client.write(1, table["ccw_angle_limit"], limit)
    assert client.write(1, goal, limit + 1) in (ServoFault.ANGLE_LIMIT, ServoFault.RANGE)
    assert client.read(1, goal) == model.centre_tick
    block = bytes((1,)) + goal.encode(model.last_tick) + table["moving_speed"].encode(1023)
    client.ask(BROADCAST, Protocol1Instruction.SYNC_WRITE, bytes((goal.address, 4)) + block)
    assert client.read(1, goal) == limit
    assert client.ask(1, Protocol1Instruction.PING) == [
        Packet(1, 0)
    ]  # a state that lasts is told in every reply; this is none
    client.wait(5.0)
    assert client.read(1, table["present_position"]) == limit
    assert client.write(1, goal, limit) == ServoFault(0)


def test_a_sync_write_of_nonsense_besides_the_goal_is_not_carried_out(client: Client) -> None:
    block = bytes((1,)) + m.GOAL_POSITION.encode(2000) + (4000).to_bytes(2, "little")
    client.ask(BROADCAST, Protocol1Instruction.SYNC_WRITE, bytes((m.GOAL_POSITION.address, 4)) + block)
    assert client.read(1, m.GOAL_POSITION) == 512
    assert client.bus.servo(1).limp


def test_mx_answer_a_bulk_read_in_turn_and_are_silent_behind_a_missing_one() -> None:
    client = Client(mixed_chain("MX-28", "MX-64", "MX-106", "AX-12A"))
    wanted = bytes((0, 2, 3, 30, 1, 1, 43, 2, 2, 36))
    replies = client.ask(BROADCAST, Protocol1Instruction.BULK_READ, wanted)
    assert [(reply.id, len(reply.parameters)) for reply in replies] == [(3, 2), (1, 1), (2, 2)]
    client.bus.servo(1).present = False
    assert [reply.id for reply in client.ask(BROADCAST, Protocol1Instruction.BULK_READ, wanted)] == [3]
    assert client.ask(BROADCAST, Protocol1Instruction.BULK_READ, bytes((0, 2, 4, 30))) == []  # an AX knows none
    assert (
        ServoFault(client.ask(4, Protocol1Instruction.BULK_READ, bytes((0, 2, 4, 30)))[0].code)
        == ServoFault.INSTRUCTION
    )


def test_factory_reset_restores_id_1_and_the_default_rate() -> None:
    for model, baud in (("AX-12A", 1_000_000), ("AX-18A", 1_000_000), ("MX-28", 57_600)):
        table = MODELS[model].table
        bus = VirtualServoBus([VirtualServo(2, model=model, angle=0.4)], 500_000)
        client = Client(bus)
        settings = {"return_delay": 7, "temperature_limit": 50, "max_torque": 300, "moving_speed": 20}
        for name, value in settings.items():
            client.write(2, table[name], value)
        client.write(2, table["torque_enable"], 1)
        assert client.ask(2, Protocol1Instruction.FACTORY_RESET) == [Packet(2, 0)], model
        client.wait(0.02)
        bus.set_baud(baud)
        assert client.ask(2, Protocol1Instruction.PING) == [], model
        assert client.ask(1, Protocol1Instruction.PING) == [Packet(1, 0)], model
        delivered = {name: MODELS[model].default(table[name]) for name in settings}
        assert {name: client.read(1, table[name]) for name in settings} == delivered, model
        assert bus.servo(1).limp, model
        assert bus.servo(1).angle == pytest.approx(0.4, abs=0.005), model


def test_mx_in_multi_turn_mode_counts_turns() -> None:
    client = Client(chain(1, "MX-28"))
    table = MODELS["MX-28"].table
    for name in table.limit_registers:
        client.write(1, table[name], 4095)
    assert client.write(1, table["goal_position"], 3 * 4096) == ServoFault(0)
    client.wait(6.0)
    assert client.read(1, table["present_position"]) == 3 * 4096
    assert client.bus.servo(1).angle == pytest.approx(5 * pi, abs=0.002)
    assert client.write(1, table["goal_position"], -28_673) == ServoFault.RANGE


def test_mx_in_wheel_mode_keeps_its_commanded_speed() -> None:
    client = Client(chain(1, "MX-28"))
    table = MODELS["MX-28"].table
    for name in table.limit_registers:
        client.write(1, table[name], 0)
    client.write(1, table["torque_enable"], 1)
    client.write(1, table["moving_speed"], -100)
    client.wait(0.5)
    assert client.bus.servo(1).angle == pytest.approx(-0.5 * 100 * MODELS["MX-28"].speed_unit, rel=0.03)
    assert client.read(1, table["present_speed"]) == -100


def test_a_reversed_servo_counts_the_other_way_round() -> None:
    client = Client(chain(1, "EX-106+"))
    model = MODELS["EX-106+"]
    client.write(1, model.table["drive_mode"], 1)
    client.write(1, model.table["goal_position"], 2048 + 300)
    client.wait(1.0)
    assert client.read(1, model.table["present_position"]) == 2048 + 300
    assert client.bus.servo(1).angle == pytest.approx(-300 * model.tick, abs=model.tick)


@pytest.mark.parametrize(("name", "none"), [("EX-106+", 512), ("MX-64", 2048)])
def test_present_current_follows_the_load(name: str, none: int) -> None:
    client = Client(chain(1, name))
    table = MODELS[name].table
    client.wait(0.01)
    assert client.read(1, table["present_current"]) == none
    client.write(1, table["goal_position"], 2048)
    client.bus.servo(1).load = 0.5
    client.wait(0.01)
    assert client.read(1, table["present_current"]) > none
    assert client.read(1, table["present_load"]) == pytest.approx(0.5 * 1023, abs=60)


def test_brown_out_leaves_the_servo_limp_and_silent_and_then_reset(client: Client) -> None:
    servo = client.bus.servo(1)
    client.write(1, m.GOAL_POSITION, 700)
    client.wait(1.0)
    servo.voltage = 5.5
    client.wait(0.01)
    assert ServoFault(client.ask(1, Protocol1Instruction.PING)[0].code) == ServoFault.VOLTAGE
    servo.brown_out(0.5)
    client.wait(0.3)
    assert client.ask(1, Protocol1Instruction.PING) == []
    assert servo.limp
    servo.turn_by_hand(0.2)
    servo.voltage = 12.0
    client.wait(0.3)
    assert client.ask(1, Protocol1Instruction.PING) == [Packet(1, 0)]
    assert client.read(1, m.TORQUE_ENABLE) == 0
    assert client.read(1, m.GOAL_POSITION) == client.read(1, m.PRESENT_POSITION) == servo.model.ticks(0.2)


def test_the_computers_rate_decides_which_servos_hear() -> None:
    client = Client(chain(2))
    client.bus.servo(2).set("baud", 34)
    client.wait(0.02)
    heard = {}
    for baud in (1_000_000, 57_600, 57_143, 115_200):
        client.bus.set_baud(baud)
        heard[baud] = [servo for servo in (1, 2) if client.ask(servo, Protocol1Instruction.PING)]
        assert client.bus.baud == baud
    assert heard == {1_000_000: [1], 57_600: [2], 57_143: [2], 115_200: []}


def test_an_empty_chain_is_silent() -> None:
    client = Client(VirtualServoBus([], 57_600))
    assert client.bus.baud == 57_600
    assert client.ask(1, Protocol1Instruction.PING) == []


def test_paced_reply_takes_its_bytes_and_return_delay() -> None:
    bus = chain(2, paced=True)
    bus.servo(2).set("return_delay", 0)
    now, read = 50.0, bytes((36, 8))
    for servo, delay in ((1, 500e-6), (2, 0.0)):
        assert bus.feed(request(servo, Protocol1Instruction.READ, read), now) == b""
        due = bus.next_poll_time()
        assert due == pytest.approx(now + 220e-6 + delay)
        assert due is not None
        assert bus.poll(due - 1e-9) == b""
        assert len(bus.poll(due)) == 14
        assert bus.next_poll_time() is None
        now = due


def test_with_pacing_a_request_waits_until_the_wire_is_free() -> None:
    bus = chain(10, paced=True)
    goals = b"".join(bytes((n,)) + m.GOAL_POSITION.encode(500) + m.MOVING_SPEED.encode(100) for n in range(1, 11))
    bus.servo(1).set("return_delay", 0)
    assert bus.feed(request(BROADCAST, Protocol1Instruction.SYNC_WRITE, bytes((30, 4)) + goals), 50.0) == b""
    bus.feed(request(1, Protocol1Instruction.PING), 50.0)
    assert bus.next_poll_time() == pytest.approx(50.0 + 580e-6 + 120e-6)


def test_paced_reply_at_57600_baud_is_slower() -> None:
    bus = VirtualServoBus([VirtualServo(1, model="RX-64")], 57_600, paced=True)
    bus.servo(1).set("return_delay", 0)
    bus.feed(request(1, Protocol1Instruction.READ, bytes((36, 8))), 50.0)
    assert bus.next_poll_time() == pytest.approx(50.0 + 22 * 10 / 57_600)


def test_angle_beyond_half_a_turn_wraps_at_power_on() -> None:
    servo = VirtualServo(1, model="MX-28", angle=radians(270))
    assert degrees(servo.angle) == pytest.approx(-90)
