"""Check-up of an RPLIDAR at rest: its model and its health. The motor does not turn."""

from collections.abc import Iterator

from drivers.api.driver import DriverContext, Finding, failure, warning
from drivers.api.probe import ProbeRequest
from drivers.finding.port_probe import ExclusivePort
from drivers.rplidar import wire
from drivers.rplidar.declared import RPLidarKeys

REPLY_TIMEOUT = 0.3
"""Seconds until a request counts as unanswered."""


def checkup(keys: RPLidarKeys, context: DriverContext) -> Iterator[Finding]:
    """Stop the scan of the RPLIDAR, and yield findings on its model and health."""
    port = ExclusivePort(context.port, context.clock)
    try:
        port.exchange(ProbeRequest(keys.baud, wire.request(wire.RPLidarCommand.STOP), 0.1))
        info_data = _request(port, keys.baud, wire.RPLidarCommand.INFO, wire.INFO_REPLY, wire.RPLidarInfo.LAYOUT.size)
        health_data = _request(
            port, keys.baud, wire.RPLidarCommand.HEALTH, wire.HEALTH_REPLY, wire.RPLidarHealth.LAYOUT.size
        )
    finally:
        port.close()
    if not info_data:
        yield failure("device", "no reply", "check its cable and power; another rate: mission ports")
        return
    info = wire.RPLidarInfo.unpack(info_data)
    about = f"series {info.series}, firmware {info.firmware_major}.{info.firmware_minor}"
    if f"a{info.series}" != keys.model and info.series in {1, 2}:
        yield warning("device", f"{about}; the robot file says {keys.model}", f"write model: a{info.series}")
    else:
        yield Finding("device", about)
    condition = (
        wire.RPLidarHealth.unpack(health_data) if health_data else wire.RPLidarHealth(wire.RPLidarStatus.WARNING)
    )
    if condition.status == wire.RPLidarStatus.ERROR:
        yield failure(
            "health", f"it has a fault, code {condition.code}", "cut its power for a moment; clean its window"
        )
    elif condition.status != wire.RPLidarStatus.GOOD:
        yield warning(
            "health", f"it reports a warning, code {condition.code}", "clean its window, and check that it turns"
        )
    else:
        yield Finding("health", "good")


def _request(port: ExclusivePort, baud: int, command: wire.RPLidarCommand, descriptor: bytes, size: int) -> bytes:
    """Send a command; return the ``size`` bytes that follow ``descriptor`` in the reply, no bytes without a reply."""

    def rest(data: bytes) -> bytes:
        behind = data.partition(descriptor)[2][:size]
        return behind if len(behind) == size else b""

    return rest(port.exchange(ProbeRequest(baud, wire.request(command), REPLY_TIMEOUT, rest)))
