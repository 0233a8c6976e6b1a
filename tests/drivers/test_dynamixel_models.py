"""The models: their numbers, what their steps are worth, and the codes of their baud rates."""

from math import degrees, isclose, radians

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.errors import BadRequest
from drivers.servos.models import MODELS, ServoModel, find_model
from drivers.servos.units import RPM, Protocol, baud_code, baud_of
from tests.cases import each

EVERY = tuple(MODELS.values())
ANY = st.sampled_from(list(MODELS.values()))

NUMBERS = (
    {"AX-12A": 12, "AX-12W": 300, "AX-18A": 18, "RX-24F": 24, "RX-28": 28, "RX-64": 64, "EX-106+": 107}
    | {"MX-28": 29, "MX-64": 310, "MX-106": 320, "MX-28(2.0)": 30, "MX-64(2.0)": 311, "MX-106(2.0)": 321}
    | {"XL430-W250": 1060, "XM430-W210": 1030, "XM430-W350": 1020, "XL330-M077": 1190, "XL330-M288": 1200}
    | {"XC330-T181": 1210, "XC330-T288": 1220, "XC330-M181": 1230, "XC330-M288": 1240, "2XL430-W250": 1090}
    | {"XC430-W150": 1070, "XC430-W240": 1080, "XM540-W150": 1130, "XM540-W270": 1120}
    | {"STS3215": 777, "STS3250": 2825}
)


def test_every_driven_servo_is_known_by_its_number() -> None:
    assert {model.name: model.number for model in MODELS.values()} == NUMBERS
    for name, number in NUMBERS.items():
        assert find_model(number) is MODELS[name]
        assert MODELS[name].default(MODELS[name].table["model_number"]) == number


def test_unknown_model_number_has_no_model() -> None:
    assert find_model(0) is None


@each(
    ("name", "tick", "reach", "speed_unit"),
    [  # degrees, degrees, rad/s
        ("AX-12A", 0.29297, 150, 0.0116239),
        ("RX-64", 0.29297, 150, 0.0116239),
        ("EX-106+", 0.061260, 125.46, 0.0116239),
        ("MX-64", 0.087891, 180, 0.0119381),
        ("MX-64(2.0)", 0.087891, 180, 0.0239808),
        ("XL430-W250", 0.087891, 180, 0.0239808),
        ("XL330-M288", 0.087891, 180, 0.0239808),
        ("STS3215", 0.087891, 180, 0.0015340),
    ],
)
def test_tick_and_speed_units_match_the_manual(name: str, tick: float, reach: float, speed_unit: float) -> None:
    model = MODELS[name]
    assert isclose(degrees(model.tick), tick, rel_tol=1e-4)
    assert isclose(degrees(model.angle(0)), -reach)
    assert isclose(model.speed(1), speed_unit, rel_tol=1e-4)
    assert model.speed(-10) == -model.speed(10)


@each("model", EVERY)
def test_zero_angle_is_the_centre_tick(model: ServoModel) -> None:
    assert model.ticks(0.0) == model.centre_tick
    assert model.angle(model.centre_tick) == 0.0
    assert model.last_tick == 2 * model.centre_tick - 1
    assert model.last_tick == model.default(model.table[model.table.limit_registers[1]])


@given(ANY, st.data())
def test_ticks_survive_the_way_through_radians(model: ServoModel, data: st.DataObject) -> None:
    ticks = data.draw(st.integers(0, model.last_tick))
    assert model.ticks(model.angle(ticks)) == ticks


@given(ANY, st.floats(-100, 100))
def test_no_angle_leads_out_of_the_servos_range(model: ServoModel, angle: float) -> None:
    ticks = model.ticks(angle)
    assert 0 <= ticks <= model.last_tick
    if model.angle(0) <= angle <= model.angle(model.last_tick):
        assert abs(model.angle(ticks) - angle) <= model.tick / 2 + 1e-9


@given(ANY, st.floats(0, 1000))
def test_speed_is_never_encoded_as_zero(model: ServoModel, speed: float) -> None:
    steps = model.speed_ticks(speed)
    assert 1 <= steps <= model.max_speed_ticks
    if 1.5 * model.speed_unit < speed < model.top_speed:
        assert abs(model.speed(steps) - speed) <= model.speed_unit / 2 + 1e-9


@given(ANY, st.floats(0, 1))
def test_no_torque_limit_looks_like_a_shutdown(model: ServoModel, share: float) -> None:
    limit = model.torque_ticks(share)
    assert 1 <= limit <= model.full_torque
    assert abs(limit / model.full_torque - share) <= 1 / model.full_torque


@each("model", EVERY)
def test_full_torque_is_the_torque_ceiling(model: ServoModel) -> None:
    ceiling = model.table[model.table.torque_ceiling]
    assert model.torque_ticks(1.0) == model.full_torque == ceiling.upper
    limit = model.table[model.table.torque_limit]
    assert model.default(limit) == model.default(ceiling)  # a servo that was never touched has what its EEPROM allows


@each(
    ("name", "raw", "share"),
    [
        ("AX-12A", -1023, -1.0),
        ("MX-106", 512, 0.5005),
        ("XL430-W250", 250, 0.25),
        ("MX-28(2.0)", -1000, -1.0),
        ("XM430-W210", 427, 0.4994),  # 427 * 2.69 mA of 2.3 A
        ("MX-106(2.0)", -774, -0.5001),  # 774 * 3.36 mA of 5.2 A
        ("XL330-M077", 735, 0.5),  # 735 * 1 mA of 1.47 A
        ("STS3215", -500, -0.5),
    ],
)
def test_load_and_current_are_shares_of_the_stall_torque(name: str, raw: int, share: float) -> None:
    assert isclose(MODELS[name].load(raw), share, rel_tol=1e-3)


def test_one_write_of_protocol_1_holds_goal_and_speed() -> None:
    assert MODELS["AX-12A"].goal_write(512, 100) == (30, bytes.fromhex("00 02 64 00"))


def test_one_write_of_an_sts_holds_goal_no_time_and_speed() -> None:
    assert MODELS["STS3215"].goal_write(2048, 1000) == (42, bytes.fromhex("00 08 00 00 E8 03"))


def test_one_write_of_protocol_2_holds_speed_and_goal() -> None:
    assert MODELS["XM430-W350"].goal_write(2048, 50) == (112, bytes.fromhex("32 00 00 00 00 08 00 00"))


@each("model", EVERY)
def test_free_speed_is_encodable(model: ServoModel) -> None:
    assert 0 < model.free_speed < 1.2 * model.top_speed
    assert model.stall_torque > 0


def test_protocol_2_speed_is_limited_by_the_velocity_limit() -> None:
    for model in MODELS.values():
        if model.protocol == 2:
            assert model.max_speed_ticks == model.default(model.table["velocity_limit"])
            assert model.read_mode == "sync"


@each("model", EVERY)
def test_an_ax_and_an_sts_are_delivered_at_1_megabaud_and_any_other_at_57600(model: ServoModel) -> None:
    baud = baud_of(model.default(model.table["baud"]), model.protocol)
    assert baud == (1_000_000 if model.name.startswith(("AX", "STS")) else 57_600)


@each(
    ("name", "register", "value"),
    [  # what distinguishes one row from its neighbours
        ("AX-12A", "temperature_limit", 70),
        ("AX-12A", "cw_compliance_slope", 32),
        ("AX-12W", "cw_compliance_slope", 64),
        ("AX-12W", "ccw_compliance_margin", 4),
        ("AX-18A", "temperature_limit", 75),
        ("AX-18A", "max_torque", 983),
        ("RX-28", "highest_voltage", 190),
        ("RX-28", "temperature_limit", 80),
        ("EX-106+", "highest_voltage", 240),
        ("EX-106+", "punch", 0),
        ("MX-28", "highest_voltage", 160),
        ("MX-64", "highest_voltage", 240),
        ("XL430-W250", "temperature_limit", 72),
        ("XL430-W250", "lowest_voltage", 60),
        ("XL430-W250", "position_d_gain", 4000),
        ("XM430-W210", "current_limit", 1193),
        ("XM430-W350", "position_p_gain", 800),
        ("MX-64(2.0)", "current_limit", 1941),
        ("MX-106(2.0)", "current_limit", 2047),
        ("MX-106(2.0)", "position_p_gain", 850),
        ("XL330-M077", "velocity_limit", 1620),
        ("XL330-M077", "velocity_p_gain", 40),
        ("XL330-M288", "velocity_limit", 445),
        ("XL330-M288", "velocity_p_gain", 180),
        ("XL330-M288", "highest_voltage", 70),
        ("XL330-M288", "current_limit", 1750),
        ("XL330-M288", "shutdown", 53),
        ("STS3215", "highest_voltage", 80),
        ("XM540-W270", "current_limit", 2047),
        ("XM540-W270", "velocity_limit", 128),
        ("XC430-W150", "lowest_voltage", 60),
        ("XC330-T288", "highest_voltage", 140),
        ("XC330-T288", "current_limit", 910),
        ("XC330-M288", "highest_voltage", 70),
        ("XC330-M288", "current_limit", 2352),
    ],
)
def test_register_defaults_match_the_manual(name: str, register: str, value: int) -> None:
    model = MODELS[name]
    assert model.default(model.table[register]) == value


@each(
    ("code", "protocol", "baud"),
    [
        *[(1, 1, 1_000_000), (3, 1, 500_000), (4, 1, 400_000), (7, 1, 250_000), (9, 1, 200_000), (16, 1, 115_200)],
        *[(34, 1, 57_600), (103, 1, 19_200), (207, 1, 9600), (0, 1, 2_000_000)],
        *[(250, 1, 2_250_000), (251, 1, 2_500_000), (252, 1, 3_000_000)],
        *[(0, 2, 9600), (1, 2, 57_600), (2, 2, 115_200), (3, 2, 1_000_000), (4, 2, 2_000_000)],
        *[(5, 2, 3_000_000), (6, 2, 4_000_000), (7, 2, 4_500_000)],
        *[(0, "STS", 1_000_000), (1, "STS", 500_000), (2, "STS", 250_000), (3, "STS", 128_000)],
        *[(4, "STS", 115_200), (5, "STS", 76_800), (6, "STS", 57_600), (7, "STS", 38_400)],
    ],
)
def test_codes_stand_for_rates_both_ways(code: int, protocol: Protocol, baud: int) -> None:
    assert baud_of(code, protocol) == baud
    assert baud_code(baud, protocol) == code


def test_the_true_rate_of_a_usual_one_has_the_same_code() -> None:
    assert baud_code(117_647, 1) == 16
    assert baud_code(57_143, 1) == 34


@each(("baud", "protocol"), [(1_500_000, 1), (4_500_000, 1), (1200, 1), (0, 1), (-9600, 2), (250_000, 2), (500_000, 2)])
def test_unsupported_baud_rate_lists_the_supported_ones(baud: int, protocol: Protocol) -> None:
    with pytest.raises(BadRequest, match=str(baud)) as caught:
        baud_code(baud, protocol)
    assert "57600" in caught.value.hint
    assert "1000000" in caught.value.hint


def test_unknown_baud_code_is_refused() -> None:
    with pytest.raises(BadRequest, match="code 8"):
        baud_of(8, 2)


@given(st.integers(0, 254))
def test_every_code_of_protocol_1_leads_back_to_a_rate_within_3_percent(code: int) -> None:
    baud = baud_of(code, 1)
    assert abs(baud_of(baud_code(baud, 1), 1) - baud) <= 0.03 * baud


def test_baud_codes_of_an_mx_are_refused_for_an_ax() -> None:
    assert MODELS["AX-12A"].table["baud"].upper < 250 <= MODELS["MX-28"].table["baud"].upper


def test_a_turn_a_minute_is_six_degrees_a_second() -> None:
    assert isclose(RPM, radians(6))
