"""Declarations and keys of the Raspberry Pi car and of its pan/tilt head."""

from collections.abc import Iterator, Mapping
from typing import Literal

from drivers.api.device import ReconnectPolicy
from drivers.api.driver import Driver
from drivers.api.keys import KeyDiagnostic, key, keys
from drivers.api.sections import BaseKeys
from drivers.head.keys import ServoKeys, TwoServoKeys

PIN_COUNT, CHANNEL_COUNT = 28, 16
"""Number of GPIO pins of a Raspberry Pi, and of channels of a PCA9685."""


@keys
class CarMotorKeys:
    """Keys of a motor: the inputs of its driver chip for forward, backward and, optionally, for the power."""

    forward: int = key(low=0, high=PIN_COUNT - 1, help="GPIO number, or channel, that turns it forward.")
    backward: int = key(low=0, high=PIN_COUNT - 1, help="GPIO number, or channel, that turns it backward.")
    enable: int | None = key(
        default=None,
        low=0,
        high=PIN_COUNT - 1,
        help="GPIO number, or channel, for the power, if the chip has such an input (ENA, PWMA).",
    )

    @property
    def pins(self) -> tuple[int, ...]:
        """All pins or channels of the motor."""
        return (self.forward, self.backward) + (() if self.enable is None else (self.enable,))


@keys
class I2CKeys:
    """Keys of a PCA9685 PWM chip: its I2C bus and address."""

    bus: int = key(default=1, low=0, high=255, help="I2C bus of the PCA9685: 1 is that on the pins of a Pi.")
    address: int = key(
        default=0x40, low=0x03, high=0x77, help="Address on that bus: 64, unless its solder bridges were changed."
    )


@keys
class PiCarKeys(BaseKeys, I2CKeys):
    """Keys of the base of a car on a Raspberry Pi."""

    max_speed: float = key("speed", default=0.3, low=0.01, high=5.0, help="Maximum speed.")
    motors: Literal["gpio", "pca9685"] = key(
        default="gpio", help="Connection of the motors' driver chip: the pins of the Pi, or the channels of a PCA9685."
    )
    left: CarMotorKeys = key(help="Motor, or motors, on the left.")
    right: CarMotorKeys = key(help="Motor, or motors, on the right.")
    speed_at_full: float = key(
        "speed", default=0.5, low=0.05, high=5.0, help="Speed at full power: measure it, docs/rovers.md."
    )
    track: float = key("length", default=0.13, low=0.02, high=2.0, help="Effective distance of its wheels.")

    def diagnostics(self) -> Iterator[KeyDiagnostic]:
        """Yield a diagnostic for a maximum speed that the car cannot reach, and for pins used twice or out of range."""
        if self.max_speed > self.speed_at_full:
            most, full = f"{self.max_speed:g} m/s", f"{self.speed_at_full:g} m/s"
            message = f"'max_speed' ({most}) is above 'speed_at_full' ({full}): it cannot go that fast"
            yield KeyDiagnostic(message, ("max_speed",), ("speed_at_full",))
        pins = (*self.left.pins, *self.right.pins)
        word = "GPIO" if self.motors == "gpio" else "channel"
        for pin in sorted({pin for pin in pins if pins.count(pin) > 1}):
            yield KeyDiagnostic(f"{word} {pin} is used twice", about=(("left",), ("right",)))
        if self.motors == "pca9685" and max(pins) >= CHANNEL_COUNT:
            yield KeyDiagnostic(
                f"a PCA9685 has channels 0 to {CHANNEL_COUNT - 1}, not {max(pins)}", about=(("left",), ("right",))
            )


@keys
class ChannelKeys(ServoKeys):
    """Hobby servo on a channel of a PCA9685; see ``ServoKeys``."""

    servo: int = key(low=0, high=CHANNEL_COUNT - 1, help="Channel of the PCA9685.")
    start: int | None = key(
        default=90, low=0, high=180, help="Assumed angle while it is unknown, in degrees of the servo."
    )


@keys
class PiHeadKeys(TwoServoKeys, I2CKeys):
    """Keys of a pan/tilt head on a PCA9685."""

    pan: ChannelKeys = key(help="Servo that turns the head left and right.")
    tilt: ChannelKeys = key(help="Servo that turns the head up and down.")
    away: ReconnectPolicy = key(default=ReconnectPolicy(), help="Reconnect policy after it was silent.")


def check_channels(head: PiHeadKeys, others: Mapping[str, object]) -> Iterator[KeyDiagnostic]:
    """Yield a diagnostic for each servo of ``head`` that is on a channel of a motor.

    ``others`` are the other sections of the robot file, by name.
    """
    base = others.get("base")
    if (
        not isinstance(base, PiCarKeys)
        or base.motors != "pca9685"
        or (base.bus, base.address) != (head.bus, head.address)
    ):
        return
    for word, servo in (("pan", head.pan.servo), ("tilt", head.tilt.servo)):
        if servo in (*base.left.pins, *base.right.pins):
            yield KeyDiagnostic(f"'{word}': channel {servo} is used by a motor", (word, "servo"))


PI_CAR = Driver(
    "pi_car",
    "base",
    "A car on a Raspberry Pi: two motors on pins or on a PCA9685, nothing measured.",
    PiCarKeys,
    make="drivers.pi_car.make:base",
    twin="drivers.pi_car.base_twin:make",
    virtual="drivers.pi_car.base_virtual:make",
    extra="pi",
)

PI_HEAD = Driver(
    "pca9685",
    "head",
    "Two hobby servos on a PCA9685 of a Raspberry Pi.",
    PiHeadKeys,
    make="drivers.pi_car.make:head",
    twin="drivers.pi_car.head_twin:make",
    virtual="drivers.pi_car.head_virtual:make",
    check=check_channels,
    extra="pi",
)
