"""Control tables of Feetech's STS, SMS and SCS servos as data. Source: the maker's memory tables of the series.

Equal registers have the names of the Dynamixel tables. Signed numbers are a magnitude and a sign bit: bit 10 of the
load, bit 11 of the offset, bit 15 of all others.
"""

from dataclasses import replace

from drivers.servos.register import Coding, ControlTable, RegisterBlock
from drivers.servos.tables import as_signed, eeprom, present, ram, read_only, rows

_SIGN_15 = Coding.SIGN_15

TABLE_STS = ControlTable(
    registers=rows(
        read_only("firmware", 0, 2, 3 | 10 << 8),  # major, then minor
        read_only("big_endian", 2, 1),
        read_only("model_number", 3, 2),
        eeprom("id", 5, 1, 1, 0, 253),
        eeprom("baud", 6, 1, 0, 0, 7),  # a code: see units.baud_of
        eeprom("return_delay", 7, 1, 0, 0, 254, "2 µs"),
        eeprom("response_level", 8, 1, 1, 0, 1),  # 0 ping and read, 1 everything
        eeprom("min_position", 9, 2, 0, 0, 4095, "ticks"),
        eeprom("max_position", 11, 2, 4095, 0, 4095, "ticks"),  # both limits 0: several turns
        eeprom("temperature_limit", 13, 1, 70, 0, 100, "degC"),
        eeprom("highest_voltage", 14, 1, 80, 0, 254, "0.1 V"),
        eeprom("lowest_voltage", 15, 1, 40, 0, 254, "0.1 V"),
        eeprom("max_torque", 16, 2, 1000, 0, 1000, "0.1 %"),  # copied to torque_limit at power-on
        eeprom("phase", 18, 1, 12, 0, 254),  # bits: 2 speeds in single steps, 3 speed 0 is the highest, 4 turns count
        eeprom("shutdown", 19, 1, 44, 0, 254),  # masks of status bits
        eeprom("alarm_led", 20, 1, 47, 0, 254),
        eeprom("position_p_gain", 21, 1, 32, 0, 254),
        eeprom("position_d_gain", 22, 1, 32, 0, 254),
        eeprom("position_i_gain", 23, 1, 0, 0, 254),
        eeprom("punch", 24, 2, 16, 0, 1000, "0.1 %"),
        eeprom("cw_dead_zone", 26, 1, 1, 0, 32, "ticks"),
        eeprom("ccw_dead_zone", 27, 1, 1, 0, 32, "ticks"),
        eeprom("protection_current", 28, 2, 500, 0, 2047, "6.5 mA"),
        eeprom("angular_resolution", 30, 1, 1, 1, 128),
        # Subtracted from the raw position.
        as_signed(eeprom("position_offset", 31, 2, 0, -2047, 2047, "ticks"), Coding.SIGN_11),
        eeprom("mode", 33, 1, 0, 0, 3),  # 0 position, 1 speed, 2 PWM, 3 steps
        eeprom("protective_torque", 34, 1, 20, 0, 254, "%"),
        eeprom("protection_time", 35, 1, 200, 0, 254, "10 ms"),
        eeprom("overload_torque", 36, 1, 80, 0, 254, "%"),
        eeprom("velocity_p_gain", 37, 1, 10, 0, 254),
        eeprom("overcurrent_time", 38, 1, 200, 0, 254, "10 ms"),
        eeprom("velocity_i_gain", 39, 1, 10, 0, 254),
        ram("torque_enable", 40, 1, 0, 0, 1),  # 128 would make its position its middle, permanently: never sent
        ram("goal_acceleration", 41, 1, 0, 0, 254, "8.79 deg/s²"),  # 0: no ramp
        as_signed(ram("goal_position", 42, 2, 0, -32_767, 32_767, "ticks"), _SIGN_15),
        ram("goal_time", 44, 2, 0, 0, 1000),  # 0: the speed counts
        as_signed(ram("goal_speed", 46, 2, 0, -32_767, 32_767, "0.087891 deg/s"), _SIGN_15),  # 0: full speed
        ram("torque_limit", 48, 2, 1000, 0, 1000, "0.1 %"),
        ram("lock", 55, 1, 1, 0, 1),  # 1: EEPROM writes last until the power is cut
        present("present_position", 56, 2, "ticks", _SIGN_15),
        present("present_speed", 58, 2, "0.087891 deg/s", _SIGN_15),
        present("present_load", 60, 2, "0.1 %", Coding.SIGN_10),
        present("present_voltage", 62, 1, "0.1 V"),
        present("present_temperature", 63, 1, "degC"),
        present("registered", 64, 1),
        present("status", 65, 1),
        present("moving", 66, 1),
        present("present_current", 69, 2, "6.5 mA", _SIGN_15),
        ram("moving_threshold", 80, 1, 1, 0, 254),
        ram("fastest_speed", 84, 1, 70, 0, 254, "0.732 rpm"),
        ram("fastest_acceleration", 85, 1, 254, 0, 254),
        ram("acceleration_multiplier", 86, 1, 1, 0, 254),
    ),
    fast_block=RegisterBlock(56, 11),
    slow_blocks=(RegisterBlock(40, 27),),
    setup_block=RegisterBlock(0, 40),
    goal="goal_position",
    speed="goal_speed",
    velocity="present_speed",
    effort="present_load",
    torque_limit="torque_limit",
    torque_ceiling="max_torque",
    limit_registers=("min_position", "max_position"),
)
"""Control table of the STS3215 and similar models."""

# SCS -------------------------------------------------------------------------------------------------------------

_SHARED = ("firmware", "big_endian", "id", "baud", "return_delay", "response_level", "temperature_limit")

TABLE_SCS = ControlTable(
    registers=rows(
        [TABLE_STS[name] for name in _SHARED],
        [
            replace(register, byte_order="big")
            for register in (
                read_only("model_number", 3, 2),
                eeprom("min_position", 9, 2, 0, 0, 1023, "ticks"),
                eeprom("max_position", 11, 2, 1023, 0, 1023, "ticks"),  # both limits 0: a wheel
                eeprom("max_torque", 16, 2, 1000, 0, 1000, "0.1 %"),
                ram("goal_position", 42, 2, 0, 0, 1023, "ticks"),
                ram("goal_time", 44, 2, 0, 0, 9999, "ms"),
                ram("goal_speed", 46, 2, 0, 0, 1000, "ticks/s"),
                present("present_position", 56, 2, "ticks", _SIGN_15),
                present("present_speed", 58, 2, "ticks/s", _SIGN_15),
                present("present_load", 60, 2, "0.1 %", Coding.SIGN_10),
                present("present_current", 69, 2, "6.5 mA", _SIGN_15),
            )
        ],
        eeprom("highest_voltage", 14, 1, 80, 0, 254, "0.1 V"),
        eeprom("lowest_voltage", 15, 1, 40, 0, 254, "0.1 V"),
        eeprom("cw_dead_zone", 26, 1, 2, 0, 32, "ticks"),
        eeprom("ccw_dead_zone", 27, 1, 2, 0, 32, "ticks"),
        ram("torque_enable", 40, 1, 0, 0, 1),
        ram("lock", 48, 1, 1, 0, 1),
        present("present_voltage", 62, 1, "0.1 V"),
        present("present_temperature", 63, 1, "degC"),
        present("moving", 66, 1),
    ),
    fast_block=RegisterBlock(56, 11),
    slow_blocks=(RegisterBlock(40, 9),),
    setup_block=RegisterBlock(0, 28),
    goal="goal_position",
    speed="goal_speed",
    velocity="present_speed",
    effort="present_load",
    torque_limit="max_torque",
    torque_ceiling="max_torque",
    limit_registers=("min_position", "max_position"),
)
"""Control table of the SCS0009 and similar models: big-endian, without an offset and a torque limit in RAM."""
