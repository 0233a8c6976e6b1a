"""The bus on a line without a port: what leaves it, what it makes of what comes back, and for how long it waits.

What only a port can show is in ``test_dynamixel_adapter``.
"""

from collections.abc import Callable, Sequence

import pytest

from drivers.clock import ManualClock
from drivers.errors import BadRequest, NoReply, NotConnected
from drivers.servos.bus import MAX_READ_ATTEMPTS, ServoAddress, ServoBus, ServoIdentity
from drivers.servos.codec import MAX_REPLY_LATENESS
from drivers.servos.models import MODELS
from drivers.servos.register import RegisterBlock
from drivers.servos.wire import ServoFault, status
from drivers.servos.wire2 import ALERT, Protocol2Error
from drivers.servos.wire2 import status as status2
from tests.drivers.chains import chain, mixed_chain
from tests.drivers.fault_injection import FaultInjection
from tests.drivers.lines import direct_bus

AX, XL = MODELS["AX-12A"].table, MODELS["XL430-W250"].table
POSITION, LOAD, SPEED, LED = (AX[name] for name in ("present_position", "present_load", "moving_speed", "led"))
ONE, ONE2 = ServoAddress(1), ServoAddress(1, 2)


class Script:
    """A bus, and a line that answers each request with the next of ``answers``: pieces, each after some seconds."""

    latency = 0.0

    def __init__(self, *answers: Sequence[tuple[float, bytes]]) -> None:
        self.clock = ManualClock()
        self.sent: list[bytes] = []
        self._answers = list(answers)
        self._coming: list[tuple[float, bytes]] = []
        self.bus = ServoBus("/dev/servos", self.clock, name="arm", dial=lambda *_: self)
        self.bus.open()

    def send(self, data: bytes) -> None:
        self.sent.append(data)
        if self._answers:
            self._coming += [(self.clock.now() + after, piece) for after, piece in self._answers.pop(0)]
            self._coming.sort(key=lambda coming: coming[0])

    def receive(self, until: float) -> bytes:
        self.clock.advance_to(min(until, self._coming[0][0]) if self._coming else until)
        heard = b"".join(piece for due, piece in self._coming if due <= self.clock.now())
        self._coming = [coming for coming in self._coming if coming[0] > self.clock.now()]
        return heard

    def set_baud(self, baud: int) -> None:
        """Take any rate."""

    def close(self) -> None:
        """Let go of nothing."""


def soon(*pieces: bytes) -> list[tuple[float, bytes]]:
    return [(0.0002 * (place + 1), piece) for place, piece in enumerate(pieces)]


def late(reply: bytes) -> list[tuple[float, bytes]]:
    """Return a reply that comes when the bus has given up, and tried again once."""
    return [(0.009, reply)]


# --- replies that come too late ---------------------------------------------------------------------------------------


class AlwaysLate(FaultInjection):
    def disturb(self, reply: bytes) -> list[tuple[float, bytes]]:
        return late(reply)


def test_late_reply_is_never_taken_for_another_register() -> None:
    servos = chain(1, paced=True, injection=AlwaysLate())
    bus, _, _ = direct_bus(servos)
    heard = [(register.name, bus.read(ONE, register)) for _ in range(100) for register in (POSITION, LOAD)]
    held = {register.name: servos.servo(1).get(register) for register in (POSITION, LOAD)}
    assert held["present_position"] != held["present_load"]
    assert [reading for reading in heard if reading[1] != held[reading[0]]] == []
    assert bus.statistics(1).late > 0


def test_read_after_a_miss_is_widened_to_an_unambiguous_size() -> None:
    script = Script([], soon(status(1, 0, bytes((9, 9, 9, 0x2C, 0x01)))))
    with pytest.raises(NoReply):
        script.bus.read_block(ONE, 36, 2, tries=1)
    assert script.bus.read_block(ONE, 40, 2) == b"\x2c\x01"
    assert [request[5:7] for request in script.sent] == [bytes((36, 2)), bytes((37, 5))]


def test_a_reading_is_never_older_than_the_question() -> None:
    script = Script(late(status(1, 0, b"\x07\x00")), soon(status(1, 0, b"\x00\x00\x00\x08\x00")))
    with pytest.raises(NoReply):
        script.bus.read_block(ONE, 36, 2, tries=1)
    assert script.bus.read_block(ONE, 36, 2) == b"\x08\x00"


def test_the_tries_of_one_read_are_the_same_question() -> None:
    script = Script(late(status(1, 0, b"\x07\x00")), [])
    assert script.bus.read_block(ONE, 36, 2) == b"\x07\x00"
    assert script.sent[0] == script.sent[1]


def test_late_reply_alone_is_counted_and_discarded() -> None:
    script = Script(late(status(1, 0, b"\x07\x00")), soon(status(2)), soon(status(1, 0, b"\x08\x00")))
    with pytest.raises(NoReply):
        script.bus.read_block(ONE, 36, 2, tries=1)
    script.clock.advance(0.01)
    script.bus.write(ServoAddress(2), SPEED, 1)
    assert script.bus.statistics(1).late == 1
    assert script.bus.read_block(ONE, 40, 2) == b"\x08\x00"
    assert script.sent[2][5:7] == bytes((40, 2))


def test_second_write_waits_for_the_overdue_acknowledgement() -> None:
    script = Script(late(status(1)), [])
    with pytest.raises(NoReply):
        script.bus.write(ONE, SPEED, 1)
    with pytest.raises(NoReply):  # its own acknowledgement was lost: that of the first must not stand for it
        script.bus.write(ONE, SPEED, 2)
    assert script.bus.statistics(1).late == 1


@pytest.mark.parametrize(("servo", "value", "wait"), [(1, 2, MAX_REPLY_LATENESS), (1, 1, 0.0), (2, 2, 0.0)])
def test_equal_write_and_other_servos_do_not_wait(servo: int, value: int, wait: float) -> None:
    script = Script([], soon(status(servo)))
    with pytest.raises(NoReply):
        script.bus.write(ONE, SPEED, 1)
    missed = script.clock.now()
    script.bus.write(ServoAddress(servo), SPEED, value)
    assert script.clock.now() - missed == pytest.approx(wait + 0.0002, abs=0.0001)


# --- what is on the wire ----------------------------------------------------------------------------------------------

P1, P2 = "FF FF ", "FF FF FD 00 "
CONVERSATIONS: list[tuple[Callable[[ServoBus], object], str, list[str], object]] = [
    (lambda bus: bus.read_block(ONE, 43, 1), P1 + "01 04 02 2B 01 CC", [P1 + "01 03 00 20 DB"], b"\x20"),
    (lambda bus: bus.read(ONE, AX["model_number"]), P1 + "01 04 02 00 02 F6", [P1 + "01 04 00 0C 00 EE"], 12),
    (
        lambda bus: bus.read_block(ONE, 36, 8),
        P1 + "01 04 02 24 08 CC",
        [P1 + "01 0A 00 00 02 00 00 00 00 78 23 57"],
        bytes.fromhex("00 02 00 00 00 00 78 23"),
    ),
    (lambda bus: bus.write(ONE, AX["torque_enable"], 1), P1 + "01 04 03 18 01 DE", [P1 + "01 02 00 FC"], None),
    (lambda bus: bus.write(ONE, AX["goal_position"], 512), P1 + "01 05 03 1E 00 02 D6", [P1 + "01 02 00 FC"], None),
    (
        lambda bus: bus.write_block(ONE, 30, bytes.fromhex("00 02 64 00")),
        P1 + "01 07 03 1E 00 02 64 00 70",
        [P1 + "01 02 20 DC"],
        None,
    ),
    (lambda bus: bus.write(ONE, AX["id"], 2), P1 + "01 04 03 03 02 F2", [P1 + "01 02 24 D8"], None),
    (lambda bus: bus.reset(ServoAddress(0), "nothing"), P1 + "00 02 06 F7", [P1 + "00 02 00 FD"], None),
    (
        lambda bus: bus.sync_write_block(1, 30, {0: bytes.fromhex("10 00 50 01"), 1: bytes.fromhex("20 02 60 03")}),
        P1 + "FE 0E 83 1E 04 00 10 00 50 01 01 20 02 60 03 67",
        [],
        None,
    ),
    (
        lambda bus: bus.read_many(
            {ServoAddress(1): RegisterBlock(30, 2), ServoAddress(2): RegisterBlock(36, 2)}, mode="bulk"
        ),
        P1 + "FE 09 92 00 02 01 1E 02 02 24 1D",
        [P1 + "01 04 00 00 02 F8", P1 + "02 04 00 01 02 F6"],
        {ServoAddress(1): b"\x00\x02", ServoAddress(2): b"\x01\x02"},
    ),
    (lambda bus: bus.identify(ONE2), P2 + "01 03 00 01 19 4E", [P2 + "01 07 00 55 00 06 04 26 65 5D"], (1030, 38)),
    (lambda bus: bus.ping(ONE2), P2 + "01 03 00 01 19 4E", [P2 + "01 07 00 55 00 24 04 2D F4 DF"], 1060),
    (
        lambda bus: bus.read(ONE2, XL["present_position"]),
        P2 + "01 07 00 02 84 00 04 00 1D 15",
        [P2 + "01 08 00 55 00 A6 00 00 00 8C C0"],
        166,
    ),
    (
        lambda bus: bus.write(ONE2, XL["goal_position"], 512),
        P2 + "01 09 00 03 74 00 00 02 00 00 CA 89",
        [P2 + "01 04 00 55 00 A1 0C"],
        None,
    ),
    (
        lambda bus: bus.write_block(ONE2, 116, bytes.fromhex("FF FF FD 00")),
        P2 + "01 0A 00 03 74 00 FF FF FD FD 00 21 E7",
        [P2 + "01 04 00 55 00 A1 0C"],
        None,
    ),
    (lambda bus: bus.reset(ONE2, "id"), P2 + "01 04 00 06 01 A1 E6", [P2 + "01 04 00 55 00 A1 0C"], None),
    (lambda bus: bus.reboot(ONE2), P2 + "01 03 00 08 2F 4E", [P2 + "01 04 00 55 00 A1 0C"], None),
    (
        lambda bus: bus.read_many(dict.fromkeys((ONE2, ServoAddress(2, 2)), RegisterBlock(132, 4)), mode="sync"),
        P2 + "FE 09 00 82 84 00 04 00 01 02 CE FA",
        [P2 + "01 08 00 55 00 A6 00 00 00 8C C0", P2 + "02 08 00 55 00 1F 08 00 00 BA BE"],
        {ONE2: b"\xa6\x00\x00\x00", ServoAddress(2, 2): b"\x1f\x08\x00\x00"},
    ),
    (
        lambda bus: bus.sync_write(2, XL["goal_position"], {1: 150, 2: 170}),
        P2 + "FE 11 00 83 74 00 04 00 01 96 00 00 00 02 AA 00 00 00 82 87",
        [],
        None,
    ),
    (
        lambda bus: bus.read_many(
            {ONE2: RegisterBlock(144, 2), ServoAddress(2, 2): RegisterBlock(146, 1)}, mode="bulk"
        ),
        P2 + "FE 0D 00 92 01 90 00 02 00 02 92 00 01 00 1A 05",
        [],
        {},
    ),
    (
        lambda bus: bus.read(ONE2, XL["hardware_error"]),
        P2 + "01 07 00 02 46 00 01 00 3C A3",
        [P2 + "01 05 00 55 80 20 99 21"],
        32,
    ),
]


@pytest.mark.parametrize(("act", "request_", "replies", "result"), CONVERSATIONS)
def test_the_published_packets_leave_and_are_understood(
    act: Callable[[ServoBus], object], request_: str, replies: list[str], result: object
) -> None:
    script = Script(soon(*(bytes.fromhex(reply) for reply in replies)))
    told = act(script.bus)
    assert script.sent == [bytes.fromhex(request_)]
    assert result == ((told.number, told.firmware) if isinstance(told, ServoIdentity) else told)


def test_all_servos_of_protocol_2_are_found_by_one_ping() -> None:
    reply = bytes.fromhex(P2 + "01 07 00 55 00 06 04 26 65 5D")
    script = Script([(0.004, reply), (0.030, status2(10, 0, b"\x24\x04\x2d"))])
    found = list(script.bus.find_servos(protocol=2, ids=range(253)))
    assert script.sent == [bytes.fromhex(P2 + "FE 03 00 01 31 42")]
    assert found == [ServoIdentity(ONE2, 1030, 38), ServoIdentity(ServoAddress(10, 2), 1060, 45)]


def test_servos_of_protocol_1_are_found_one_by_one() -> None:
    bus, _, clock = direct_bus(mixed_chain("AX-12A", "XL430-W250", "MX-28"))
    assert [(found.address, found.number) for found in bus.find_servos(protocol=1, ids=range(5))] == [
        (ServoAddress(1), 12),
        (ServoAddress(3), 29),
    ]
    assert clock.now() < 3 * 0.006
    assert [identity.number for identity in bus.find_servos(protocol=2, ids=range(5))] == [1060]


def test_sync_write_is_split_at_the_packet_limit() -> None:
    script = Script()
    script.bus.sync_write_block(1, 30, {servo: bytes(4) for servo in range(60)})
    assert [len(packet) for packet in script.sent] == [8 + 27 * 5, 8 + 27 * 5, 8 + 6 * 5]
    assert max(len(packet) for packet in script.sent) <= 143
    script.sent.clear()
    script.bus.sync_write_block(2, 116, {servo: bytes(4) for servo in range(200)})
    assert len(script.sent) == 2
    script.bus.sync_write_block(2, 116, {})
    assert len(script.sent) == 2


# --- how long it waits ------------------------------------------------------------------------------------------------


def test_missing_servo_costs_less_than_6_ms() -> None:
    bus, _, clock = direct_bus(chain(3, paced=True))
    with pytest.raises(NoReply):
        bus.read_block(ServoAddress(9), 36, 11, tries=1)
    assert 25 * 10e-6 + 254 * 2e-6 < clock.now() < 0.006


def test_maximum_return_delay_is_tolerated_at_any_baud_rate() -> None:
    servos = chain(1, paced=True)
    servos.servo(1).set("return_delay", 254)
    bus, _, clock = direct_bus(servos, patience=0.0001)
    bus.read_block(ONE, 0, 50)
    slow = mixed_chain("RX-64", baud=57_600, paced=True)
    bus, _, clock = direct_bus(slow, patience=0.0001, baud=57_600)
    before = clock.now()
    bus.sync_write_block(1, 30, {servo: bytes(4) for servo in range(20)})  # it needs 19 ms to leave
    bus.read_block(ONE, 0, 50)
    assert clock.now() - before == pytest.approx((108 + 8 + 56) * 10 / 57_600 + 0.0005, rel=0.01)
    assert bus.statistics(1).misses == 0


def test_latency_of_a_slow_adapter_is_added_to_the_timeout() -> None:
    bus, _, clock = direct_bus(chain(1), latency=0.016)
    assert bus.latency == 0.016
    with pytest.raises(NoReply):
        bus.read_block(ServoAddress(9), 36, 11, tries=1)
    assert 0.016 < clock.now() < 0.022


def test_busy_time_measures_the_use_of_the_wire() -> None:
    bus, _, clock = direct_bus(chain(2, paced=True))
    for servo in (1, 2):
        bus.read_block(ServoAddress(servo), 36, 11)
    clock.advance(1.0)
    assert bus.busy_time() == pytest.approx(2 * (25 * 10e-6 + 500e-6), rel=0.01)
    bus.sync_write_block(1, 30, {1: bytes(4), 2: bytes(4)})
    assert bus.busy_time() == pytest.approx(2 * (25 * 10e-6 + 500e-6) + 18 * 10e-6, rel=0.01)
    assert bus.statistics(1).slowest == pytest.approx(25 * 10e-6 + 500e-6, rel=0.01)


# --- many at once -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("model", ["MX-28", "XL430-W250"])
def test_of_many_the_missing_ones_are_missing_and_never_zero(model: str) -> None:
    servos = chain(10, model, paced=True)
    bus, _, clock = direct_bus(servos)
    fast, protocol = MODELS[model].table.fast_block, MODELS[model].protocol
    wanted = {ServoAddress(number, protocol): fast for number in range(1, 11)}
    how = MODELS[model].read_mode
    assert how != "single"
    assert bus.read_many(wanted, mode=how).keys() == wanted.keys()
    servos.servo(10).present = False
    before = clock.now()
    found = bus.read_many(wanted, mode=how)
    assert found.keys() == wanted.keys() - {ServoAddress(10, protocol)}
    assert all(len(data) == fast.size for data in found.values())
    assert clock.now() - before < 0.006 + sum(10e-6 * (fast.size + 14) + 500e-6 for _ in wanted)
    assert bus.statistics(10).misses == 1


def test_damaged_reply_spoils_only_itself_in_a_group() -> None:
    damaged = status(2, 0, b"\x03\x04")[:-1] + b"\x00"
    script = Script(soon(status(1, 0, b"\x01\x02") + damaged + status(3, 0, b"\x05\x06")))
    found = script.bus.read_many(
        dict.fromkeys((ServoAddress(1), ServoAddress(2), ServoAddress(3)), RegisterBlock(36, 2)), mode="bulk"
    )
    assert found == {ServoAddress(1): b"\x01\x02", ServoAddress(3): b"\x05\x06"}
    assert script.bus.statistics(2).corrupt == 1


def test_servo_owing_an_equal_reply_is_left_out_of_the_group() -> None:
    script = Script([], soon(status(2, 0, b"\x07\x00")))
    with pytest.raises(NoReply):
        script.bus.read_block(ONE, 40, 2, tries=1)
    assert script.bus.read_many(
        dict.fromkeys((ServoAddress(1), ServoAddress(2)), RegisterBlock(36, 2)), mode="bulk"
    ) == {ServoAddress(2): b"\x07\x00"}
    assert script.sent[1] == bytes.fromhex("FF FF FE 06 92 00 02 02 24 41")
    with pytest.raises(NoReply):
        script.bus.read_block(ServoAddress(2), 40, 2, tries=1)
    assert (
        script.bus.read_many(dict.fromkeys((ServoAddress(1), ServoAddress(2)), RegisterBlock(36, 2)), mode="bulk") == {}
    )
    assert len(script.sent) == 3


def test_invalid_group_read_is_refused() -> None:
    bus, line, _ = direct_bus(chain(2))
    with pytest.raises(BadRequest, match=r"protocol 1\.0 has no sync read"):
        bus.read_many({ONE: RegisterBlock(36, 2)}, mode="sync")
    with pytest.raises(BadRequest, match="the same block of all servos"):
        bus.read_many({ONE2: RegisterBlock(36, 2), ServoAddress(2, 2): RegisterBlock(40, 2)}, mode="sync")
    with pytest.raises(BadRequest, match="both protocols"):
        bus.read_many({ServoAddress(1): RegisterBlock(36, 2), ServoAddress(2, 2): RegisterBlock(36, 2)}, mode="bulk")
    with pytest.raises(BadRequest, match=r"cannot hold blocks of \[2, 4\] bytes"):
        bus.sync_write_block(1, 30, {1: bytes(4), 2: bytes(2)})
    with pytest.raises(BadRequest, match=r"cannot hold blocks of \[200\] bytes"):
        bus.sync_write_block(1, 0, {1: bytes(200)})
    with pytest.raises(BadRequest, match=r"0\.\.253 in protocol 1\.0, not 254"):
        bus.sync_write(1, LED, {254: 1})
    assert bus.read_many({}, mode="bulk") == {}
    assert line.sent == []


# --- replies that are not sound ---------------------------------------------------------------------------------------

SOUND = status(1, 0, b"\x00\x02")


@pytest.mark.parametrize("noise", [b"\x00", b"\xff", b"\x00\xff\x13", b"\xff\x00\xff\x01"])
def test_noise_before_the_header_is_passed_over_and_counted(noise: bytes) -> None:
    script = Script(soon(noise + SOUND))
    assert script.bus.read(ONE, POSITION) == 512
    assert script.bus.statistics(1).tries == 1
    assert script.bus.noise_bytes() == len(noise)


def test_a_reply_may_come_in_pieces() -> None:
    script = Script(soon(*(bytes((byte,)) for byte in SOUND)))
    assert script.bus.read(ONE, POSITION) == 512
    assert script.bus.statistics(1).tries == 1


@pytest.mark.parametrize(
    ("reply", "corrupt"),
    [
        (SOUND[:-1] + bytes((SOUND[-1] ^ 1,)), 1),
        (status(1, 0, b"\x07"), 1),  # one byte where two were asked for
        (status(1, 0, b"\x07\x08\x09"), 1),
        (status(1, ServoFault.CHECKSUM), 1),  # our request arrived damaged
        (bytes.fromhex("FF FF 01 01 FD 00"), 0),  # shorter than any packet, with a right checksum
        (SOUND[:5], 0),
        (status(2, 0, b"\x07\x08"), 0),  # somebody else's
        (bytes.fromhex("FF FF 01 04 02 24 02 D2"), 0),  # the adapter's echo of our request
    ],
)
def test_an_unsound_reply_is_never_taken_for_a_number(reply: bytes, corrupt: int) -> None:
    script = Script(soon(reply), soon(SOUND))
    assert script.bus.read(ONE, POSITION) == 512
    tally = script.bus.statistics(1)
    assert (tally.tries, tally.corrupt, tally.misses) == (2, corrupt, 1 - corrupt)


def test_damaged_reply_is_retried_at_once() -> None:
    script = Script(soon(SOUND[:-1] + b"\x00"), soon(SOUND))
    assert script.bus.read(ONE, POSITION) == 512
    assert script.clock.now() < 0.001


def test_persistently_damaged_replies_give_the_likely_cause() -> None:
    script = Script(*[soon(SOUND[:-1] + b"\x00")] * MAX_READ_ATTEMPTS)
    with pytest.raises(NoReply, match=r"3 of 3 replies .* damaged") as caught:
        script.bus.read(ONE, POSITION)
    assert "two with ID 1" in caught.value.hint


def test_silent_servo_gives_a_hint() -> None:
    bus, _, _ = direct_bus(chain(3))
    with pytest.raises(NoReply, match=r"arm: servo 9: no reply to a read of 2 bytes at 36 on .* at 1000000") as caught:
        bus.read(ServoAddress(9), POSITION)
    assert "power" in caught.value.hint
    assert "protocol (1.0)" in caught.value.hint
    tally = bus.statistics(9)
    assert (tally.tries, tally.misses, tally.corrupt) == (MAX_READ_ATTEMPTS, MAX_READ_ATTEMPTS, 0)
    assert bus.read(ONE, POSITION) == 512


def test_echoing_adapter_is_supported() -> None:
    servos = mixed_chain("AX-12A", "XL430-W250")
    servos.injection = FaultInjection(echo=1.0)
    bus, _, _ = direct_bus(servos)
    assert bus.ping(ONE) == 12
    assert bus.ping(ServoAddress(2, 2)) == 1060
    bus.write(ONE, SPEED, 77)
    assert bus.read(ONE, SPEED) == 77
    bus.sync_write(1, SPEED, {1: 78})
    assert bus.read(ONE, SPEED) == 78
    with pytest.raises(NoReply):
        bus.ping(ServoAddress(9))  # the echo of what is asked of it is not its answer
    assert bus.statistics(1).tries == bus.statistics(2).tries + 3


# --- what servos say --------------------------------------------------------------------------------------------------


def test_bus_reads_and_writes_in_both_protocols() -> None:
    bus, _, _ = direct_bus(mixed_chain("AX-12A", "XL430-W250", "RX-64", "XL430-W250"))
    bus.write(ONE, AX["goal_position"], 600)
    assert bus.read(ONE, AX["goal_position"]) == 600
    bus.sync_write(1, SPEED, {1: 11, 3: 33})
    bus.sync_write(2, XL["profile_velocity"], {2: 22, 4: 44})
    assert [bus.read(ServoAddress(servo), SPEED) for servo in (1, 3)] == [11, 33]
    assert [bus.read(ServoAddress(servo, 2), XL["profile_velocity"]) for servo in (2, 4)] == [22, 44]
    block = bus.read_block(ONE, 30, 4)
    assert (AX["goal_position"].decode(block, 30), SPEED.decode(block, 30)) == (600, 11)
    assert bus.statistics(9).tries == 0


def test_a_write_without_a_reply_is_not_repeated() -> None:
    servos = chain(1, injection=FaultInjection(drop=1.0))
    bus, line, _ = direct_bus(servos)
    with pytest.raises(NoReply, match="write of 01 at 25"):
        bus.write(ONE, LED, 1)
    assert len(line.sent) == bus.statistics(1).tries == 1
    assert servos.servo(1).get("led") == 1  # it was carried out: only the reply was lost


def test_refused_request_is_a_bad_request() -> None:
    bus, _, _ = direct_bus(mixed_chain("AX-12A", "XL430-W250"))
    with pytest.raises(BadRequest, match="servo 1 refused a write of 05 at 24: range"):
        bus.write_block(ONE, 24, b"\x05")
    with pytest.raises(BadRequest, match="servo 1 refused a read of 9 bytes at 48: range"):
        bus.read_block(ONE, 48, 9)
    bus.write(ServoAddress(2, 2), XL["torque_enable"], 1)
    with pytest.raises(BadRequest, match="servo 2 refused a write of 05 at 7: access") as caught:
        bus.write(ServoAddress(2, 2), XL["id"], 5)
    assert "torque off" in caught.value.hint
    assert (bus.statistics(1).refused, bus.statistics(2).refused) == (2, 1)


def test_invalid_value_is_refused_before_sending() -> None:
    bus, line, _ = direct_bus(chain(1))
    with pytest.raises(BadRequest, match=r"torque_limit takes 0\.\.1023, not 1024"):
        bus.write(ONE, AX["torque_limit"], 1024)
    with pytest.raises(BadRequest, match=r"servo 2: led takes 0\.\.1, not 2"):
        bus.sync_write(1, LED, {1: 1, 2: 2})
    with pytest.raises(BadRequest, match="no address or size 256"):
        bus.read_block(ONE, 256, 2)
    with pytest.raises(BadRequest, match="a packet holds 253 parameters, not 301"):
        bus.write_block(ONE, 0, bytes(300))
    with pytest.raises(BadRequest, match=r"0\.\.253 in protocol 1\.0, not 254"):
        bus.ping(ServoAddress(254))
    with pytest.raises(BadRequest, match=r"0\.\.252 in protocol 2\.0, not 253"):
        bus.ping(ServoAddress(253, 2))
    with pytest.raises(BadRequest, match=r"protocol 1\.0 has no reboot") as caught:
        bus.reboot(ONE)
    assert "torque limit" in caught.value.hint
    with pytest.raises(BadRequest, match=r"protocol 1\.0 has no factory reset that keeps the id"):
        bus.reset(ONE, "id")
    assert line.sent == []


def test_lasting_faults_do_not_spoil_a_reading() -> None:
    servos = chain(2)
    bus, _, _ = direct_bus(servos)
    servos.servo(1).overload()
    assert bus.read(ONE, AX["torque_limit"]) == 0
    assert bus.faults(1) == ServoFault.OVERLOAD
    assert bus.faults(2) == ServoFault(0)


def test_protocol_2_alert_is_reported_with_the_reading() -> None:
    script = Script(soon(status2(1, ALERT, b"\x07")), soon(status2(1, ALERT | Protocol2Error.RANGE)))
    assert script.bus.read(ONE2, XL["led"]) == 7
    assert script.bus.faults(1) == ServoFault.ALERT
    with pytest.raises(BadRequest, match=r"range$"):
        script.bus.write(ONE2, XL["led"], 1)
    assert script.bus.faults(1) == ServoFault.ALERT


# --- the line ---------------------------------------------------------------------------------------------------------


def test_changed_baud_rate_reaches_other_servos() -> None:
    servos = mixed_chain("AX-12A", "AX-12A", baud=57_600)
    bus, _, _ = direct_bus(servos)
    assert bus.baud == 1_000_000
    with pytest.raises(NoReply):
        bus.ping(ONE, tries=1)
    bus.baud = 57_600
    assert bus.ping(ONE) == 12


def test_lost_line_is_closed_and_can_be_reopened() -> None:
    bus, line, _ = direct_bus(chain(1))
    line.plugged = False
    with pytest.raises(NotConnected):
        bus.read(ONE, LED)
    assert not bus.is_open
    with pytest.raises(NotConnected, match="unplugged"):
        bus.sync_write(1, LED, {1: 1})
    with pytest.raises(NotConnected, match="no such device"):
        bus.open()
    bus.baud = 57_600  # for when it is back
    with pytest.raises(NotConnected, match="no such device"):
        bus.require_open()
    line.plugged = True
    bus.baud = 1_000_000
    bus.open()
    assert bus.ping(ONE) == 12


def test_overdue_replies_are_forgotten_on_reopen() -> None:
    servos = chain(1)
    bus, line, _ = direct_bus(servos)
    servos.servo(1).present = False
    with pytest.raises(NoReply):
        bus.read(ONE, POSITION)
    servos.servo(1).present = True
    bus.close()
    bus.open()
    bus.read(ONE, LOAD)
    assert line.sent[-1][5:7] == bytes((40, 2))
