"""The ``base`` section of a robot file: a Kobuki, its port, its limits, and what it does by itself."""

from dataclasses import dataclass, field
from typing import Literal

from config.away import AwayConfig, read_away
from config.fields import Fields

BUTTONS = 3
"""The buttons of the base are numbered from 0 to one less."""


@dataclass(frozen=True, slots=True)
class ReflexConfig:
    """What the base does by itself, whoever commands; the same as ``drivers.api.Reflexes``, which says more.

    ``back_off_way`` in metres, ``back_off_speed`` in m/s, the battery in percent.
    """

    cliff: Literal["stop", "latch"] = "stop"
    wheel_drop: Literal["stop", "latch"] = "stop"
    bumper: Literal["stop", "back_off", "latch"] = "back_off"
    back_off_way: float = 0.05
    back_off_speed: float = 0.1
    battery_low: float = 25.0
    battery_critical: float = 10.0
    stop_button: int | None = None
    enable_button: int | None = None


@dataclass(frozen=True, slots=True)
class BaseConfig:
    """A Kobuki base: its port, its limits (m/s, rad/s, m/s^2, rad/s^2), its reflexes, and what long absences do."""

    port: str
    baud: int
    max_speed: float
    max_turn: float
    acceleration: float
    turn_acceleration: float
    reflexes: ReflexConfig = ReflexConfig()
    away: AwayConfig = field(default_factory=AwayConfig)


def read_base(fields: Fields | None) -> BaseConfig | None:
    """Read the section."""
    if fields is None:
        return None
    fields.choice("driver", ["kobuki"])
    base = BaseConfig(
        port=fields.text("port"),
        baud=fields.integer("baud", 115_200, low=1),
        max_speed=fields.quantity("max_speed", "speed", 0.5, low=0.01, high=0.7),
        max_turn=fields.quantity("max_turn", "turn rate", 1.9, low=0.01, high=3.2),
        acceleration=fields.quantity("acceleration", "acceleration", 0.5, low=0.01),
        turn_acceleration=fields.quantity("turn_acceleration", "turn acceleration", 3.5, low=0.01),
        reflexes=_reflexes(fields.section("reflexes")),
        away=read_away(fields.section("away")),
    )
    fields.done()
    return base


def _reflexes(fields: Fields | None) -> ReflexConfig:
    usual = ReflexConfig()
    if fields is None:
        return usual
    mistakes = len(fields.faults)
    reflexes = ReflexConfig(
        cliff=fields.choice("cliff", ["stop", "latch"], usual.cliff),
        wheel_drop=fields.choice("wheel_drop", ["stop", "latch"], usual.wheel_drop),
        bumper=fields.choice("bumper", ["back_off", "stop", "latch"], usual.bumper),
        back_off_way=fields.quantity("back_off", "length", usual.back_off_way, low=0.01, high=0.5),
        back_off_speed=fields.quantity("back_off_speed", "speed", usual.back_off_speed, low=0.05, high=0.3),
        battery_low=_percent(fields, "battery_low", usual.battery_low),
        battery_critical=_percent(fields, "battery_critical", usual.battery_critical),
        stop_button=_button(fields, "stop_button"),
        enable_button=_button(fields, "enable_button"),
    )
    if len(fields.faults) == mistakes:
        _check_together(fields, reflexes)
    fields.done()
    return reflexes


def _check_together(fields: Fields, reflexes: ReflexConfig) -> None:
    """Note what is right by itself, but not together."""
    critical = fields.node_of("battery_critical") or fields.node_of("battery_low")
    if critical is not None and 0 < reflexes.battery_low < reflexes.battery_critical:
        low, least = f"{reflexes.battery_low:g} %", f"{reflexes.battery_critical:g} %"
        fields.fault(critical.mark, f"'battery_critical' ({least}) is above 'battery_low' ({low})")
    enable = fields.node_of("enable_button")
    if enable is not None and reflexes.enable_button == reflexes.stop_button is not None:
        fields.fault(enable.mark, f"button {reflexes.enable_button} cannot both stop and enable the base")


def _percent(fields: Fields, key: str, usual: float) -> float:
    """Read a share, such as ``25 %``, as percent."""
    return round(100.0 * fields.quantity(key, "share", usual / 100.0, low=0.0, high=1.0), 6)


def _button(fields: Fields, key: str) -> int | None:
    """Read the number of a button; None where there is none."""
    return None if fields.node_of(key) is None else fields.integer(key, low=0, high=BUTTONS - 1)
