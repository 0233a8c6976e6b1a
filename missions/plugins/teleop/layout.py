"""Button layouts of game pads: standard ones, known models, and taught ones.

Only some kernel drivers name the buttons by their places. Others, such as pads in D mode, number them, in an order that
depends on the maker. So an unknown pad is refused until a person has taught its layout.
"""

from collections.abc import Iterator, Mapping
from struct import Struct
from types import MappingProxyType

from drivers.api.fast_dataclass import dataclass
from drivers.errors import NotConnected
from missions.control.pilot import ENABLE_KEY, LATCH_KEY

# The events of a game pad as Linux tells them (linux/input.h, input-event-codes.h, and its gamepad document). Pure.

_EVENT = Struct("@llHHi")  # struct input_event: a time in two longs, type, code, value; native, as it is never stored
_ABSINFO = Struct("@6i")  # struct input_absinfo: value, minimum, maximum, fuzz, flat, resolution
_ID = Struct("@4H")  # struct input_id: bus, vendor, product, version
ABSINFO_SIZE = _ABSINFO.size

SYN, KEY, ABS = 0, 1, 3
SYN_DROPPED = 3
"""Code of a ``SYN`` event that reports lost events, because they were read too slowly."""

SOUTH, EAST, C, Z, SHOULDER_LEFT, START = 0x130, 0x131, 0x132, 0x135, 0x136, 0x13B
TRIGGER = 0x120
"""Event code of the first button of a joystick. A pad in D mode numbers its buttons from this code on."""

BUTTONS = range(0x100, 0x300)
"""Range of the event codes that stand for buttons of an input device."""

STICK_X, STICK_Y, HAT_X, HAT_Y = 0x00, 0x01, 0x10, 0x11


@dataclass(frozen=True, slots=True)
class PadEvent:
    """Change of a button (``KEY``: 1 down, 0 up) or of an axis (``ABS``: in the pad's own units)."""

    kind: int
    code: int
    value: int

    def pack(self) -> bytes:
        """Return the event in the bytes of a Linux ``struct input_event``, with the time zero."""
        return _EVENT.pack(0, 0, self.kind, self.code, self.value)


@dataclass(frozen=True, slots=True)
class AxisRange:
    """Range of an axis of a game pad; ``rest`` is the axis's rest position if that is not the middle."""

    least: int
    most: int
    rest: float | None = None

    def scale(self, value: int, dead_zone: float = 0.0) -> float:
        """Return ``value`` scaled to -1..1; the share ``dead_zone`` around the rest position is 0.

        Beyond the dead zone, the square of the deflection is returned, so that small movements of the stick are
        precise.
        """
        middle = (self.least + self.most) / 2 if self.rest is None else self.rest
        half = self.most - middle if value > middle else middle - self.least
        if half <= 0:
            return 0.0
        out = min(abs(value - middle) / half, 1.0)
        if out <= dead_zone:
            return 0.0
        square = ((out - dead_zone) / (1 - dead_zone)) ** 2
        return square if value > middle else -square


def range_request(axis: int) -> int:
    """Return the ioctl number EVIOCGABS, which reads the ``struct input_absinfo`` of an axis."""
    return 2 << 30 | ABSINFO_SIZE << 16 | ord("E") << 8 | 0x40 + axis


def bits_request(kind: int, size: int) -> int:
    """Return the ioctl number EVIOCGBIT, which reads the codes of a kind of event, as ``size`` bytes."""
    return 2 << 30 | size << 16 | ord("E") << 8 | 0x20 + kind


def name_request(size: int) -> int:
    """Return the ioctl number EVIOCGNAME, which reads the name of an input device, as ``size`` bytes."""
    return 2 << 30 | size << 16 | ord("E") << 8 | 0x06


ID_REQUEST = 2 << 30 | 8 << 16 | ord("E") << 8 | 0x02
"""The ioctl number EVIOCGID, which reads vendor and product of an input device."""


def parse_ids(data: bytes) -> tuple[int, int]:
    """Return vendor and product from a ``struct input_id``."""
    _, vendor, product, _ = _ID.unpack(data)
    return vendor, product


def parse_codes(bits: bytes) -> frozenset[int]:
    """Return the codes in a bitmap of ``bits_request``."""
    return frozenset(8 * place + bit for place, byte in enumerate(bits) for bit in range(8) if byte >> bit & 1)


def parse_range(absinfo: bytes) -> AxisRange:
    """Return the range of an axis from its ``struct input_absinfo``."""
    _, least, most, *_ = _ABSINFO.unpack(absinfo)
    return AxisRange(least, most)


def parse_value(absinfo: bytes) -> int:
    """Return the position of an axis from its ``struct input_absinfo``."""
    return int(_ABSINFO.unpack(absinfo)[0])


def parse_events(data: bytes) -> list[PadEvent]:
    """Return the events in ``data``; an incomplete one at the end is dropped."""
    whole = len(data) - len(data) % _EVENT.size
    return [PadEvent(*fields[2:]) for fields in _EVENT.iter_unpack(data[:whole])]


def has_button(capabilities: str, button: int) -> bool:
    """Return whether a device has a button, by the ``capabilities/key`` of its node in sysfs.

    That is a bitmap in hexadecimal words of the machine's ``long``, the lowest last.
    """
    bits = 8 * Struct("@l").size
    words = capabilities.split()[::-1]
    word, bit = divmod(button, bits)
    return word < len(words) and bool(int(words[word], 16) >> bit & 1)


PRESS_SHARE, RELEASE_SHARE = 0.6, 0.4
"""Shares of its travel above which a trigger becomes pressed, and below which it is released."""


@dataclass(frozen=True, slots=True)
class Control:
    """Control of a game pad: a button, or an axis that acts as a button (a trigger, or a direction of a hat).

    ``rest`` is the value of the axis when it is released, None for a button; ``end`` is its value when it is pressed.
    """

    code: int
    rest: int | None = None
    end: int = 0

    @property
    def kind(self) -> int:
        """Kind of the control's events: ``KEY`` or ``ABS``."""
        return KEY if self.rest is None else ABS

    def is_pressed_after(self, event: PadEvent, *, before: bool) -> bool | None:
        """Return whether the control is pressed after ``event``, given ``before``; None for another control's event."""
        if (event.kind, event.code) != (self.kind, self.code):
            return None
        if self.rest is None:
            return event.value > 0
        share = (event.value - self.rest) / (self.end - self.rest)
        return share >= (RELEASE_SHARE if before else PRESS_SHARE)


@dataclass(frozen=True, slots=True)
class Stick:
    """Axis of the drive stick. ``sign`` is 1 if its value increases ahead or to the left, -1 if it decreases.

    ``rest`` is its rest position, None if it is unknown.
    """

    code: int
    sign: int = -1
    rest: int | None = None


@dataclass(frozen=True, slots=True)
class PadLayout:
    """Controls of a game pad by their purpose.

    ``hold`` must be held to drive, each of ``stops`` stops and latches the base, ``enable`` releases the latch.
    ``ahead`` and ``left`` are the axes of the drive stick.
    """

    hold: Control
    stops: tuple[Control, ...]
    enable: Control
    ahead: Stick = Stick(STICK_Y)
    left: Stick = Stick(STICK_X)

    def find_errors(self) -> Iterator[str]:
        """Yield an error for each contradiction in the layout, such as one button for two purposes."""
        controls = [self.hold, self.enable, *self.stops]
        if not self.stops:
            yield "no button stops the robot"
        if any(each.rest is not None and each.rest == each.end for each in controls):
            yield "a trigger without travel"
        if len({(each.kind, each.code, each.end) for each in controls}) < len(controls):
            yield "one button does two things"
        axes = {self.ahead.code, self.left.code}
        if len(axes) < 2 or any(each.kind == ABS and each.code in axes for each in controls):
            yield "one axis does two things"

    def control_keys(self) -> Mapping[Control, str]:
        """Return the controls that act like a key of the keyboard, with that key: for enable or latch."""
        return {self.enable: ENABLE_KEY, **dict.fromkeys(self.stops, LATCH_KEY)}


STANDARD_LAYOUT = PadLayout(Control(SHOULDER_LEFT), (Control(EAST),), Control(START))
"""Button layout that Linux defines for game pads (Documentation/input/gamepad.rst)."""

D_MODE_LAYOUT = PadLayout(Control(0x124), (Control(0x121), Control(0x122)), Control(0x129))
"""Layout of pads in D mode: left shoulder is button 5, Start is button 10.

A and B are buttons 2 and 3, in an order that depends on the maker. So both buttons stop.
"""

UNIDENTIFIED_LAYOUT = PadLayout(
    STANDARD_LAYOUT.hold, (*STANDARD_LAYOUT.stops, *D_MODE_LAYOUT.stops), STANDARD_LAYOUT.enable
)
"""Layout of a game pad that the kernel does not describe.

The stop buttons of ``STANDARD_LAYOUT`` and those of ``D_MODE_LAYOUT`` all stop the base.
"""

D_MODELS: Mapping[tuple[int, int], str] = MappingProxyType(
    {
        (0x046D, 0xC216): "Logitech F310 and Dual Action",
        (0x046D, 0xC218): "Logitech F510",
        (0x046D, 0xC219): "Logitech F710",
        (0x0079, 0x0006): "DragonRise",
    }
)
"""Pads whose buttons are numbered as in ``D_MODE_LAYOUT``, by SDL's game controller database."""


@dataclass(frozen=True, slots=True)
class PadModel:
    """Model of a game pad, and the codes of its ``buttons`` and ``axes``."""

    vendor: int
    product: int
    name: str
    buttons: frozenset[int] = frozenset()
    axes: frozenset[int] = frozenset()

    @property
    def key(self) -> str:
        """Key of the model in the file of taught layouts; a maker's wireless and wired pads have different keys."""
        return f"{self.vendor:04x}:{self.product:04x} {self.name}".strip()

    def has_controls(self, layout: PadLayout) -> bool:
        """Return whether the pad has all controls of a layout."""
        buttons = {each.code for each in (layout.hold, layout.enable, *layout.stops) if each.rest is None}
        axes = {each.code for each in (layout.hold, layout.enable, *layout.stops) if each.rest is not None}
        return buttons <= self.buttons and axes | {layout.ahead.code, layout.left.code} <= self.axes


class UnknownPadError(NotConnected):
    """A pad whose button layout is unknown, so that it must not drive."""


def find_layout(path: str, model: PadModel | None, saved: Mapping[str, PadLayout]) -> PadLayout:
    """Return the layout of the pad at ``path``: the taught one in ``saved``, else that of its model.

    Without a ``model``, return ``UNIDENTIFIED_LAYOUT``. Raises UnknownPadError.
    """
    if model is None:
        return UNIDENTIFIED_LAYOUT
    found = saved.get(model.key)
    if found is not None and model.has_controls(found):
        return found
    # A driver that numbers buttons calls the third and the sixth C and Z, which no pad of two rows has.
    numbered = {C, Z} <= model.buttons
    if found is None and (model.vendor, model.product) in D_MODELS and model.has_controls(D_MODE_LAYOUT):
        return D_MODE_LAYOUT
    if found is None and not numbered and model.has_controls(STANDARD_LAYOUT):
        return STANDARD_LAYOUT
    if found is not None:
        why = "it lacks buttons or sticks of its taught layout"
    elif numbered or TRIGGER in model.buttons:
        why = "its buttons are only numbered (mode D), so the stop button is unknown"
    else:
        why = "it has no left shoulder, east or Start button, or no left stick"
    hint = f"mission teleop --teach-pad {path}  (once); or switch it to mode X, if it has such a switch"
    raise UnknownPadError(f"pad: {path}: {model.key}: {why}", hint=hint)


class PadState:
    """State of a game pad: whether the control ``hold`` of its layout is pressed, and the position of the stick.

    ``ranges`` are the ranges of its axes.
    """

    def __init__(self, layout: PadLayout, ranges: Mapping[int, AxisRange], dead_zone: float) -> None:
        self.layout = layout
        self._ranges, self._dead_zone = dict(ranges), dead_zone
        self._keys = layout.control_keys()
        self._pressed: set[Control] = set()
        self._values: dict[int, int] = {}  # of the axes that have moved
        self.is_held = False  # since it was pressed, without a gap in what is known

    def clear(self) -> None:
        """Release all controls, because events were lost and the state is unknown."""
        self.is_held = False
        self._values.clear()
        self._pressed.clear()

    def on_event(self, event: PadEvent) -> str:
        """Process an event; return the keyboard key with the same effect, or an empty text."""
        found = ""
        if event.kind == ABS:
            self._values[event.code] = event.value
        held = self.layout.hold.is_pressed_after(event, before=self.layout.hold in self._pressed)
        if held is not None:
            if not held:
                self.is_held = False
            elif event.kind == KEY or self.layout.hold not in self._pressed:
                self.is_held = True
            self._set_pressed(self.layout.hold, pressed=held)
        for control, key in self._keys.items():
            before = control in self._pressed
            now = control.is_pressed_after(event, before=before)
            if now and not before:
                found = key
            if now is not None:
                self._set_pressed(control, pressed=now)
        return found

    def deflection(self, stick: Stick) -> float:
        """Return the deflection of a stick ahead or to the left, -1..1."""
        span, value = self._ranges.get(stick.code), self._values.get(stick.code)
        if span is None or value is None:
            return 0.0
        return stick.sign * AxisRange(span.least, span.most, stick.rest).scale(value, self._dead_zone)

    def _set_pressed(self, control: Control, *, pressed: bool) -> None:
        (self._pressed.add if pressed else self._pressed.discard)(control)
