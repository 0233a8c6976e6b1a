"""Probe of an RPLIDAR, recognised by its info reply; a running scan is stopped first."""

from collections.abc import Generator

from drivers.api.probe import ProbeRequest, ProbeResult
from drivers.rplidar import wire

BAUD_RATES = (wire.BAUD, 256_000)
"""Baud rates of the RPLIDAR A1 and A2, and of the A3 and S1."""

INFO_SIZE = wire.RPLidarInfo.LAYOUT.size


def probe() -> Generator[ProbeRequest, bytes, ProbeResult | None]:
    """Request the info of an RPLIDAR at each baud rate."""
    for baud in BAUD_RATES:
        yield ProbeRequest(baud, wire.request(wire.RPLidarCommand.STOP), 0.1)
        data = yield ProbeRequest(
            baud, wire.request(wire.RPLidarCommand.INFO), 0.3, lambda data: _info(data) is not None
        )
        if info := _info(data):
            firmware = ".".join(str(number) for number in info.firmware)
            model = f"a{info.series}" if info.series in {1, 2} else None
            about = f"an RPLIDAR of series {info.series} (model 0x{info.model:02x}), firmware {firmware}"
            return ProbeResult(about, {"baud": baud} | ({} if model is None else {"model": model}))
    return None


def _info(data: bytes) -> wire.RPLidarInfo | None:
    _, found, rest = data.partition(wire.INFO_REPLY)
    return wire.RPLidarInfo.unpack(rest[:INFO_SIZE]) if found and len(rest) >= INFO_SIZE else None
