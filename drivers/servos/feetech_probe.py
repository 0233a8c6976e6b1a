"""Feetech's STS are recognised as Dynamixels are: by a ping, and by what their own table says."""

from collections.abc import Generator

from drivers.api.probe import ProbeRequest, ProbeResult
from drivers.servos.probe import probe_servos

FACTORY_BAUD_RATES = (1_000_000,)
OTHER_BAUD_RATES = (500_000, 115_200, 250_000, 128_000, 76_800, 57_600, 38_400)


def probe() -> Generator[ProbeRequest, bytes, ProbeResult | None]:
    """Ask for STS servos, at the rate at which they are delivered, else at all others."""
    return (yield from probe_servos(("STS",), FACTORY_BAUD_RATES, OTHER_BAUD_RATES))
