"""An RPLIDAR is recognised by what it says of itself; it is told to be silent first, in case it is scanning."""

from collections.abc import Generator

from drivers.api.probe import ProbeRequest, ProbeResult
from drivers.rplidar import wire

BAUD_RATES = (wire.BAUD, 256_000)
"""The rate of an A1 and A2, and that of an A3 and S1."""

INFO_SIZE = wire.RPLidarInfo.LAYOUT.size


def probe() -> Generator[ProbeRequest, bytes, ProbeResult | None]:
    """Ask who it is, at each of its rates."""
    for baud in BAUD_RATES:
        yield ProbeRequest(baud, wire.request(wire.RPLidarCommand.STOP), 0.1)
        heard = yield ProbeRequest(
            baud, wire.request(wire.RPLidarCommand.INFO), 0.3, lambda heard: _info(heard) is not None
        )
        if info := _info(heard):
            firmware = ".".join(str(number) for number in info.firmware)
            known = f"a{info.series}" if info.series in {1, 2} else None
            about = f"an RPLIDAR of series {info.series} (model 0x{info.model:02x}), firmware {firmware}"
            return ProbeResult(about, {"baud": baud} | ({} if known is None else {"model": known}))
    return None


def _info(data: bytes) -> wire.RPLidarInfo | None:
    _, found, rest = data.partition(wire.INFO_REPLY)
    return wire.RPLidarInfo.unpack(rest[:INFO_SIZE]) if found and len(rest) >= INFO_SIZE else None
