"""Putting the head straight by hand: arrow keys turn it, and what was turned is its trim."""

from collections.abc import Callable
from math import degrees, radians

from drivers.errors import BadRequest
from drivers.pantilt import Trimmable
from missions.cli.keys import Keys

STEPS = (0.5, 1.0, 2.0, 5.0)
"""Degrees by which an arrow turns the head; the sketch takes whole ones."""

HELP = "The arrows turn the head, + and - change the step, 0 is no trim.\nEnter keeps the trims, q puts them back."

_TURNS = {"left": (1, 0), "right": (-1, 0), "up": (0, -1), "down": (0, 1)}


def trim_by_hand(
    head: Trimmable,
    keys: Keys,
    signs: tuple[int, int],
    show: Callable[[str], None],
    trouble: Callable[[], str],
) -> bool:
    """Let a person trim the head until they are content; return False, with the trims as before, if they are not.

    ``signs`` are -1 for an axis whose motor turns the other way than the head. ``show`` is given the line to be seen,
    ``trouble`` says why the head does not move at present. Whatever ends it but the enter key puts the trims back.
    """
    before, step, content = head.trim(), 1, False
    try:
        while not content:
            pan, tilt = (degrees(trim) for trim in head.trim())
            show(f"trim: pan {pan:+.1f} deg, tilt {tilt:+.1f} deg, step {STEPS[step]:g}  {trouble()}")
            match keys.read(0.2):
                case "left" | "right" | "up" | "down" as key:
                    _turn(head, _TURNS[key], signs, radians(STEPS[step]))
                case "+" | "=":
                    step = min(step + 1, len(STEPS) - 1)
                case "-":
                    step = max(step - 1, 0)
                case "0":
                    head.trim(pan=0.0, tilt=0.0)
                case "enter":
                    content = True
                case "q" | "escape" | "end":
                    break
                case _:
                    pass
    finally:
        if not content:
            head.trim(pan=before[0], tilt=before[1])
    return content


def _turn(head: Trimmable, turn: tuple[int, int], signs: tuple[int, int], step: float) -> None:
    """Turn the head itself, whichever way its motors have to turn for that; not beyond what a trim may be."""
    pan, tilt = (trim + way * sign * step for trim, way, sign in zip(head.trim(), turn, signs, strict=True))
    try:
        head.trim(pan=pan, tilt=tilt)
    except BadRequest:
        return  # as far as it goes
