"""Chains of virtual servos as the shop delivers them."""

from drivers.servos.virtual.chain import VirtualServoBus
from drivers.servos.virtual.servo import VirtualServo
from tests.drivers.fault_injection import FaultInjection


def chain(
    count: int, model: str = "AX-12A", *, paced: bool = False, injection: FaultInjection | None = None
) -> VirtualServoBus:
    """Return ``count`` servos with the IDs from 1, all in their middle."""
    servos = [VirtualServo(number, model=model) for number in range(1, count + 1)]
    return VirtualServoBus(servos, paced=paced, injection=injection)


def mixed_chain(*models: str, baud: int = 1_000_000, paced: bool = False) -> VirtualServoBus:
    """Return one servo of each of ``models``, with the IDs from 1."""
    servos = [VirtualServo(number, model=model) for number, model in enumerate(models, 1)]
    return VirtualServoBus(servos, baud, paced=paced)
