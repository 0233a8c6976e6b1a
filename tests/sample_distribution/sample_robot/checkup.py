"""Check-up of the rover at rest, for `mission doctor`."""

from collections.abc import Iterator

from drivers.api.driver import DriverContext, Finding, failure
from drivers.api.probe import ProbeRequest
from drivers.finding.port_probe import ExclusivePort
from sample_robot.declared import RoverKeys


def rover(keys: RoverKeys, context: DriverContext) -> Iterator[Finding]:
    """Count the reports of half a second."""
    port = ExclusivePort(context.port, context.clock)
    try:
        reports = port.exchange(ProbeRequest(keys.baud, timeout=0.5)).count(b"\no ")
    finally:
        port.close()
    if reports:
        yield Finding("reports", f"{2 * reports} a second")
    else:
        yield failure("reports", "no reports", "switch it on, then: mission doctor --robot ROBOT")
