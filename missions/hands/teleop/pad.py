"""A game pad as the kernel shows it, read without any library: push while you hold its left shoulder button."""

import fcntl
import os
from collections.abc import Callable, Mapping
from contextlib import suppress
from math import inf
from pathlib import Path
from types import MappingProxyType

from drivers.clock import Clock
from drivers.errors import NotConnected
from drivers.ports import explain
from missions.hands.teleop import FIRST_PAD, events
from missions.hands.teleop.events import Event, Span
from missions.hands.teleop.keymap import ENABLE, LATCH, Push

DEAD = 0.1
"""The share of a stick's way around its middle that counts as its middle: none springs back exactly."""

SILENCE = 3.0
"""Seconds without a word of the pad after which its hold no longer counts: many receivers do not tell that they have
lost the pad. A hand that drives moves a stick more often than that."""

KEYS: Mapping[int, str] = MappingProxyType({events.EAST: LATCH, events.START: ENABLE})
"""The buttons that do what a key does."""

HATS: Mapping[tuple[int, int], str] = MappingProxyType(
    {
        (events.HAT_X, -1): "left",
        (events.HAT_X, 1): "right",
        (events.HAT_Y, -1): "up",
        (events.HAT_Y, 1): "down",
    }
)
"""The cross, likewise."""

HELP = """\
hold the left shoulder button and push the left stick; let go of the button to stop
the cross turns the head; east (B, circle) stops until Start enables again
the keys of the terminal do the same: space, Enter, and Esc or Ctrl-C to end"""


class Pad:
    """The game pad at ``path``, a node /dev/input/event*, between ``open`` and ``close``. For one thread.

    ``span`` tells what an axis measures, None for one that the pad lacks.
    """

    def __init__(self, path: str, clock: Clock, *, span: Callable[[int, int], Span | None] | None = None) -> None:
        self.path = path
        self._clock = clock
        self._span = span or ask_span
        self._spans: dict[int, Span] = {}
        self._descriptor = -1
        self._values: dict[int, int] = {}  # of the axes that have moved
        self._held = False  # since it was pressed, without a gap in what we know
        self._heard_at = -inf

    def open(self) -> None:
        """Open the node. Raises NotConnected with what to try."""
        try:
            self._descriptor = os.open(self.path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        except OSError as error:
            raise explain("pad", self.path, error) from error
        spans = {axis: self._span(self._descriptor, axis) for axis in (events.STICK_X, events.STICK_Y)}
        self._spans = {axis: span for axis, span in spans.items() if span is not None}

    def close(self) -> None:
        """Close the node. Safe more than once."""
        descriptor, self._descriptor = self._descriptor, -1
        self._held = False
        if descriptor >= 0:
            os.close(descriptor)

    def keys(self) -> list[str]:
        """Take what has come, without waiting; return the keys that it stands for. Raises NotConnected: it has gone."""
        found: list[str] = []
        while news := self._read():
            self._heard_at = self._clock.now()
            found += [key for event in news if (key := self._take(event))]
        return found

    def press(self, key: str, now: float) -> None:
        """Whoever stops or enables the base has to press the shoulder button anew before it drives."""
        del now
        if key in (LATCH, ENABLE):
            self._held = False

    def push(self, now: float) -> Push | None:
        """Return which way the stick is pushed at ``now`` seconds; None unless the shoulder button is held."""
        if now - self._heard_at > SILENCE:
            self._held = False
        if not self._held:
            return None
        return Push(ahead=self._share(events.STICK_Y), left=self._share(events.STICK_X))

    def _share(self, axis: int) -> float:
        """Return how far an axis of the stick is pushed; Linux counts to the back and to the right."""
        span, value = self._spans.get(axis), self._values.get(axis)
        return 0.0 if span is None or value is None else -span.share(value, DEAD)

    def _take(self, event: Event) -> str:
        """Note an event; return the key that it stands for, empty for none."""
        match event.kind, event.code, event.value:
            case events.SYN, events.SYN_DROPPED, _:
                self._held = False  # nobody knows whether it is held, nor where the stick is
                self._values.clear()
            case events.KEY, events.SHOULDER_LEFT, value:
                self._held = value > 0
            case events.KEY, code, 1:
                return KEYS.get(code, "")
            case events.ABS, code, value:
                self._values[code] = value
                return HATS.get((code, value), "")
        return ""

    def _read(self) -> list[Event]:
        try:
            data = os.read(self._descriptor, 4096)
        except BlockingIOError:
            return []
        except OSError as error:
            raise self._gone() from error
        if not data:
            raise self._gone()
        return events.events_of(data)

    def _gone(self) -> NotConnected:
        self._held = False
        return NotConnected(f"pad: {self.path}: it has gone", hint="plug it in, or switch it on, and start again")


def ask_span(descriptor: int, axis: int) -> Span | None:
    """Ask the kernel what an axis measures at its ends; None for one that is not there."""
    with suppress(OSError):
        return events.span_of(fcntl.ioctl(descriptor, events.span_request(axis), bytes(events.ABSINFO_SIZE)))
    return None


def pad_at(node: str, clock: Clock) -> Pad:
    """Return the pad at a node; the first that is there for ``FIRST_PAD``. Raises NotConnected as ``find_pad``."""
    return Pad(find_pad() if node == FIRST_PAD else node, clock)


def find_pad(nodes: Path = Path("/sys/class/input")) -> str:
    """Return the first game pad that is plugged in. Raises NotConnected when there is none."""
    for node in sorted(nodes.glob("event*"), key=lambda found: (len(found.name), found.name)):
        with suppress(OSError, ValueError):
            if events.is_gamepad((node / "device" / "capabilities" / "key").read_text(encoding="ascii")):
                return f"/dev/input/{node.name}"
    raise NotConnected("pad: no game pad is plugged in", hint="ls /dev/input  (and name it: --pad /dev/input/eventN)")
