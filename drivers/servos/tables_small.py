"""Control tables of the small X servos, XL330 and XC330, and of the XL-320, as data. Source: ROBOTIS e-Manual."""

from dataclasses import replace

from drivers.servos.register import Coding, ControlTable, RegisterBlock
from drivers.servos.tables import (
    BAUD,
    CCW_ANGLE_LIMIT,
    CW_ANGLE_LIMIT,
    FIRMWARE,
    GAIN,
    GOAL_POSITION,
    ID,
    MAX_TORQUE,
    MODEL_NUMBER,
    MOVING_SPEED,
    PRESENT_LOAD,
    PRESENT_SPEED,
    RETURN_DELAY,
    TABLE_X,
    TORQUE_ENABLE,
    TORQUE_LIMIT,
    as_signed,
    eeprom,
    present,
    ram,
    rows,
    with_current,
)

_SMALL = with_current(TABLE_X, "1 mA", 1750)

TABLE_XL330 = replace(
    _SMALL,
    registers=rows(
        _SMALL.registers.values(),
        eeprom("temperature_limit", 31, 1, 70, 0, 100, "degC"),
        eeprom("highest_voltage", 32, 2, 70, 31, 70, "0.1 V"),
        eeprom("lowest_voltage", 34, 2, 35, 31, 70, "0.1 V"),
        eeprom("velocity_limit", 44, 4, 445, 0, 2047, "0.229 rpm"),
        eeprom("pwm_slope", 62, 1, 140, 1, 255, "1.977 mV/ms"),
        eeprom("shutdown", 63, 1, 53, 0, 63),
        ram("velocity_i_gain", 76, 2, 1600, *GAIN, "1/65536"),
        ram("velocity_p_gain", 78, 2, 180, *GAIN, "1/128"),
        ram("position_p_gain", 84, 2, 400, *GAIN, "1/128"),
        as_signed(ram("goal_velocity", 104, 4, 0, -2047, 2047, "0.229 rpm")),
    ),
)
"""Control table of the XL330, which runs at 5 V."""

_SMALL_COPPER = replace(
    TABLE_XL330,
    registers=rows(
        TABLE_XL330.registers.values(),
        eeprom("current_limit", 38, 2, 2352, 0, 2352, "1 mA"),
        eeprom("shutdown", 63, 1, 52, 0, 63),
        as_signed(ram("goal_current", 102, 2, 2352, -2352, 2352, "1 mA")),
    ),
)

TABLE_XC330_M = _SMALL_COPPER
"""Control table of the XC330-M servos, which run at 5 V."""

TABLE_XC330_T = replace(
    _SMALL_COPPER,
    registers=rows(
        _SMALL_COPPER.registers.values(),
        eeprom("highest_voltage", 32, 2, 140, 55, 140, "0.1 V"),
        eeprom("lowest_voltage", 34, 2, 55, 55, 140, "0.1 V"),
        eeprom("current_limit", 38, 2, 910, 0, 910, "1 mA"),
        eeprom("pwm_slope", 62, 1, 255, 1, 255, "3.955 mV/ms"),
        as_signed(ram("goal_current", 102, 2, 910, -910, 910, "1 mA")),
    ),
)
"""Control table of the XC330-T servos, which run at 12 V."""

# Protocol 2.0, another table -------------------------------------------------------------------------------------

TABLE_XL320 = ControlTable(
    registers=rows(
        (MODEL_NUMBER, FIRMWARE, replace(ID, upper=252), replace(BAUD, default=3, upper=3), RETURN_DELAY),
        (CW_ANGLE_LIMIT, CCW_ANGLE_LIMIT),
        eeprom("control_mode", 11, 1, 2, 1, 2),  # 1 wheel, 2 joint
        eeprom("temperature_limit", 12, 1, 65, 0, 150, "degC"),
        eeprom("lowest_voltage", 13, 1, 60, 50, 250, "0.1 V"),
        eeprom("highest_voltage", 14, 1, 90, 50, 250, "0.1 V"),
        eeprom("max_torque", 15, 2, 1023, 0, 1023, "1/1023"),
        eeprom("status_return_level", 17, 1, 2, 0, 2),
        eeprom("shutdown", 18, 1, 3, 0, 7),  # bit 0 overload, 1 overheating, 2 voltage
        TORQUE_ENABLE,
        ram("led", 25, 1, 0, 0, 7),
        ram("position_d_gain", 27, 1, 0, 0, 254),
        ram("position_i_gain", 28, 1, 0, 0, 254),
        ram("position_p_gain", 29, 1, 32, 0, 254),
        GOAL_POSITION,
        MOVING_SPEED,
        ram("torque_limit", 35, 2, 1023, 0, 1023, "1/1023"),
        present("present_position", 37, 2, "ticks"),
        present("present_speed", 39, 2, "0.111 rpm", Coding.SIGN_10),
        present("present_load", 41, 2, "1/1023", Coding.SIGN_10),
        present("present_voltage", 45, 1, "0.1 V"),
        present("present_temperature", 46, 1, "degC"),
        present("registered", 47, 1),
        present("moving", 49, 1),
        present("error_status", 50, 1),  # bits as in shutdown
        ram("punch", 51, 2, 32, 0, 1023),
    ),
    fast_block=RegisterBlock(37, 13),
    slow_blocks=(RegisterBlock(24, 13),),
    setup_block=RegisterBlock(0, 24),
    goal=GOAL_POSITION.name,
    speed=MOVING_SPEED.name,
    velocity=PRESENT_SPEED.name,
    effort=PRESENT_LOAD.name,
    torque_limit=TORQUE_LIMIT.name,
    torque_ceiling=MAX_TORQUE.name,
    limit_registers=(CW_ANGLE_LIMIT.name, CCW_ANGLE_LIMIT.name),
)
"""Control table of the XL-320: similar to that of an AX, with frames of protocol 2.0."""
