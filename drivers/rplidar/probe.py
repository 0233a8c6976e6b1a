"""An RPLIDAR is recognised by what it says of itself; it is told to be silent first, in case it is scanning."""

from collections.abc import Generator

from drivers.api.probing import Answer, Ask
from drivers.rplidar import wire

RATES = (wire.BAUD, 256_000)
"""The rate of an A1 and A2, and that of an A3 and S1."""

SIZE = wire.Info.LAYOUT.size


def probe() -> Generator[Ask, bytes, Answer | None]:
    """Ask who it is, at each of its rates."""
    for baud in RATES:
        yield Ask(baud, wire.request(wire.Command.STOP), 0.1)
        heard = yield Ask(baud, wire.request(wire.Command.INFO), 0.3, lambda heard: _info(heard) is not None)
        if info := _info(heard):
            firmware = ".".join(str(number) for number in info.firmware)
            known = f"a{info.series}" if info.series in {1, 2} else None
            about = f"an RPLIDAR of series {info.series} (model 0x{info.model:02x}), firmware {firmware}"
            return Answer(about, {"baud": baud} | ({} if known is None else {"model": known}))
    return None


def _info(heard: bytes) -> wire.Info | None:
    _, found, rest = heard.partition(wire.INFO_REPLY)
    return wire.Info.unpack(rest[:SIZE]) if found and len(rest) >= SIZE else None
