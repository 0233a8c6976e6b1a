"""Control tables of the Dynamixel families as data, one row per register. Source: ROBOTIS e-Manual.

Equal registers have the same name in all tables. The constants are the rows of AX and RX, which the other tables of
protocol 1.0 reuse. The indirect addresses of protocol 2.0 are omitted.
"""

from collections.abc import Iterable
from dataclasses import replace
from types import MappingProxyType

from drivers.servos.register import Coding, ControlTable, Register, RegisterBlock


def eeprom(name: str, address: int, size: int, default: int, lower: int, upper: int, unit: str = "") -> Register:
    """Return the register of a setting, which survives a power cut."""
    return Register(name, address, size, default, lower, upper, eeprom=True, unit=unit)


def read_only(name: str, address: int, size: int, default: int = 0) -> Register:
    """Return the register of a constant of the servo."""
    return Register(name, address, size, default, 0, 0, writable=False, eeprom=True)


def ram(name: str, address: int, size: int, default: int, lower: int, upper: int, unit: str = "") -> Register:
    """Return a writable register that is lost with the power."""
    return Register(name, address, size, default, lower, upper, unit=unit)


def present(name: str, address: int, size: int, unit: str = "", coding: Coding = Coding.UNSIGNED) -> Register:
    """Return the register of a reading."""
    return Register(name, address, size, 0, 0, 0, writable=False, coding=coding, unit=unit)


def as_signed(register: Register, coding: Coding = Coding.TWOS_COMPLEMENT) -> Register:
    """Return the register with signed values."""
    return replace(register, coding=coding)


def rows(*registers: Iterable[Register] | Register) -> MappingProxyType[str, Register]:
    """Return the registers by name, in the order of their addresses.

    Of two registers at one address, the later argument counts.
    """
    rows: dict[int, Register] = {}
    for entry in registers:
        rows.update({row.address: row for row in ((entry,) if isinstance(entry, Register) else entry)})
    return MappingProxyType({row.name: row for _, row in sorted(rows.items())})


# Protocol 1.0: AX and RX -----------------------------------------------------------------------------------------

MODEL_NUMBER = read_only("model_number", 0, 2)
FIRMWARE = read_only("firmware", 2, 1, 24)
ID = eeprom("id", 3, 1, 1, 0, 253)
BAUD = eeprom("baud", 4, 1, 1, 0, 249)  # a code: see units.baud_of
RETURN_DELAY = eeprom("return_delay", 5, 1, 250, 0, 254, "2 µs")
CW_ANGLE_LIMIT = eeprom("cw_angle_limit", 6, 2, 0, 0, 1023, "ticks")  # both limits 0: wheel mode
CCW_ANGLE_LIMIT = eeprom("ccw_angle_limit", 8, 2, 1023, 0, 1023, "ticks")
TEMPERATURE_LIMIT = eeprom("temperature_limit", 11, 1, 80, 0, 150, "degC")
LOWEST_VOLTAGE = eeprom("lowest_voltage", 12, 1, 60, 50, 250, "0.1 V")
HIGHEST_VOLTAGE = eeprom("highest_voltage", 13, 1, 140, 50, 250, "0.1 V")
MAX_TORQUE = eeprom("max_torque", 14, 2, 1023, 0, 1023, "1/1023")  # copied to TORQUE_LIMIT at power-on
STATUS_RETURN_LEVEL = eeprom("status_return_level", 16, 1, 2, 0, 2)  # 0 ping, 1 and read, 2 and everything else
ALARM_LED = eeprom("alarm_led", 17, 1, 36, 0, 127)  # masks of error bits
SHUTDOWN = eeprom("shutdown", 18, 1, 36, 0, 127)
TORQUE_ENABLE = ram("torque_enable", 24, 1, 0, 0, 1)
LED = ram("led", 25, 1, 0, 0, 1)
CW_MARGIN = ram("cw_compliance_margin", 26, 1, 1, 0, 255, "ticks")
CCW_MARGIN = ram("ccw_compliance_margin", 27, 1, 1, 0, 255, "ticks")
CW_SLOPE = ram("cw_compliance_slope", 28, 1, 32, 0, 254)
CCW_SLOPE = ram("ccw_compliance_slope", 29, 1, 32, 0, 254)
GOAL_POSITION = ram("goal_position", 30, 2, 0, 0, 1023, "ticks")  # writing it switches the torque on
MOVING_SPEED = as_signed(ram("moving_speed", 32, 2, 0, -1023, 1023, "0.111 rpm"), Coding.SIGN_10)  # 0: no limit
TORQUE_LIMIT = ram("torque_limit", 34, 2, 1023, 0, 1023, "1/1023")  # 0 after a shutdown
PRESENT_POSITION = present("present_position", 36, 2, "ticks")
PRESENT_SPEED = present("present_speed", 38, 2, "0.111 rpm", Coding.SIGN_10)
PRESENT_LOAD = present("present_load", 40, 2, "1/1023", Coding.SIGN_10)
PRESENT_VOLTAGE = present("present_voltage", 42, 1, "0.1 V")
PRESENT_TEMPERATURE = present("present_temperature", 43, 1, "degC")
REGISTERED = present("registered", 44, 1)
MOVING = present("moving", 46, 1)
LOCK = ram("lock", 47, 1, 0, 0, 1)  # 1 locks the EEPROM until the power is cut
PUNCH = ram("punch", 48, 2, 32, 0, 1023)

TABLE_AX = ControlTable(
    registers=rows(
        (MODEL_NUMBER, FIRMWARE, ID, BAUD, RETURN_DELAY, CW_ANGLE_LIMIT, CCW_ANGLE_LIMIT, TEMPERATURE_LIMIT),
        (LOWEST_VOLTAGE, HIGHEST_VOLTAGE, MAX_TORQUE, STATUS_RETURN_LEVEL, ALARM_LED, SHUTDOWN),
        (TORQUE_ENABLE, LED, CW_MARGIN, CCW_MARGIN, CW_SLOPE, CCW_SLOPE, GOAL_POSITION, MOVING_SPEED, TORQUE_LIMIT),
        (PRESENT_POSITION, PRESENT_SPEED, PRESENT_LOAD, PRESENT_VOLTAGE, PRESENT_TEMPERATURE),
        (REGISTERED, MOVING, LOCK, PUNCH),
    ),
    fast_block=RegisterBlock(36, 11),
    slow_blocks=(RegisterBlock(24, 12),),
    setup_block=RegisterBlock(0, 24),
    goal=GOAL_POSITION.name,
    speed=MOVING_SPEED.name,
    velocity=PRESENT_SPEED.name,
    effort=PRESENT_LOAD.name,
    torque_limit=TORQUE_LIMIT.name,
    torque_ceiling=MAX_TORQUE.name,
    limit_registers=(CW_ANGLE_LIMIT.name, CCW_ANGLE_LIMIT.name),
)
"""Control table of AX and RX servos."""

# Protocol 1.0: EX and MX -----------------------------------------------------------------------------------------

_POSITIONS_4096 = (  # 4096 ticks
    replace(CW_ANGLE_LIMIT, upper=4095),
    replace(CCW_ANGLE_LIMIT, default=4095, upper=4095),
    replace(GOAL_POSITION, upper=4095),
)
_DRIVE_MODE = eeprom("drive_mode", 10, 1, 0, 0, 3)  # bit 0 reverse, bit 1 slave of a pair

TABLE_EX = replace(
    TABLE_AX,
    registers=rows(
        TABLE_AX.registers.values(),
        _POSITIONS_4096,
        _DRIVE_MODE,
        replace(PUNCH, default=0),
        present("present_current", 56, 2, "10 mA, 512 is none"),
    ),
    slow_blocks=(*TABLE_AX.slow_blocks, RegisterBlock(56, 2)),
)
"""Control table of the EX-106+."""

TABLE_MX = replace(
    TABLE_AX,
    registers=rows(
        (row for row in TABLE_AX.registers.values() if row is not CCW_SLOPE),
        _POSITIONS_4096,
        replace(FIRMWARE, default=41),
        replace(BAUD, default=34, upper=254),
        as_signed(eeprom("multi_turn_offset", 20, 2, 0, -24_576, 24_576, "ticks")),
        eeprom("resolution_divider", 22, 1, 1, 1, 4),
        ram("position_d_gain", 26, 1, 0, 0, 254, "4/1000"),
        ram("position_i_gain", 27, 1, 0, 0, 254, "1000/2048"),
        ram("position_p_gain", 28, 1, 32, 0, 254, "1/8"),
        # Beyond one turn in multi-turn mode, where both angle limits are 4095.
        as_signed(ram("goal_position", 30, 2, 0, -28_672, 28_672, "ticks")),
        replace(MOVING_SPEED, unit="0.114 rpm"),
        as_signed(PRESENT_POSITION),
        replace(PRESENT_SPEED, unit="0.114 rpm"),
        replace(PUNCH, default=0),
        present("realtime_tick", 50, 2, "ms"),
        ram("goal_acceleration", 73, 1, 0, 0, 254, "8.583 deg/s²"),
    ),
)
"""Control table of the MX-28 as delivered."""

TABLE_MX_CURRENT = replace(
    TABLE_MX,
    registers=rows(
        TABLE_MX.registers.values(),
        present("present_current", 68, 2, "4.5 mA, 2048 is none"),
        ram("torque_mode", 70, 1, 0, 0, 1),
        as_signed(ram("goal_torque", 71, 2, 0, -1023, 1023, "4.5 mA"), Coding.SIGN_10),
    ),
    slow_blocks=(*TABLE_MX.slow_blocks, RegisterBlock(68, 5)),
)
"""Control table of the MX-64 as delivered: it measures its current."""

TABLE_MX_PAIR = replace(TABLE_MX_CURRENT, registers=rows(TABLE_MX_CURRENT.registers.values(), _DRIVE_MODE))
"""Control table of the MX-106 as delivered, with a drive mode in which two of them move one joint together."""

# Protocol 2.0 ----------------------------------------------------------------------------------------------------

GAIN = (0, 16_383)
_TURNS = (-1_048_575, 1_048_575)  # 256 turns either way in extended position mode

TABLE_X = ControlTable(
    registers=rows(
        read_only("model_number", 0, 2),
        read_only("model_information", 2, 4),
        read_only("firmware", 6, 1, 45),
        eeprom("id", 7, 1, 1, 0, 252),
        eeprom("baud", 8, 1, 1, 0, 7),  # a code: see units.baud_of
        eeprom("return_delay", 9, 1, 250, 0, 254, "2 µs"),
        eeprom("drive_mode", 10, 1, 0, 0, 13),  # bit 0 reverse, 2 profile in time, 3 a goal switches torque on
        eeprom("operating_mode", 11, 1, 3, 0, 16),  # 0 current, 1 velocity, 3 position, 4 extended, 5 both, 16 PWM
        eeprom("shadow_id", 12, 1, 255, 0, 255),  # above 252: none
        eeprom("protocol", 13, 1, 2, 1, 2),
        as_signed(eeprom("homing_offset", 20, 4, 0, -1_044_479, 1_044_479, "ticks")),
        eeprom("moving_threshold", 24, 4, 10, 0, 1023, "0.229 rpm"),
        eeprom("temperature_limit", 31, 1, 80, 0, 100, "degC"),
        eeprom("highest_voltage", 32, 2, 160, 60, 160, "0.1 V"),
        eeprom("lowest_voltage", 34, 2, 95, 60, 160, "0.1 V"),
        eeprom("pwm_limit", 36, 2, 885, 0, 885, "0.113 %"),
        eeprom("velocity_limit", 44, 4, 200, 0, 1023, "0.229 rpm"),
        eeprom("max_position", 48, 4, 4095, 0, 4095, "ticks"),
        eeprom("min_position", 52, 4, 0, 0, 4095, "ticks"),
        eeprom("startup_configuration", 60, 1, 0, 0, 3),  # bit 0 torque on at start, bit 1 RAM is restored
        eeprom("shutdown", 63, 1, 52, 0, 63),  # mask of hardware error bits
        ram("torque_enable", 64, 1, 0, 0, 1),
        ram("led", 65, 1, 0, 0, 1),
        ram("status_return_level", 68, 1, 2, 0, 2),
        present("registered", 69, 1),
        present("hardware_error", 70, 1),
        ram("velocity_i_gain", 76, 2, 1920, *GAIN, "1/65536"),
        ram("velocity_p_gain", 78, 2, 100, *GAIN, "1/128"),
        ram("position_d_gain", 80, 2, 0, *GAIN, "1/16"),
        ram("position_i_gain", 82, 2, 0, *GAIN, "1/65536"),
        ram("position_p_gain", 84, 2, 850, *GAIN, "1/128"),
        ram("feedforward_2nd_gain", 88, 2, 0, *GAIN, "1/4"),
        ram("feedforward_1st_gain", 90, 2, 0, *GAIN, "1/4"),
        as_signed(ram("bus_watchdog", 98, 1, 0, 0, 127, "20 ms")),  # reads -1 once it has fired
        as_signed(ram("goal_pwm", 100, 2, 885, -885, 885, "0.113 %")),
        as_signed(ram("goal_velocity", 104, 4, 0, -1023, 1023, "0.229 rpm")),
        ram("profile_acceleration", 108, 4, 0, 0, 32_767, "214.577 rev/min²"),
        ram("profile_velocity", 112, 4, 0, 0, 32_767, "0.229 rpm"),  # 0: full speed
        as_signed(ram("goal_position", 116, 4, 0, *_TURNS, "ticks")),
        present("realtime_tick", 120, 2, "ms"),
        present("moving", 122, 1),
        present("moving_status", 123, 1),
        present("present_pwm", 124, 2, "0.113 %", Coding.TWOS_COMPLEMENT),
        present("present_load", 126, 2, "0.1 %", Coding.TWOS_COMPLEMENT),
        present("present_velocity", 128, 4, "0.229 rpm", Coding.TWOS_COMPLEMENT),
        present("present_position", 132, 4, "ticks", Coding.TWOS_COMPLEMENT),
        present("velocity_trajectory", 136, 4, "0.229 rpm", Coding.TWOS_COMPLEMENT),
        present("position_trajectory", 140, 4, "ticks", Coding.TWOS_COMPLEMENT),
        present("present_voltage", 144, 2, "0.1 V"),
        present("present_temperature", 146, 1, "degC"),
        present("backup_ready", 147, 1),
    ),
    fast_block=RegisterBlock(122, 14),
    slow_blocks=(RegisterBlock(64, 7), RegisterBlock(98, 22), RegisterBlock(144, 3)),
    setup_block=RegisterBlock(0, 64),
    goal="goal_position",
    speed="profile_velocity",
    velocity="present_velocity",
    effort="present_load",
    torque_limit="goal_pwm",
    torque_ceiling="pwm_limit",
    limit_registers=("min_position", "max_position"),
)
"""Control table of the XL430, which estimates its load instead of measuring its current."""


def with_current(table: ControlTable, unit: str, limit: int) -> ControlTable:
    """Return ``table`` with the registers of a current sensor; ``limit`` is its maximum in steps of ``unit``."""
    return replace(
        table,
        registers=rows(
            table.registers.values(),
            eeprom("current_limit", 38, 2, limit, 0, limit, unit),
            as_signed(ram("goal_current", 102, 2, limit, -limit, limit, unit)),
            present("present_current", 126, 2, unit, Coding.TWOS_COMPLEMENT),
        ),
        effort="present_current",
    )


_ACCELERATION_LIMIT = eeprom("acceleration_limit", 40, 4, 32_767, 0, 32_767, "214.577 rev/min²")

TABLE_X_CURRENT = with_current(TABLE_X, "2.69 mA", 1193)
"""Control table of the XM430."""

TABLE_X540 = with_current(TABLE_X, "2.69 mA", 2047)
"""Control table of the XM540 and similar models."""

TABLE_MX2 = replace(TABLE_X, registers=rows(TABLE_X.registers.values(), _ACCELERATION_LIMIT))
"""Control table of the MX-28 with the firmware of protocol 2.0."""

TABLE_MX2_64 = with_current(TABLE_MX2, "3.36 mA", 1941)
"""Control table of the MX-64 with the firmware of protocol 2.0."""

TABLE_MX2_106 = with_current(TABLE_MX2, "3.36 mA", 2047)
"""Control table of the MX-106 with the firmware of protocol 2.0."""
