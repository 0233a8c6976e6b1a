"""Who of those that are connected to a run drives it, and which of their commands still count."""

from math import inf, radians

from drivers.api import COMMAND_LIFE, Base, Head
from drivers.clock import Clock
from missions.hands.teleop.keymap import Push
from missions.hands.teleop.pilot import Pilot
from missions.studio.commands import Drive, Look
from missions.studio.form import BadMessage

LATE = COMMAND_LIFE
"""Seconds that a command may be longer on its way than the quickest one of its driver."""

ANEW = 1.0
"""Seconds without a command after which a driver has to let go, before the base obeys again: the link was lost."""

HEAD_SPEED = radians(60)
"""How fast the head turns with the stick pushed all the way, in rad/s."""

LONGEST_TURN = 0.1
"""Seconds that a command turns the head for at most."""


class Wheels:
    """Gives the wheels of a run to one driver at a time, and passes on what that one commands. For one thread.

    Drivers are known by any key. Raises BadMessage, with the name of the mistake, for what does not count.
    """

    def __init__(self, base: Base | None, head: Head | None, clock: Clock) -> None:
        self._base, self._has_head = base, head is not None
        self._pilot = None if base is None else Pilot(base, head)
        self._clock = clock
        self._driver: object | None = None
        self._names: dict[object, str] = {}  # of the driver, and of those who ask, in their order
        self._number = -1
        self._quickest = inf  # the least difference of its clock and ours, of all its commands
        self._came = -inf
        self._looked = -inf
        self._lost = self._moving = False

    @property
    def driver(self) -> str:
        """The name of who drives; empty for nobody."""
        return "" if self._driver is None else self._names[self._driver]

    @property
    def asking(self) -> list[str]:
        """The names of those who ask for the wheels, in their order."""
        return [name for key, name in self._names.items() if key is not self._driver]

    def knows(self, key: object) -> bool:
        """Say whether one drives, or asks for the wheels."""
        return key in self._names

    def take(self, key: object, name: str) -> bool:
        """Give the wheels to who asks, or note that they are asked for; say whether they are given."""
        if self._pilot is None:
            raise BadMessage("no_base", "this run has no base to drive")
        self._names[key] = name
        if self._driver is None or self._driver is key:
            self._hand_to(key)  # to the same one anew: its clock may have stood still
        return self._driver is key

    def give(self, key: object) -> None:
        """Take the wheels from who has had enough, or has gone: the base stops at once, and the next one has them."""
        self._names.pop(key, None)
        if self._driver is key:
            self._let_go()
            self._hand_to(next(iter(self._names), None))

    def drive(self, key: object, command: Drive) -> None:
        """Drive as commanded, for ``COMMAND_LIFE``."""
        pilot, base, now = self._owned(key, command)
        still = command.ahead == 0 and command.left == 0
        self._lost = not still and (self._lost or (self._moving and now - self._came > ANEW))
        self._came, self._moving = now, not still
        if self._lost:
            pilot.steer(None)
            raise BadMessage("late", "the link was lost for a while: let go, and begin anew")
        if base.latched:
            raise BadMessage("stopped", base.latched, "release it first")
        pilot.ahead = pilot.turn = command.pace
        pilot.steer(None if still else Push(float(command.ahead), float(command.left)))
        if pilot.trouble:
            raise BadMessage("device", pilot.trouble)

    def look(self, key: object, command: Look) -> None:
        """Turn the head on, as far as a command may."""
        pilot, _, now = self._owned(key, command)
        if not self._has_head:
            raise BadMessage("no_base", "this run has no head to turn")
        seconds = min(now - self._looked, LONGEST_TURN)
        self._looked = now
        pilot.look(command.left * HEAD_SPEED * seconds, command.down * HEAD_SPEED * seconds)
        if pilot.trouble:
            raise BadMessage("device", pilot.trouble)

    def stop(self) -> None:
        """A stop was latched: nothing of before is in force."""
        self._let_go()

    def _owned(self, key: object, command: Drive | Look) -> tuple[Pilot, Base, float]:
        """Return with what and when to do a command, if it counts; at one late or out of order the base stops."""
        now = self._clock.now()
        if self._pilot is None or self._base is None:
            raise BadMessage("no_base", "this run has no base to drive")
        if self._driver is not key:
            who = f"{self.driver} drives" if self._driver is not None else "nobody has taken the wheels"
            raise BadMessage("no_wheels", who, "take")
        number, self._number = self._number, max(self._number, command.n)
        if command.n <= number:
            self._pilot.steer(None)
            raise BadMessage("out_of_order", f"number {command.n} comes after {number}: the base stops")
        way = now - command.t
        self._quickest = min(self._quickest, way)
        if way - self._quickest > LATE:
            self._pilot.steer(None)
            more = f"{way - self._quickest:.1f} s longer on its way than others: the base stops"
            raise BadMessage("late", more, "take the wheels anew, where that stays so")
        return self._pilot, self._base, now

    def _let_go(self) -> None:
        if self._pilot is not None:
            self._pilot.steer(None)
        self._lost = True

    def _hand_to(self, key: object | None) -> None:
        self._driver = key
        self._number, self._quickest, self._came = -1, inf, self._clock.now()
        self._lost = self._moving = False
