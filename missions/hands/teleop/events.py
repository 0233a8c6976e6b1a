"""The events of a game pad as Linux tells them (linux/input.h, input-event-codes.h, and its gamepad document). Pure."""

from struct import Struct

from drivers.api.quick import dataclass

_EVENT = Struct("@llHHi")  # struct input_event: a time in two longs, type, code, value; native, as it is never stored
_ABSINFO = Struct("@6i")  # struct input_absinfo: value, minimum, maximum, fuzz, flat, resolution
_ID = Struct("@4H")  # struct input_id: bus, vendor, product, version
ABSINFO_SIZE = _ABSINFO.size

SYN, KEY, ABS = 0, 1, 3
SYN_DROPPED = 3
"""The code of the event of kind ``SYN`` that says: you read too slowly, and events were lost."""

SOUTH, EAST, C, Z, SHOULDER_LEFT, START = 0x130, 0x131, 0x132, 0x135, 0x136, 0x13B
TRIGGER = 0x120
"""The first button of a joystick, and of a pad in its D mode, which numbers its buttons from here on."""

BUTTONS = range(0x100, 0x300)
"""Where buttons of any kind are."""

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
    """What an axis measures at its ends, and where it ``rests`` if that is not the middle."""

    least: int
    most: int
    rest: float | None = None

    def share(self, value: int, dead: float = 0.0) -> float:
        """Return where ``value`` is between the ends, as -1..1; the ``dead`` share around its rest counts as 0.

        Beyond it the square, so that small movements of the stick are fine ones.
        """
        middle = (self.least + self.most) / 2 if self.rest is None else self.rest
        half = self.most - middle if value > middle else middle - self.least
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


def bits_request(kind: int, size: int) -> int:
    """Return the ioctl number EVIOCGBIT, which asks which codes of a kind of event there are, in ``size`` bytes."""
    return 2 << 30 | size << 16 | ord("E") << 8 | 0x20 + kind


def name_request(size: int) -> int:
    """Return the ioctl number EVIOCGNAME."""
    return 2 << 30 | size << 16 | ord("E") << 8 | 0x06


ID_REQUEST = 2 << 30 | 8 << 16 | ord("E") << 8 | 0x02
"""The ioctl number EVIOCGID."""


def ids_of(data: bytes) -> tuple[int, int]:
    """Read vendor and product from a ``struct input_id``."""
    _, vendor, product, _ = _ID.unpack(data)
    return vendor, product


def codes_of(bits: bytes) -> frozenset[int]:
    """Read which codes there are from the bitmap of ``bits_request``."""
    return frozenset(8 * place + bit for place, byte in enumerate(bits) for bit in range(8) if byte >> bit & 1)


def span_of(absinfo: bytes) -> Span:
    """Read the ends of an axis from its ``struct input_absinfo``."""
    _, least, most, *_ = _ABSINFO.unpack(absinfo)
    return Span(least, most)


def value_of(absinfo: bytes) -> int:
    """Read where an axis is from its ``struct input_absinfo``."""
    return int(_ABSINFO.unpack(absinfo)[0])


def events_of(data: bytes) -> list[Event]:
    """Read events; the kernel hands out whole ones only, and what is left over at the end is no event."""
    whole = len(data) - len(data) % _EVENT.size
    return [Event(*fields[2:]) for fields in _EVENT.iter_unpack(data[:whole])]


def has_button(capabilities: str, button: int) -> bool:
    """Say whether a device has a button, by the ``capabilities/key`` of its node in sysfs.

    That is a bitmap in hexadecimal words of the machine's ``long``, the lowest last.
    """
    bits = 8 * Struct("@l").size
    words = capabilities.split()[::-1]
    word, bit = divmod(button, bits)
    return word < len(words) and bool(int(words[word], 16) >> bit & 1)
