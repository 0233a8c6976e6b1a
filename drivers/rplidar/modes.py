"""What a finder says of its ways to scan: how often it measures in each, how far, and in what form it tells."""

from dataclasses import dataclass
from enum import IntEnum
from struct import Struct

RATES = Struct("<HH")
"""The reply to ``Command.RATES``: microseconds from one measurement to the next, plain and express."""

EXPRESS = Struct("<BHH")
"""The payload of ``Command.EXPRESS``: the way to scan by its number, flags, and a number of no use here."""


class Asked(IntEnum):
    """What ``Command.SETTING`` may ask for; all but the first two with the number of a way to scan."""

    COUNT = 0x70
    TYPICAL = 0x7C
    PERIOD = 0x71
    FARTHEST = 0x74
    FORM = 0x75
    NAME = 0x7F


@dataclass(frozen=True, slots=True)
class Mode:
    """A way to scan: microseconds for a measurement, metres that it sees, and the type of its answer."""

    name: str
    period: float
    farthest: float
    form: int

    def told(self, asked: int) -> bytes:
        """Return what it says of itself; nothing of what it does not know. Periods and metres in 1/256."""
        match asked:
            case Asked.PERIOD:
                return round(self.period * 256).to_bytes(4, "little")
            case Asked.FARTHEST:
                return round(self.farthest * 256).to_bytes(4, "little")
            case Asked.FORM:
                return bytes([self.form])
            case Asked.NAME:
                return self.name.encode() + b"\0"
        return b""


def setting(payload: bytes, modes: tuple[Mode, ...], typical: int) -> bytes:
    """Return what a finder with these ``modes`` answers to ``Command.SETTING``; nothing to what it does not know."""
    asked, number = int.from_bytes(payload[:4], "little"), int.from_bytes(payload[4:6], "little")
    if len(payload) < 4:
        return b""
    if asked in (Asked.COUNT, Asked.TYPICAL):
        told = (len(modes) if asked == Asked.COUNT else typical).to_bytes(2, "little")
    else:
        told = modes[number].told(asked) if len(payload) >= 6 and number < len(modes) else b""
    return payload[:4] + told if told else b""
