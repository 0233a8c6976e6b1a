"""Chains of virtual servos as the shop delivers them."""

from drivers.virtual.ax12 import VirtualAX12
from drivers.virtual.dynamixel import VirtualServoBus


def chain(count: int) -> VirtualServoBus:
    """Return ``count`` AX-12A with the IDs from 1, all in their middle."""
    return VirtualServoBus([VirtualAX12(number) for number in range(1, count + 1)])
