"""What each key means: the keys of ROS's teleop_twist_keyboard, the arrows for the head. Pure; the time is handed in.

A terminal tells of keys that go down and of their auto-repeat, and never of one that is let go. So a key is held for as
long as it keeps coming.
"""

from collections.abc import Mapping
from math import inf
from types import MappingProxyType

from missions.control.pilot import GAZES, PACES, Push

FIRST = 0.75
"""Seconds that a key counts as held when it was pressed: auto-repeat begins after up to 0.66 s (the X server's)."""

AGAIN = 0.3
"""Seconds that it counts as held once it repeats: some keyboards do so only ten times a second, and lines stutter."""

REPEAT = 0.2
"""Seconds within which a key that comes again repeats by itself; nobody types the same key so fast for long."""


MOVES: Mapping[str, Push] = MappingProxyType(
    {
        "u": Push(1, 1), "i": Push(1, 0), "o": Push(1, -1),
        "j": Push(0, 1), "l": Push(0, -1),
        "m": Push(-1, -1), ",": Push(-1, 0), ".": Push(-1, 1),
    }
)  # fmt: skip
"""The keys that drive; back to the left turns the base to the right, as ROS has it."""

STOP = "k"
ENDS = frozenset({"escape", "end"})

HELP = """\
u i o    drive: hold a key, and let go to stop     q z  faster, slower
j k l    k and every other key stop at once        w x  that ahead alone
m , .    the arrows turn the head                  e c  that of turning alone
space stops until Enter enables again; Esc or Ctrl-C ends"""


class Held:
    """The keys of a terminal that a person holds. It begins with no key."""

    def __init__(self) -> None:
        self._key = ""
        self._pressed = self._until = -inf

    def press(self, key: str, now: float) -> None:
        """Take a key that came at ``now`` seconds. One that neither drives, nor changes speed or gaze, stops."""
        if key in PACES or key in GAZES:
            return
        repeats = key == self._key and now - self._pressed <= REPEAT
        self._key, self._pressed = key, now
        self._until = now + (AGAIN if repeats else FIRST)

    def push(self, now: float) -> Push | None:
        """Return which way at ``now`` seconds; None when no key that drives is held."""
        return MOVES.get(self._key) if now <= self._until else None
