"""What the base reports beyond what missions ask for: currents, floor, gyro, sockets, gains. For tools and records."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

from drivers.kobuki.feedback import Charger, CliffDistance, Core, Gains, Inputs, MotorCurrent, RawGyro
from drivers.kobuki.wire import Part

_VOLTS = 3.3 / 4095


@dataclass(frozen=True, slots=True)
class Telemetry:
    """The newest figures of each kind.

    ``currents`` (A) and ``pwm`` (-1..1) of the left and the right motor; ``floor``: what the left, centre and right
    sensor measure, 12 bits, not linear; ``rates``: the gyro's newest samples about x, y, z (rad/s); ``digital`` and
    ``analogue`` (volts): the four sockets of each kind; ``charger`` in words; ``gains`` None until they were asked for.
    """

    currents: tuple[float, float] = (0.0, 0.0)
    pwm: tuple[float, float] = (0.0, 0.0)
    floor: tuple[int, int, int] = (0, 0, 0)
    rates: tuple[tuple[float, float, float], ...] = ()
    digital: tuple[bool, ...] = (False,) * 4
    analogue: tuple[float, ...] = (0.0,) * 4
    charger: str = "unplugged"
    gains: Gains | None = None

    def updated(self, parts: Iterable[Part]) -> "Telemetry":
        """Return it with the figures of one report."""
        new = self
        for part in parts:
            match part:
                case Core():
                    new = replace(new, pwm=(part.left_pwm / 127, part.right_pwm / 127), charger=charger(part.charger))
                case MotorCurrent():
                    new = replace(new, currents=(part.left_10ma / 100, part.right_10ma / 100))
                case CliffDistance():
                    new = replace(new, floor=(part.left, part.centre, part.right))
                case RawGyro():
                    new = replace(new, rates=part.rates)
                case Inputs():
                    volts = (part.analogue_0, part.analogue_1, part.analogue_2, part.analogue_3)
                    new = replace(
                        new,
                        digital=tuple(bool(part.digital >> bit & 1) for bit in range(4)),
                        analogue=tuple(value * _VOLTS for value in volts),
                    )
                case Gains():
                    new = replace(new, gains=part)
        return new


def charger(bits: int) -> str:
    """Return what the charger does, in words: ``unplugged``, or what feeds it and whether that charges."""
    if not bits & Charger.POWERED:
        return "unplugged"
    feeds = "adapter" if bits & Charger.ADAPTER else "dock"
    return f"{feeds}, charging" if bits & Charger.CHARGING else f"{feeds}, full"
