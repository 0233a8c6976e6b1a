"""Feetech's STS are recognised as Dynamixels are: by a ping, and by what their own table says."""

from collections.abc import Generator

from drivers.api.probing import Answer, Ask
from drivers.servos.probe import servos

DELIVERED = (1_000_000,)
OTHERS = (500_000, 115_200, 250_000, 128_000, 76_800, 57_600, 38_400)


def probe() -> Generator[Ask, bytes, Answer | None]:
    """Ask for STS servos, at the rate at which they are delivered, else at all others."""
    return (yield from servos(("STS",), DELIVERED, OTHERS))
