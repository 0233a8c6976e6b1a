"""How the rover is looked at by `mission doctor`, at rest."""

from collections.abc import Iterator

from drivers.api.driver import Finding, Site, wrong
from drivers.api.probing import Ask
from drivers.finding.asking import OpenedPort
from sample_robot.declared import RoverKeys


def rover(keys: RoverKeys, site: Site) -> Iterator[Finding]:
    """Count its reports."""
    port = OpenedPort(site.port, site.clock)
    try:
        reports = port.ask(Ask(keys.baud, wait=0.5)).count(b"\no ")
    finally:
        port.close()
    if reports:
        yield Finding("reports", f"{2 * reports} a second")
    else:
        yield wrong("reports", "it is silent", "switch it on, then: mission doctor --robot ROBOT")
