"""Taking the wheels: what hands push is passed on to the pilot, again and again, until somebody ends it."""

from collections.abc import Callable

from drivers.clock import Clock
from missions.hands.teleop.keymap import AGAIN, ENDS, STOP, Held
from missions.hands.teleop.line_delay import LineDelay
from missions.hands.teleop.pad import Pad
from missions.hands.teleop.pilot import GAZES, LATCH, Pilot

TICK = 0.05
"""Seconds between two commands: a command that lives for 0.3 s may miss five."""


def drive_by_hand(
    pilot: Pilot,
    typed: Callable[[float], str],
    pad: Pad | None,
    clock: Clock,
    show: Callable[[str], None],
    line: LineDelay | None = None,
) -> None:
    """Let a person drive with the keys that ``typed`` gives out, or with a ``pad`` that is open, until a key ends it.

    ``typed`` waits for so many seconds at most, and returns the empty text where none came; ``show`` is given a line
    to be seen. Keys that waited because all this was held up (SIGSTOP, a line that is stuck) drive nothing any more.
    Keys that come over a slow ``line`` neither drive nor turn the head; then all is to be let go once.
    Whatever ends it, the wheels are let go. Raises NotConnected when the pad has gone.
    """
    hand = Held() if pad is None else pad
    before, late, refused = clock.now(), False, False
    try:
        while True:
            key, now = typed(TICK), clock.now()
            if now - before > AGAIN:
                key = _left_of(key, typed)
            if key in ENDS:
                return
            before = now
            if line is not None and pad is None:
                late = line.late or (late and hand.push(now) is not None)
                refused = late or bool(line.refusal)
            for each in (key, *(() if pad is None else pad.keys())):
                if each:
                    hand.press(each, now)
                    if not (refused and each in GAZES):
                        pilot.press(each)
            pilot.steer(None if refused else hand.push(now))
            told = [pilot.words()]
            if line is not None:
                line.ask()
                told = ["let go of all keys" if refused and not line.refusal else line.words(), *told]
            show(" | ".join(filter(None, told)))
    finally:
        pilot.steer(None)


def _left_of(key: str, typed: Callable[[float], str]) -> str:
    """Take the keys that have waited, ``key`` and those behind it; return the one that ends or latches, else STOP."""
    found = STOP
    while key and key not in ENDS:
        found = LATCH if LATCH in (key, found) else STOP
        key = typed(0.0)
    return key or found
