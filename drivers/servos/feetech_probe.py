"""Probe for Feetech STS servos, as for Dynamixels: a ping, then the identity in the control table."""

from collections.abc import Generator

from drivers.api.probe import ProbeRequest, ProbeResult
from drivers.servos.probe import probe_servos

FACTORY_BAUD_RATES = (1_000_000,)
OTHER_BAUD_RATES = (500_000, 115_200, 250_000, 128_000, 76_800, 57_600, 38_400)


def probe() -> Generator[ProbeRequest, bytes, ProbeResult | None]:
    """Probe for STS servos, at the factory baud rate first, else at the other rates."""
    return (yield from probe_servos(("STS",), FACTORY_BAUD_RATES, OTHER_BAUD_RATES))
