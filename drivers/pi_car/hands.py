"""What a guardian on a Raspberry Pi has in its hands: motors on pins, motors and servos on a PCA9685."""

from collections.abc import Callable, Mapping
from typing import Any

from drivers.keeper.keeper import Hands, Servos, Wheels
from drivers.pi_car.pca9685 import Bus, Pca9685

Motor = Callable[[float], None]
"""Turns a motor at a share of its full power, -1..1."""


def hands(told: Mapping[str, Any]) -> Hands:
    """Return what a section of a robot file is about. Raises ImportError, OSError and what gpiozero raises."""
    if "pan" in told:
        return servos(chip(told), told["pan"], told["tilt"])
    if told["motors"] == "gpio":
        return wheels(on_pins(told["left"]), on_pins(told["right"]))
    board = chip(told)
    return wheels(on_channels(board, told["left"]), on_channels(board, told["right"]))


def wheels(left: Motor, right: Motor) -> Wheels:
    """Return two motors, which stand."""

    def turn(one: float, other: float) -> None:
        try:
            left(one)
        finally:  # where one cannot be told, the other is all the same
            right(other)

    return Wheels(turn)


def servos(board: Pca9685, pan: int, tilt: int) -> Servos:
    """Return two servos, where the chip has sent them."""
    channels = (pan, tilt)

    def pulse(number: int, degree: int) -> None:
        board.degree(channels[number], degree)

    standing = board.sent(pan), board.sent(tilt)
    for channel, degree in zip(channels, standing, strict=True):
        if degree is None:
            board.share(channel, 0.0)  # no pulse at all, so that the next guardian knows no more than this one
    return Servos(pulse, standing)


def chip(told: Mapping[str, Any]) -> Pca9685:
    """Return a PCA9685 that makes pulses."""
    from smbus2 import SMBus  # noqa: PLC0415 - an optional dependency, of those who have one

    bus: Bus = SMBus(told["bus"])
    board = Pca9685(bus, told["address"])
    board.wake()
    return board


def on_pins(told: Mapping[str, int | None]) -> Motor:
    """Return a motor on pins of the computer."""
    from gpiozero import DigitalOutputDevice, Motor, PWMOutputDevice  # noqa: PLC0415 - the same

    if told["enable"] is None:
        motor = Motor(told["forward"], told["backward"])

        def turn(share: float) -> None:
            motor.value = share

        return turn
    ahead, back = (DigitalOutputDevice(told[word]) for word in ("forward", "backward"))
    power = PWMOutputDevice(told["enable"])

    def drive(share: float) -> None:
        power.value = 0.0  # it stands while the way changes
        ahead.value, back.value = share > 0, share < 0
        power.value = abs(share)

    return drive


def on_channels(board: Pca9685, told: Mapping[str, int | None]) -> Motor:
    """Return a motor on channels of a PCA9685."""
    forward, backward, enable = (told[word] for word in ("forward", "backward", "enable"))

    def turn(share: float) -> None:
        ahead, back = max(share, 0.0), max(-share, 0.0)
        if enable is not None:
            board.share(enable, 0.0)  # it stands while the way changes
            ahead, back = float(share > 0), float(share < 0)
        for channel, on in sorted(((forward, ahead), (backward, back)), key=lambda each: each[1]):
            if channel is not None:
                board.share(channel, on)
        if enable is not None:
            board.share(enable, abs(share))

    return turn
