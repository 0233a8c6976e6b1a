"""What Feetech's STS and SMS servos say in frames of protocol 1.0, which they share: readings of many, and their state.

They answer a request that they understand, whatever they think of it: no error byte refuses one. A request that came
damaged they do not answer. Broadcast pings collide. Source: the maker's protocol manual and memory table.
"""

from typing import Final

from drivers.dynamixel.wire import Fault

_BITS: Final = {0: Fault.VOLTAGE, 1: Fault.ENCODER, 2: Fault.OVERHEATING, 3: Fault.CURRENT, 5: Fault.OVERLOAD}


def faults_of(status: int) -> Fault:
    """Return what an error byte says, or register 65, ``status``."""
    found = Fault(0)
    for bit, fault in _BITS.items():
        if status >> bit & 1:
            found |= fault
    return found


def status_of(faults: Fault) -> int:
    """Return the error byte that says ``faults``."""
    return sum(1 << bit for bit, fault in _BITS.items() if faults & fault)
