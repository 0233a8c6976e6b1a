"""The events of a game pad as Linux tells them (linux/input.h, input-event-codes.h, and its gamepad document). Pure."""

from struct import Struct

from drivers.api.quick import dataclass

_EVENT = Struct("@llHHi")  # struct input_event: a time in two longs, type, code, value; native, as it is never stored
_ABSINFO = Struct("@6i")  # struct input_absinfo: value, minimum, maximum, fuzz, flat, resolution
ABSINFO_SIZE = _ABSINFO.size

SYN, KEY, ABS = 0, 1, 3
SYN_DROPPED = 3
"""The code of the event of kind ``SYN`` that says: you read too slowly, and events were lost."""

SOUTH, EAST, SHOULDER_LEFT, START = 0x130, 0x131, 0x136, 0x13B
STICK_X, STICK_Y, HAT_X, HAT_Y = 0x00, 0x01, 0x10, 0x11


@dataclass(frozen=True, slots=True)
class Event:
    """One change: of a button (``KEY``: 1 down, 0 up) or of an axis (``ABS``: in the pad's own steps)."""

    kind: int
    code: int
    value: int

    def pack(self) -> bytes:
        """Return its bytes, at the time zero."""
        return _EVENT.pack(0, 0, self.kind, self.code, self.value)


@dataclass(frozen=True, slots=True)
class Span:
    """What an axis measures at its ends."""

    least: int
    most: int

    def share(self, value: int, dead: float = 0.0) -> float:
        """Return where ``value`` is between the ends, as -1..1; the ``dead`` share around the middle counts as 0.

        Beyond it the square, so that small movements of the stick are fine ones.
        """
        middle, half = (self.least + self.most) / 2, (self.most - self.least) / 2
        if half <= 0:
            return 0.0
        out = min(abs(value - middle) / half, 1.0)
        if out <= dead:
            return 0.0
        square = ((out - dead) / (1 - dead)) ** 2
        return square if value > middle else -square


def span_request(axis: int) -> int:
    """Return the ioctl number EVIOCGABS, which asks the driver for the ``struct input_absinfo`` of an axis."""
    return 2 << 30 | ABSINFO_SIZE << 16 | ord("E") << 8 | 0x40 + axis


def span_of(absinfo: bytes) -> Span:
    """Read the ends of an axis from its ``struct input_absinfo``."""
    _, least, most, *_ = _ABSINFO.unpack(absinfo)
    return Span(least, most)


def events_of(data: bytes) -> list[Event]:
    """Read events; the kernel hands out whole ones only, and what is left over at the end is no event."""
    whole = len(data) - len(data) % _EVENT.size
    return [Event(*fields[2:]) for fields in _EVENT.iter_unpack(data[:whole])]


def is_gamepad(capabilities: str) -> bool:
    """Say whether a device has the south button of a game pad, by the ``capabilities/key`` of its node in sysfs.

    That is a bitmap in hexadecimal words of the machine's ``long``, the lowest last.
    """
    bits = 8 * Struct("@l").size
    words = capabilities.split()[::-1]
    word, bit = divmod(SOUTH, bits)
    return word < len(words) and bool(int(words[word], 16) >> bit & 1)
