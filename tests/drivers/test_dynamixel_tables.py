"""The control tables: what every table must fulfil, the facts of the manuals, and how values are coded."""

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.errors import BadRequest
from drivers.servos import tables, tables_small, tables_sts
from drivers.servos.models import MODELS, ServoModel
from drivers.servos.register import Coding, ControlTable, Register, RegisterBlock
from tests.cases import each

TABLES = {
    name: table
    for name, table in (vars(tables) | vars(tables_small) | vars(tables_sts)).items()
    if isinstance(table, ControlTable)
}
EVERY = tuple(TABLES.values())
WRITABLE = [register for table in EVERY for register in table.registers.values() if register.writable]


def blocks(table: ControlTable) -> list[RegisterBlock]:
    return [table.fast_block, *table.slow_blocks, table.setup_block]


def within(register: Register, block: RegisterBlock) -> bool:
    return block.address <= register.address and register.end <= block.address + block.size


@each("table", EVERY)
def test_registers_ascend_and_do_not_overlap(table: ControlTable) -> None:
    rows = list(table.registers.values())
    assert all(before.end <= after.address for before, after in pairwise(rows))
    assert list(table.registers) == [register.name for register in rows]
    assert table.size == rows[-1].end


@each("table", EVERY)
def test_settings_come_before_goals_and_readings(table: ControlTable) -> None:
    first = table["torque_enable"].address
    assert [row.eeprom for row in table.registers.values()] == [row.address < first for row in table.registers.values()]


@each("table", EVERY)
def test_every_part_is_played_by_a_register_of_the_table(table: ControlTable) -> None:
    parts = (table.goal, table.speed, table.velocity, table.effort, table.torque_limit, table.torque_ceiling)
    assert set(parts) | set(table.limit_registers) <= set(table.registers)


@each("table", EVERY)
def test_fast_and_slow_blocks_cover_the_needed_registers(table: ControlTable) -> None:
    wanted = [table["present_position"], table[table.velocity], table[table.effort], table["moving"]]
    assert all(within(register, table.fast_block) for register in wanted)
    rest = [table[name] for name in ("torque_enable", "present_voltage", "present_temperature")]
    assert all(any(within(register, block) for block in (table.fast_block, *table.slow_blocks)) for register in rest)
    joins = [
        table[name]
        for name in ("model_number", "firmware", "return_delay", *table.limit_registers, table.torque_ceiling)
    ]
    assert all(within(register, table.setup_block) for register in joins)


@each("table", EVERY)
def test_no_block_cuts_a_register_in_two(table: ControlTable) -> None:
    for block in blocks(table):
        ends = {block.address, block.address + block.size}
        assert not any(row.address < end < row.end for row in table.registers.values() for end in ends)
        assert block.address + block.size <= table.size


@each("table", EVERY)
def test_goal_and_speed_registers_are_adjacent(table: ControlTable) -> None:
    goal, speed = sorted((table[table.goal], table[table.speed]), key=lambda register: register.address)
    between = [row for row in table.registers.values() if goal.end <= row.address < speed.address]
    assert goal.end + sum(row.size for row in between) == speed.address
    assert [row.name for row in between] in ([], ["goal_time"])  # which is sent as 0


@each("register", WRITABLE)
def test_the_default_and_both_bounds_fit_their_register(register: Register) -> None:
    assert register.lower <= register.default <= register.upper
    for value in (register.lower, register.default, register.upper):
        data = register.encode(value)
        assert len(data) == register.size
        assert register.decode(data, register.address) == value


@each("model", MODELS.values())
def test_model_defaults_are_within_register_bounds(model: ServoModel) -> None:
    for name, value in model.defaults.items():
        register = model.table[name]
        assert not register.writable or register.lower <= value <= register.upper, name


@each(
    ("table", "name", "address", "size"),
    [
        ("TABLE_AX", "goal_position", 30, 2),
        ("TABLE_AX", "punch", 48, 2),
        ("TABLE_EX", "drive_mode", 10, 1),
        ("TABLE_EX", "present_current", 56, 2),
        ("TABLE_MX", "multi_turn_offset", 20, 2),
        ("TABLE_MX", "position_p_gain", 28, 1),
        ("TABLE_MX", "realtime_tick", 50, 2),
        ("TABLE_MX", "goal_acceleration", 73, 1),
        ("TABLE_MX_CURRENT", "present_current", 68, 2),
        ("TABLE_MX_CURRENT", "torque_mode", 70, 1),
        ("TABLE_MX_CURRENT", "goal_torque", 71, 2),
        ("TABLE_MX_PAIR", "drive_mode", 10, 1),
        ("TABLE_X", "firmware", 6, 1),
        ("TABLE_X", "homing_offset", 20, 4),
        ("TABLE_X", "pwm_limit", 36, 2),
        ("TABLE_X", "max_position", 48, 4),
        ("TABLE_X", "hardware_error", 70, 1),
        ("TABLE_X", "profile_velocity", 112, 4),
        ("TABLE_X", "goal_position", 116, 4),
        ("TABLE_X", "present_load", 126, 2),
        ("TABLE_X", "present_position", 132, 4),
        ("TABLE_X", "present_temperature", 146, 1),
        ("TABLE_X_CURRENT", "current_limit", 38, 2),
        ("TABLE_X_CURRENT", "goal_current", 102, 2),
        ("TABLE_X_CURRENT", "present_current", 126, 2),
        ("TABLE_MX2", "acceleration_limit", 40, 4),
        ("TABLE_XL330", "pwm_slope", 62, 1),
        ("TABLE_XL330", "present_current", 126, 2),
        ("TABLE_XC330_T", "current_limit", 38, 2),
        ("TABLE_XL320", "id", 3, 1),
        ("TABLE_XL320", "goal_position", 30, 2),
        ("TABLE_XL320", "torque_limit", 35, 2),
        ("TABLE_XL320", "present_position", 37, 2),
        ("TABLE_SCS", "id", 5, 1),
        ("TABLE_SCS", "lock", 48, 1),
        ("TABLE_SCS", "present_position", 56, 2),
        ("TABLE_STS", "model_number", 3, 2),
        ("TABLE_STS", "min_position", 9, 2),
        ("TABLE_STS", "position_offset", 31, 2),
        ("TABLE_STS", "goal_position", 42, 2),
        ("TABLE_STS", "goal_speed", 46, 2),
        ("TABLE_STS", "lock", 55, 1),
        ("TABLE_STS", "present_position", 56, 2),
        ("TABLE_STS", "present_load", 60, 2),
        ("TABLE_STS", "status", 65, 1),
        ("TABLE_STS", "present_current", 69, 2),
    ],
)
def test_register_addresses_match_the_manual(table: str, name: str, address: int, size: int) -> None:
    register = TABLES[table][name]
    assert (register.address, register.size) == (address, size)


def test_tables_omit_registers_that_their_servos_lack() -> None:
    assert "cw_compliance_slope" not in tables.TABLE_MX
    assert "ccw_compliance_slope" not in tables.TABLE_MX
    assert "drive_mode" not in tables.TABLE_MX_CURRENT
    assert "present_load" not in tables.TABLE_X_CURRENT
    assert "current_limit" not in tables.TABLE_MX2
    assert "acceleration_limit" not in tables.TABLE_X_CURRENT


def test_ax_table_has_its_own_limits() -> None:
    assert tables.TABLE_AX["goal_position"] is tables.GOAL_POSITION
    assert tables.GOAL_POSITION.upper == 1023
    assert tables.TABLE_EX["goal_position"].upper == tables.TABLE_EX["ccw_angle_limit"].default == 4095


@given(st.integers(-1023, 1023))
def test_a_sign_bit_is_bit_ten(value: int) -> None:
    data = tables.PRESENT_SPEED.encode(value)
    assert int.from_bytes(data, "little") == abs(value) + (1024 if value < 0 else 0)
    assert tables.PRESENT_SPEED.decode(data, tables.PRESENT_SPEED.address) == value


def test_the_clockwise_bit_alone_is_standstill() -> None:
    assert tables.MOVING_SPEED.decode(b"\x00\x04", 32) == 0


def test_values_beyond_ten_bits_decode_out_of_bounds() -> None:
    assert tables.MOVING_SPEED.decode(b"\x00\x08", 32) > tables.MOVING_SPEED.upper
    assert tables.MOVING_SPEED.decode(b"\xff\xff", 32) < tables.MOVING_SPEED.lower


@given(st.integers(-32_767, 32_767), st.sampled_from(["goal_position", "present_position", "present_speed"]))
def test_the_sign_of_an_sts_is_bit_fifteen(value: int, name: str) -> None:
    register = tables_sts.TABLE_STS[name]
    data = register.encode(value)
    assert int.from_bytes(data, "little") == abs(value) + (0x8000 if value < 0 else 0)
    assert register.decode(data, register.address) == value


@given(st.integers(-2047, 2047))
def test_sts_sign_bits_are_bit_11_for_offset_and_bit_10_for_load(value: int) -> None:
    offset, load = (tables_sts.TABLE_STS[name] for name in ("position_offset", "present_load"))
    assert int.from_bytes(offset.encode(value), "little") == abs(value) + (2048 if value < 0 else 0)
    assert offset.decode(offset.encode(value), offset.address) == value
    share = int(value / 2)
    assert load.decode(load.encode(share), load.address) == share
    assert load.encode(-1000) == bytes.fromhex("E8 07")


@given(st.integers(-(2**31), 2**31 - 1))
def test_positions_of_protocol_2_are_in_twos_complement(value: int) -> None:
    register = tables.TABLE_X["present_position"]
    assert register.coding is Coding.TWOS_COMPLEMENT
    assert register.encode(value) == value.to_bytes(4, "little", signed=True)
    assert register.decode(bytes(10) + register.encode(value), register.address - 10) == value


@each(
    ("register", "value"),
    [
        (tables.GOAL_POSITION, -1),
        (tables.GOAL_POSITION, 0x1_0000),
        (tables.MOVING_SPEED, -1024),
        (tables.TABLE_X["bus_watchdog"], 128),
        (tables_sts.TABLE_STS["position_offset"], -2048),
        (tables_sts.TABLE_STS["goal_position"], -32_768),
    ],
)
def test_value_that_does_not_fit_raises_overflow_error(register: Register, value: int) -> None:
    with pytest.raises(OverflowError):
        register.encode(value)


def test_fired_bus_watchdog_reads_minus_one() -> None:
    assert tables.TABLE_X["bus_watchdog"].decode(b"\xff", 98) == -1


@each(
    ("asked", "meant"),
    [("Return Delay", "return_delay"), ("goal-position", "goal_position"), ("temprature_limit", "temperature_limit")],
)
def test_misspelt_register_gives_a_suggestion(asked: str, meant: str) -> None:
    with pytest.raises(BadRequest, match=asked) as caught:
        tables.TABLE_AX.find_register(asked)
    assert meant in caught.value.hint


def test_unknown_register_lists_all_registers() -> None:
    with pytest.raises(BadRequest) as caught:
        tables.TABLE_AX.find_register("zzz")
    assert all(name in caught.value.hint for name in tables.TABLE_AX.registers)


def test_register_is_found_by_name() -> None:
    assert tables.TABLE_X.find_register("goal_pwm").address == 100
    assert "goal_pwm" in tables.TABLE_X
    assert "goal_pwm" not in tables.TABLE_AX


@each("model", MODELS.values())
def test_the_goal_is_among_the_slow_registers_for_the_watch_to_compare(model: ServoModel) -> None:
    goal = model.table[model.table.goal]
    assert any(
        block.address <= goal.address and goal.end <= block.address + block.size for block in model.table.slow_blocks
    )
