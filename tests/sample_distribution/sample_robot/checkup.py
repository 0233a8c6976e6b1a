"""How the rover is looked at by `mission doctor`, at rest."""

from collections.abc import Iterator

from drivers.api.driver import DriverContext, Finding, failure
from drivers.api.probe import Ask
from drivers.finding.port_probe import ExclusivePort
from sample_robot.declared import RoverKeys


def rover(keys: RoverKeys, site: DriverContext) -> Iterator[Finding]:
    """Count its reports."""
    port = ExclusivePort(site.port, site.clock)
    try:
        reports = port.ask(Ask(keys.baud, wait=0.5)).count(b"\no ")
    finally:
        port.close()
    if reports:
        yield Finding("reports", f"{2 * reports} a second")
    else:
        yield failure("reports", "it is silent", "switch it on, then: mission doctor --robot ROBOT")
