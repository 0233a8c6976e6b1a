"""How an RPLIDAR is, at rest: who it is, and what it says of its health. It does not turn."""

from collections.abc import Iterator

from drivers.api.driver import Finding, Site, warning, wrong
from drivers.api.probing import Ask
from drivers.finding.asking import OpenedPort
from drivers.rplidar import wire
from drivers.rplidar.declared import RPLidarKeys

REPLY = 0.3
"""Seconds in which it answers."""


def checkup(keys: RPLidarKeys, site: Site) -> Iterator[Finding]:
    """Have it be silent, and ask it."""
    port = OpenedPort(site.port, site.clock)
    try:
        port.ask(Ask(keys.baud, wire.request(wire.Command.STOP), 0.1))
        told = _asked(port, keys.baud, wire.Command.INFO, wire.INFO_REPLY, wire.Info.LAYOUT.size)
        felt = _asked(port, keys.baud, wire.Command.HEALTH, wire.HEALTH_REPLY, wire.Condition.LAYOUT.size)
    finally:
        port.close()
    if not told:
        yield wrong("device", "it does not answer", "look at its cable and power; another rate: mission ports")
        return
    info = wire.Info.unpack(told)
    about = f"series {info.series}, firmware {info.firmware_major}.{info.firmware_minor}"
    if f"a{info.series}" != keys.model and info.series in {1, 2}:
        yield warning("device", f"{about}; the robot file says {keys.model}", f"write model: a{info.series}")
    else:
        yield Finding("device", about)
    condition = wire.Condition.unpack(felt) if felt else wire.Condition(wire.Status.WARNING)
    if condition.status == wire.Status.ERROR:
        yield wrong("health", f"it has a fault, code {condition.code}", "cut its power for a moment; clean its window")
    elif condition.status != wire.Status.GOOD:
        yield warning("health", f"it is not well, code {condition.code}", "clean its window, and look that it turns")
    else:
        yield Finding("health", "good")


def _asked(port: OpenedPort, baud: int, command: wire.Command, begin: bytes, size: int) -> bytes:
    """Return what it answers behind the ``begin``; nothing where it does not."""

    def rest(heard: bytes) -> bytes:
        behind = heard.partition(begin)[2][:size]
        return behind if len(behind) == size else b""

    return rest(port.ask(Ask(baud, wire.request(command), REPLY, rest)))
