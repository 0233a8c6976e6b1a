"""Settings changed for good: compared, torque off, written, verified; and nothing written that need not be."""

import pytest

from drivers.errors import BadRequest, DeviceFault, NoReply, NotConnected
from drivers.servos.bus import ServoAddress, ServoBus
from drivers.servos.models import MODELS
from drivers.servos.settings import FORCE_REGISTERS, SOFTNESS_REGISTERS, RegisterChange, apply_changes, plan_changes
from drivers.servos.virtual.chain import VirtualServoBus
from drivers.servos.virtual.servo import VirtualServo
from drivers.servos.wire import Protocol1Instruction
from tests.drivers.wired import Wired

NAMES = ["AX-12A", "EX-106+", "MX-64", "MX-28(2.0)", "XM430-W350"]


class Bench:
    """Servos of one model with the IDs 1 and 2, of which the first is worked on."""

    def __init__(self, name: str = "AX-12A") -> None:
        self.model = MODELS[name]
        self.servo, self.other = (VirtualServo(number, model=name) for number in (1, 2))
        self.chain = VirtualServoBus([self.servo, self.other])
        self.wired = Wired(self.chain)
        self.bus: ServoBus = self.wired.bus()
        self.at = ServoAddress(1, self.model.protocol)

    def plan(self, **wanted: int) -> list[RegisterChange]:
        return plan_changes(self.bus, self.at, self.model.table, wanted)

    def set(self, **wanted: int) -> bool:
        return apply_changes(self.bus, self.at, self.model.table, self.plan(**wanted))

    @property
    def writes(self) -> list[bytes]:
        place = 4 if self.model.protocol == 1 else 7
        return [packet for packet in self.wired.sent if packet[place] == Protocol1Instruction.WRITE]


def named(changes: list[RegisterChange]) -> list[tuple[str, int, int]]:
    return [(change.register.name, change.before, change.after) for change in changes]


@pytest.fixture
def bench() -> Bench:
    return Bench()


def test_plan_lists_only_differences_and_writes_nothing(bench: Bench) -> None:
    assert named(bench.plan(return_delay=0, temperature_limit=70, lowest_voltage=90)) == [
        ("return_delay", 250, 0),
        ("lowest_voltage", 60, 90),
    ]
    assert not bench.writes


def test_servo_with_equal_settings_is_not_written(bench: Bench) -> None:
    bench.servo.set("torque_enable", 1)
    assert bench.set(return_delay=250) is False
    assert not bench.writes
    assert bench.servo.get("torque_enable") == 1


@pytest.mark.parametrize("name", NAMES)
def test_servo_is_relaxed_before_eeprom_writes(name: str) -> None:
    bench = Bench(name)
    bench.servo.set("torque_enable", 1)
    assert bench.set(return_delay=0, temperature_limit=65) is True
    assert (bench.servo.get("return_delay"), bench.servo.get("temperature_limit")) == (0, 65)
    assert bench.servo.get("torque_enable") == 0
    assert len(bench.writes) == 3
    assert bench.other.get("return_delay") == 250
    assert not bench.plan(return_delay=0, temperature_limit=65)


def test_limp_servo_is_not_relaxed_again(bench: Bench) -> None:
    assert bench.set(return_delay=0) is False
    assert len(bench.writes) == 1


def test_ram_setting_is_written_without_relaxing(bench: Bench) -> None:
    bench.servo.set("torque_enable", 1)
    assert bench.set(led=1) is False
    assert bench.servo.get("led") == bench.servo.get("torque_enable") == 1


def test_values_with_a_sign_are_written_and_verified() -> None:
    bench = Bench("XM430-W350")
    bench.set(homing_offset=-1000)
    assert bench.servo.get("homing_offset") == -1000


def test_all_faults_of_settings_are_reported_together(bench: Bench) -> None:
    with pytest.raises(BadRequest) as caught:
        bench.plan(return_delay=255, model_number=3, temprature_limit=60, status_return_level=0)
    message = str(caught.value)
    assert message.startswith("arm: servo 1: ")
    assert "return_delay takes 0..254, not 255" in message
    assert "model_number cannot be written" in message
    assert "'temprature_limit'" in message
    assert "status_return_level must stay at 1 or above, not 0" in message
    assert "temperature_limit" in caught.value.hint
    assert not bench.wired.sent


@pytest.mark.parametrize("name", NAMES)
def test_torque_is_not_switched_on_over_an_old_goal(name: str) -> None:
    bench = Bench(name)
    with pytest.raises(BadRequest, match="torque_enable 1 could make it leap") as refusal:
        bench.plan(torque_enable=1)
    assert "mission servo torque on" in refusal.value.hint
    bench.servo.set("torque_enable", 1)
    assert named(bench.plan(torque_enable=0)) == [("torque_enable", 1, 0)]
    with pytest.raises(BadRequest, match="goal_position 700 would move it all the way") as refusal:
        bench.plan(goal_position=700)
    assert "mission servo move" in refusal.value.hint


@pytest.mark.parametrize("name", NAMES)
def test_speed_zero_is_refused_in_joint_mode(name: str) -> None:
    bench = Bench(name)
    speed = bench.model.table.speed
    bench.servo.set(speed, 100)
    with pytest.raises(BadRequest, match=f"{speed} 0 means full speed"):
        bench.plan(**{speed: 0})


def test_speed_zero_is_accepted_in_wheel_mode(bench: Bench) -> None:
    bench.servo.set("cw_angle_limit", 0)
    bench.servo.set("ccw_angle_limit", 0)
    bench.servo.set("moving_speed", 100)
    assert named(bench.plan(moving_speed=0)) == [("moving_speed", 100, 0)]


def test_protocol_change_is_refused() -> None:
    with pytest.raises(BadRequest, match="protocol must stay at 2"):
        Bench("XL430-W250").plan(protocol=1)


@pytest.mark.parametrize("name", NAMES)
def test_a_new_id_comes_last_and_is_verified_where_the_servo_answers_then(name: str) -> None:
    bench = Bench(name)
    assert [row[0] for row in named(bench.plan(id=7, return_delay=0))] == ["return_delay", "id"]
    bench.set(id=7, return_delay=0)
    assert (bench.servo.get("id"), bench.servo.get("return_delay")) == (7, 0)


def test_taken_id_is_refused(bench: Bench) -> None:
    with pytest.raises(BadRequest, match=r"servo 1 cannot become 2"):
        bench.plan(id=2)
    assert bench.servo.get("id") == 1


def test_id_shared_by_two_servos_is_taken() -> None:
    ax, rx = VirtualServo(5, model="AX-12A"), VirtualServo(5, model="RX-64")
    wired = Wired(VirtualServoBus([VirtualServo(1), ax, rx]))
    with pytest.raises(BadRequest, match="cannot become 5"):
        plan_changes(wired.bus(), ServoAddress(1), MODELS["AX-12A"].table, {"id": 5})


@pytest.mark.parametrize("name", NAMES)
def test_id_taken_after_the_plan_is_refused(name: str) -> None:
    bench = Bench(name)
    changes = bench.plan(id=9, return_delay=0)
    bench.other.set("id", 9)  # as plugged in while a person reads the question
    bench.servo.set("torque_enable", 1)
    with pytest.raises(BadRequest, match=r"servo 1 cannot become 9"):
        apply_changes(bench.bus, bench.at, bench.model.table, changes)
    assert [bench.servo.get(name) for name in ("id", "return_delay", "torque_enable")] == [1, 250, 1]


NO_FORCE = frozenset(
    {
        *("led", "lock", "registered", "status_return_level", "bus_watchdog", "moving_threshold", "goal_position"),
        *("goal_speed", "goal_time", "goal_velocity", "goal_acceleration", "moving_speed", "profile_velocity"),
        *("profile_acceleration", "fastest_speed", "fastest_acceleration", "acceleration_multiplier"),
        *("position_d_gain", "feedforward_1st_gain", "feedforward_2nd_gain"),  # nothing at a joint that stands
    }
)
"""Registers in RAM that do not change how a servo holds a joint that stands."""


def test_each_register_in_ram_is_known_to_change_the_force_or_not() -> None:
    found = {
        row.name
        for model in MODELS.values()
        for row in model.table.registers.values()
        if row.writable and not row.eeprom
    }
    assert found <= FORCE_REGISTERS | SOFTNESS_REGISTERS | NO_FORCE
    assert not (FORCE_REGISTERS | SOFTNESS_REGISTERS) & NO_FORCE
    for model in MODELS.values():
        assert {model.table.torque_limit, model.table.torque_ceiling} <= FORCE_REGISTERS
    names = {row.name for model in MODELS.values() for row in model.table.registers.values()}
    assert names >= FORCE_REGISTERS | SOFTNESS_REGISTERS


@pytest.mark.parametrize(
    ("name", "before", "after", "weakens"),
    [
        ("torque_enable", 1, 0, True),
        ("torque_limit", 1023, 100, True),
        ("torque_limit", 100, 1023, False),
        ("cw_compliance_slope", 32, 128, True),
        ("cw_compliance_margin", 9, 1, False),
        ("goal_pwm", -885, -100, True),
        ("goal_pwm", 100, -885, True),
        ("goal_current", -100, -1193, False),
        ("torque_mode", 0, 1, True),
        ("led", 1, 0, False),
    ],
)
def test_change_knows_if_it_weakens_the_servo(name: str, before: int, after: int, weakens: bool) -> None:
    registers = {row.name: row for model in MODELS.values() for row in model.table.registers.values()}
    assert RegisterChange(registers[name], before, after).weakens is weakens


def test_own_id_is_not_taken(bench: Bench) -> None:
    assert not bench.plan(id=1)


@pytest.mark.parametrize(("name", "code", "baud"), [("AX-12A", 3, 500_000), ("XM430-W350", 1, 57_600)])
def test_new_baud_rate_is_verified_and_the_bus_keeps_its_own(name: str, code: int, baud: int) -> None:
    bench = Bench(name)
    assert [row[0] for row in named(bench.plan(baud=code, id=9, return_delay=0))] == ["return_delay", "id", "baud"]
    bench.set(baud=code, id=9, return_delay=0)
    assert (bench.servo.get("baud"), bench.servo.get("id")) == (code, 9)
    assert bench.bus.baud == 1_000_000
    assert baud in bench.wired.rates
    assert bench.bus.ping(ServoAddress(2, bench.model.protocol)) == bench.model.number
    with pytest.raises(NoReply):
        bench.bus.ping(ServoAddress(9, bench.model.protocol))


def test_unsupported_adapter_rate_is_detected_before_any_write(bench: Bench) -> None:
    bench.wired.beyond = {500_000}
    changes = bench.plan(baud=3, return_delay=0)
    with pytest.raises(NotConnected):
        apply_changes(bench.bus, bench.at, bench.model.table, changes)
    assert not bench.writes
    assert bench.bus.baud == 1_000_000


def test_locked_servo_gives_a_hint(bench: Bench) -> None:
    bench.servo.set("lock", 1)
    with pytest.raises(BadRequest, match="locked") as caught:
        bench.set(return_delay=0)
    assert "off and on" in caught.value.hint
    assert not bench.writes
    bench.set(led=1)


def test_unchanged_setting_after_a_write_is_a_fault(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    changes = bench.plan(return_delay=0, temperature_limit=60)
    monkeypatch.setattr(bench.bus, "write", lambda *_: None)
    with pytest.raises(DeviceFault, match="servo 1: return_delay holds 250 after 0"):
        apply_changes(bench.bus, bench.at, bench.model.table, changes)


def test_servo_whose_torque_stays_on_is_not_written(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    bench.servo.set("torque_enable", 1)
    changes = bench.plan(return_delay=0)
    monkeypatch.setattr(bench.bus, "write", lambda *_: None)
    with pytest.raises(DeviceFault, match="torque could not be switched off"):
        apply_changes(bench.bus, bench.at, bench.model.table, changes)
    assert bench.servo.get("return_delay") == 250


def test_unacknowledged_writes_are_verified(bench: Bench) -> None:
    bench.servo.set("status_return_level", 1)
    bench.set(return_delay=0, temperature_limit=60)
    assert (bench.servo.get("return_delay"), bench.servo.get("temperature_limit")) == (0, 60)


def test_servo_lost_before_the_write_is_reported(bench: Bench) -> None:
    changes = bench.plan(return_delay=0)
    bench.servo.present = False
    with pytest.raises(NoReply, match="servo 1"):
        apply_changes(bench.bus, bench.at, bench.model.table, changes)


def test_plan_after_a_failure_lists_the_remaining_changes(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    wanted = {"return_delay": 0, "lowest_voltage": 90}
    changes = bench.plan(**wanted)
    write = bench.bus.write
    with monkeypatch.context() as patch:
        patch.setattr(bench.bus, "write", lambda at, row, value: row.name == "return_delay" and write(at, row, value))
        with pytest.raises(DeviceFault, match="lowest_voltage"):
            apply_changes(bench.bus, bench.at, bench.model.table, changes)
    assert named(bench.plan(**wanted)) == [("lowest_voltage", 60, 90)]
