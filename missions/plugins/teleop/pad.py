"""Game pad, read through the Linux input interface; it drives while its left shoulder button is held."""

import fcntl
import json
import os
from collections.abc import Callable, Mapping
from contextlib import suppress
from math import inf
from pathlib import Path
from stat import S_ISCHR
from types import MappingProxyType
from typing import Any

from config.defaults import config_folder
from config.file_io import PRIVATE_MODE, read_regular_text, save_file
from drivers.clock import Clock
from drivers.errors import NotConnected
from drivers.transport.ports import make_port_error
from missions.control.pilot import ENABLE_KEY, LATCH_KEY, DriveInput
from missions.plugins.teleop import FIRST_PAD
from missions.plugins.teleop import layout as events
from missions.plugins.teleop.layout import (
    UNIDENTIFIED_LAYOUT,
    AxisRange,
    Control,
    PadEvent,
    PadLayout,
    PadModel,
    PadState,
    Stick,
    UnknownPadError,
    find_layout,
)

# The layouts of game pads that were taught: one file of the user's, ``~/.config/missiontree/pads.json``.

PADS_FILE_NAME = "pads.json"
MAX_CODE, MAX_VALUE = 0x2FF, 2**31
TEACH_HINT = "mission teleop --teach-pad  (again; it replaces this file's entry)"


def pads_file() -> Path:
    """Return the path of the file that stores the taught button layouts of game pads."""
    return config_folder() / PADS_FILE_NAME


def load_layouts(path: Path | None = None) -> dict[str, PadLayout]:
    """Return the taught layouts by ``PadModel.key``; none without the file.

    Raises NotConnected for a damaged file: a pad with half a layout must not drive.
    """
    path = pads_file() if path is None else path
    try:
        found = json.loads(read_regular_text(path))
        layouts = {str(key): _layout_from_json(data) for key, data in found.items()}
        for key, layout in layouts.items():
            for fault in layout.find_errors():
                raise ValueError(f"{key}: {fault}")
    except FileNotFoundError:
        return {}
    except (OSError, ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
        raise NotConnected(f"pad: {path}: cannot be used: {error}", hint=f"rm {path}; then {TEACH_HINT}") from error
    return layouts


def save_layout(key: str, layout: PadLayout, path: Path | None = None) -> Path:
    """Save a layout, replacing an earlier one of this pad; return the file. Raises OSError, NotConnected."""
    path = pads_file() if path is None else path
    layouts = {**load_layouts(path), key: layout}
    path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    text = json.dumps({name: _layout_to_json(each) for name, each in layouts.items()}, indent=2) + "\n"
    save_file(path, text, PRIVATE_MODE)
    return path


def _layout_to_json(layout: PadLayout) -> dict[str, object]:
    return {
        "hold": _control_to_json(layout.hold),
        "stops": [_control_to_json(each) for each in layout.stops],
        "enable": _control_to_json(layout.enable),
        "ahead": {"axis": layout.ahead.code, "sign": layout.ahead.sign, "rest": layout.ahead.rest},
        "left": {"axis": layout.left.code, "sign": layout.left.sign, "rest": layout.left.rest},
    }


def _control_to_json(control: Control) -> dict[str, object]:
    if control.rest is None:
        return {"button": control.code}
    return {"axis": control.code, "rest": control.rest, "end": control.end}


def _layout_from_json(data: Mapping[str, Any]) -> PadLayout:
    stops = tuple(_control_from_json(each) for each in data["stops"])
    return PadLayout(
        _control_from_json(data["hold"]),
        stops,
        _control_from_json(data["enable"]),
        _stick_from_json(data["ahead"]),
        _stick_from_json(data["left"]),
    )


def _control_from_json(data: Mapping[str, Any]) -> Control:
    if "button" in data:
        return Control(_check_int(data["button"], 0, MAX_CODE))
    rest, end = (_check_int(data[word], -MAX_VALUE, MAX_VALUE) for word in ("rest", "end"))
    return Control(_check_int(data["axis"], 0, MAX_CODE), rest, end)


def _stick_from_json(data: Mapping[str, Any]) -> Stick:
    sign = _check_int(data["sign"], -1, 1)
    if sign == 0:
        raise ValueError("the sign of a stick is 0")
    rest = None if data["rest"] is None else _check_int(data["rest"], -MAX_VALUE, MAX_VALUE)
    return Stick(_check_int(data["axis"], 0, MAX_CODE), sign, rest)


def _check_int(value: object, low: int, high: int) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
        raise ValueError(f"{value!r:.40} is not a whole number from {low} to {high}")
    return value


DEAD_ZONE = 0.1
"""Share of a stick's travel around its middle that counts as the middle, because sticks do not return exactly."""

SILENCE_TIMEOUT = 3.0
"""Seconds without events after which the hold button counts as released.

Many receivers do not report that they have lost the pad. A driving hand moves a stick more often than that.
"""

HAT_KEYS: Mapping[tuple[int, int], str] = MappingProxyType(
    {
        (events.HAT_X, -1): "left",
        (events.HAT_X, 1): "right",
        (events.HAT_Y, -1): "up",
        (events.HAT_Y, 1): "down",
    }
)
"""Keyboard keys with the same effect as the directions of the hat, by axis and value."""

PAD_HELP = """\
hold the left shoulder button and push the left stick; let go of the button to stop
the cross turns the head; east (B, circle) stops until Start enables again; in mode D, A stops, too
the keys of the terminal do the same: space, Enter, and Esc or Ctrl-C to end"""


class Pad:
    """The game pad at ``path``, a node /dev/input/event*, between ``open`` and ``close``. For one thread.

    ``read_range`` returns the range of an axis, or None; ``read_model`` the model, or None if the kernel does not know
    it; ``load_saved`` the taught layouts.
    """

    def __init__(
        self,
        path: str,
        clock: Clock,
        *,
        read_range: Callable[[int, int], AxisRange | None] | None = None,
        read_model: Callable[[int], PadModel | None] | None = None,
        load_saved: Callable[[], Mapping[str, PadLayout]] = load_layouts,
    ) -> None:
        self.path = path
        self._clock = clock
        self._read_range, self._read_model, self._load_saved = (
            read_range or read_axis_range,
            read_model or read_pad_model,
            load_saved,
        )
        self._descriptor = -1
        self._state = PadState(UNIDENTIFIED_LAYOUT, {}, DEAD_ZONE)
        self._last_event_at = -inf

    def open(self) -> None:
        """Open the node. Raises NotConnected with a hint, also for a pad with an unknown layout."""
        model = self.identify()
        try:
            layout = find_layout(self.path, model, self._load_saved())
        except NotConnected:
            self.close()
            raise
        spans = {axis.code: self._read_range(self._descriptor, axis.code) for axis in (layout.ahead, layout.left)}
        self._state = PadState(layout, {code: span for code, span in spans.items() if span is not None}, DEAD_ZONE)

    def identify(self) -> PadModel | None:
        """Open the node only, and return the model of the pad. Raises NotConnected with a hint."""
        try:
            self._descriptor = os.open(self.path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        except OSError as error:
            raise make_port_error("pad", self.path, error) from error
        model = self._read_model(self._descriptor)
        if model is None and S_ISCHR(os.fstat(self._descriptor).st_mode):  # js0 speaks another protocol
            self.close()
            raise UnknownPadError(
                f"pad: {self.path}: not the event node of a game pad",
                hint="ls -l /dev/input/by-id  (and name the one that ends in -event-joystick)",
            )
        return model

    def read_axes(self, model: PadModel) -> tuple[dict[int, AxisRange], dict[int, int]]:
        """Return the ranges of the axes of an identified pad, and their current values."""
        infos = {code: absinfo for code in model.axes if (absinfo := read_absinfo(self._descriptor, code))}
        return (
            {code: events.parse_range(absinfo) for code, absinfo in infos.items()},
            {code: events.parse_value(absinfo) for code, absinfo in infos.items()},
        )

    def close(self) -> None:
        """Close the device node of the pad. Safe more than once."""
        descriptor, self._descriptor = self._descriptor, -1
        self._state.is_held = False
        if descriptor >= 0:
            os.close(descriptor)

    def read_keys(self) -> list[str]:
        """Return the keyboard keys with the same effect as the events so far, without waiting.

        Raises NotConnected if the pad has disconnected.
        """
        found: list[str] = []
        while news := self.read_events():
            self._last_event_at = self._clock.now()
            found += [key for event in news if (key := self._handle_event(event))]
        return found

    def read_events(self) -> list[PadEvent]:
        """Return the events so far, without waiting. Raises NotConnected if the pad has disconnected."""
        try:
            data = os.read(self._descriptor, 4096)
        except BlockingIOError:
            return []
        except OSError as error:
            raise self._disconnect() from error
        if not data:
            raise self._disconnect()
        return events.parse_events(data)

    def press(self, key: str, now: float) -> None:
        """Handle a key: after one that latches or enables the base, the hold button must be pressed again."""
        del now
        if key in (LATCH_KEY, ENABLE_KEY):
            self._state.is_held = False

    def push(self, now: float) -> DriveInput | None:
        """Return the drive input of the stick at ``now`` seconds; None unless the hold button is held."""
        if now - self._last_event_at > SILENCE_TIMEOUT:
            self._state.is_held = False
        if not self._state.is_held:
            return None
        layout = self._state.layout
        return DriveInput(ahead=self._state.deflection(layout.ahead), left=self._state.deflection(layout.left))

    def _handle_event(self, event: PadEvent) -> str:
        """Process an event; return the keyboard key with the same effect, or an empty text."""
        if (event.kind, event.code) == (events.SYN, events.SYN_DROPPED):
            self._state.clear()
            return ""
        key = self._state.on_event(event)
        drives = event.code in (self._state.layout.ahead.code, self._state.layout.left.code)
        if key or drives or event.kind != events.ABS:
            return key
        return HAT_KEYS.get((event.code, event.value), "")

    def _disconnect(self) -> NotConnected:
        self._state.is_held = False
        return NotConnected(f"pad: {self.path}: disconnected", hint="plug it in, or switch it on, and start again")


def read_axis_range(descriptor: int, axis: int) -> AxisRange | None:
    """Read the range of an axis from the kernel; None if there is no such axis."""
    absinfo = read_absinfo(descriptor, axis)
    return events.parse_range(absinfo) if absinfo else None


def read_absinfo(descriptor: int, axis: int) -> bytes:
    """Read the ``struct input_absinfo`` of an axis from the kernel; empty if there is no such axis."""
    with suppress(OSError):
        return fcntl.ioctl(descriptor, events.range_request(axis), bytes(events.ABSINFO_SIZE))
    return b""


def make_pad(node: str, clock: Clock) -> Pad:
    """Return the game pad at the device file ``node``; for ``FIRST_PAD``, the first pad that is plugged in.

    Raises NotConnected for ``FIRST_PAD`` if no pad is plugged in.
    """
    return Pad(find_pad() if node == FIRST_PAD else node, clock)


def read_pad_model(descriptor: int) -> PadModel | None:
    """Read the model of a pad from the kernel; None if the kernel does not know the model."""
    try:
        vendor, product = events.parse_ids(fcntl.ioctl(descriptor, events.ID_REQUEST, bytes(8)))
        name = fcntl.ioctl(descriptor, events.name_request(256), bytes(256)).split(b"\0")[0].decode(errors="replace")
        buttons, axes = (
            events.parse_codes(fcntl.ioctl(descriptor, events.bits_request(kind, size), bytes(size)))
            for kind, size in ((events.KEY, 96), (events.ABS, 8))
        )
    except OSError:
        return None
    return PadModel(vendor, product, name, buttons, axes)


def find_pads(nodes: Path = Path("/sys/class/input")) -> list[str]:
    """Return the paths of the game pads that are plugged in: those with named buttons first, then all others."""
    found: tuple[list[str], list[str]] = [], []
    for node in sorted(nodes.glob("event*"), key=lambda found: (len(found.name), found.name)):
        with suppress(OSError, ValueError):
            capabilities = (node / "device" / "capabilities" / "key").read_text(encoding="ascii")
            for place, button in enumerate((events.SOUTH, events.TRIGGER)):
                if events.has_button(capabilities, button):
                    found[place].append(f"/dev/input/{node.name}")
                    break
    return [*found[0], *found[1]]


def find_pad(nodes: Path = Path("/sys/class/input")) -> str:
    """Return the path of the first game pad that is plugged in. Raises NotConnected if there is none."""
    if found := find_pads(nodes):
        return found[0]
    raise NotConnected("pad: no game pad is plugged in", hint="ls /dev/input  (and name it: --pad /dev/input/eventN)")
