"""Teleop of the wheels by clients: one driver at a time, with a dead-man timeout on the age of each command."""

from collections import OrderedDict
from collections.abc import Callable
from enum import Enum
from math import inf, radians
from secrets import randbits
from typing import Final

from drivers.api import Base, Head
from drivers.clock import Clock
from missions.control.commands import BadMessage, DriveCommand, LookCommand
from missions.control.pilot import MAX_STATE_AGE, DriveInput, Pilot

# Stamps of the states that a run sends: they give the age of the state behind a drive command.

STAMP_BITS = 53
"""Number of random bits in the stamp of a state message; JavaScript has no larger exact integers."""

STAMP_LIFETIME = 10.0
"""Seconds after which the stamp of a state message is forgotten, so that a command with it is refused."""

MAX_KEPT_STAMPS = 1024


class StateStamps:
    """Random stamps of state messages, and the times at which they were sent. Not thread-safe.

    A client returns the stamp of the newest state with each command, which shows how old that state is. Stamps are
    random, not counted, so a client cannot guess one that it has not received. Clocks of clients are not used.
    """

    def __init__(self, clock: Clock, draw: Callable[[], int] = lambda: randbits(STAMP_BITS)) -> None:
        self._clock, self._draw = clock, draw
        self._issued: OrderedDict[int, float] = OrderedDict()

    def issue(self) -> int:
        """Return a new random stamp for a state message that is sent now."""
        now = self._clock.now()
        while self._issued and (len(self._issued) >= MAX_KEPT_STAMPS or now - self._oldest > STAMP_LIFETIME):
            self._issued.popitem(last=False)
        stamp = self._draw()
        while stamp in self._issued:
            stamp = self._draw()
        self._issued[stamp] = now
        return stamp

    def issued_at(self, stamp: int) -> float | None:
        """Return the time (s, clock of this run) at which the state with ``stamp`` was sent.

        None if the stamp is unknown or expired.
        """
        return self._issued.get(stamp)

    @property
    def _oldest(self) -> float:
        return next(iter(self._issued.values()))


HEAD_SPEED = radians(60)
"""Turn rate of the head at full input, in rad/s."""

RELEASE_HINT = "mission stop --release --resume, or “Hold to release” on the page"
"""Hint how to release a stop, in the error for a command that is refused while a stop is latched."""

MAX_TURN_TIME = 0.1
"""Maximum seconds that one command turns the head."""


class WheelState(Enum):
    """State of the base under manual control.

    STOPPED: the base was stopped, and its driver must send zero before it moves again.
    """

    STILL, MOVING, STOPPED = range(3)


class WheelEvent(Enum):
    """Event of manual control: PUSH is a command to move, LET_GO a zero command or a new driver, STOP any stop."""

    PUSH, LET_GO, STOP = range(3)


TRANSITIONS: Final = {
    **{(state, WheelEvent.LET_GO): WheelState.STILL for state in WheelState},
    **{(state, WheelEvent.STOP): WheelState.STOPPED for state in WheelState},
    (WheelState.STILL, WheelEvent.PUSH): WheelState.MOVING,
    (WheelState.MOVING, WheelEvent.PUSH): WheelState.MOVING,
    (WheelState.STOPPED, WheelEvent.PUSH): WheelState.STOPPED,
}


class WheelArbiter:
    """Gives control of base and head to one client at a time, and forwards its commands. Not thread-safe.

    A ``client`` is any hashable key. Raises BadMessage with the name of the error for refused commands.
    """

    def __init__(self, base: Base | None, head: Head | None, clock: Clock) -> None:
        self._base, self._has_head = base, head is not None
        self._pilot = None if base is None else Pilot(base, head)
        self._clock = clock
        self._driver: object | None = None
        self._names: dict[object, str] = {}  # names of the driver and of the requesting clients, in order
        self._stamps = StateStamps(clock)
        self._number = -1
        self._state_at = -inf  # time at which the newest state that the driver has seen was issued
        self._looked_at = -inf
        self._state = WheelState.STILL
        self.round_trip = 0.0
        """Age in seconds of the state message on which the driver's last command is based; 0 without a command."""

    @property
    def ends_at(self) -> float:
        """Time (s) at which the base must stop unless a command with a newer state arrives; inf while it stands."""
        return self._state_at + MAX_STATE_AGE if self._state is WheelState.MOVING else inf

    def stamp(self) -> int:
        """Return a new random stamp for a state message that is sent now; commands of clients refer to it."""
        return self._stamps.issue()

    def check(self, now: float) -> None:
        """Stop the base at time ``now`` if the state message behind the driver's last command is too old."""
        if now >= self.ends_at:
            self._stop_base()

    @property
    def driver(self) -> str:
        """Name of the client that has control of the wheels; empty if no client has it."""
        return "" if self._driver is None else self._names[self._driver]

    @property
    def waiting_names(self) -> list[str]:
        """Names of the clients that request the wheels, in order."""
        return [name for key, name in self._names.items() if key is not self._driver]

    def is_participant(self, client: object) -> bool:
        """Return True if a client has control of the wheels, or waits for it."""
        return client in self._names

    def take(self, client: object, name: str) -> bool:
        """Give the wheels to a client, or queue its request; return whether it has them."""
        if self._pilot is None:
            raise BadMessage("no_base", "this run has no base to drive")
        self._names[client] = name
        if self._driver is None or self._driver is client:
            self._stop_base()
            self._hand_to(client)  # also if it drives already: its command numbers may restart at 0
        return self._driver is client

    def give(self, client: object) -> None:
        """Remove a client; if it was driving, the base stops at once and the next client gets the wheels."""
        self._names.pop(client, None)
        if self._driver is client:
            self._stop_base()
            self._hand_to(next(iter(self._names), None))

    def drive(self, client: object, command: DriveCommand) -> None:
        """Drive for 0.3 s (``drivers.api.steering.COMMAND_TIMEOUT``), at most until ``ends_at``. Raises BadMessage."""
        pilot, base, _ = self._require_control(client, command)
        still = command.ahead == 0 and command.left == 0
        self._handle(WheelEvent.LET_GO if still else WheelEvent.PUSH)
        if self._state is WheelState.STOPPED:
            pilot.steer(None)
            raise _let_go_error()
        if base.latched:
            raise BadMessage("stopped", base.latched, RELEASE_HINT)
        pilot.ahead = pilot.turn = command.pace
        pilot.steer(None if still else DriveInput(float(command.ahead), float(command.left)))
        if pilot.trouble:
            raise BadMessage("device", pilot.trouble)

    def look(self, client: object, command: LookCommand) -> None:
        """Turn the head as far as it turns in the time since the last such command, at most ``MAX_TURN_TIME``.

        Raises BadMessage.
        """
        pilot, _, now = self._require_control(client, command)
        if not self._has_head:
            raise BadMessage("no_base", "this run has no head to turn")
        if self._state is WheelState.STOPPED and (command.left or command.down):
            raise _let_go_error()
        seconds = min(now - self._looked_at, MAX_TURN_TIME)
        self._looked_at = now
        pilot.look(command.left * HEAD_SPEED * seconds, command.down * HEAD_SPEED * seconds)
        if pilot.trouble:
            raise BadMessage("device", pilot.trouble)

    def stop(self) -> None:
        """Stop the base after a latched stop; the driver must send zero before the base moves again."""
        self._stop_base()

    def _require_control(self, client: object, command: DriveCommand | LookCommand) -> tuple[Pilot, Base, float]:
        """Return pilot, base and time if ``client`` may execute ``command``. Raises BadMessage if not.

        A command that is out of order, or based on an old state, also stops the base.
        """
        now = self._clock.now()
        if self._pilot is None or self._base is None:
            raise BadMessage("no_base", "this run has no base to drive")
        if self._driver is not client:
            who = f"{self.driver} drives" if self._driver is not None else "no client has the wheels"
            raise BadMessage("no_wheels", who, "take")
        self.check(now)
        number, self._number = self._number, max(self._number, command.n)
        if command.n <= number:
            self._pilot.steer(None)
            raise BadMessage("out_of_order", f"number {command.n} is not above {number}: the base stops")
        self._check_state(command.stamp, now)
        return self._pilot, self._base, now

    def _check_state(self, stamp: int, now: float) -> None:
        """Raise BadMessage and stop the base if the state with ``stamp`` is too old.

        Also if it is older than the state of the last command.
        """
        issued = self._stamps.issued_at(stamp)
        if issued is not None:
            self.round_trip = now - issued
        if issued is None or now - issued >= MAX_STATE_AGE:
            self._stop_base()
            age = (
                f"over {STAMP_LIFETIME:g} s old, or not of this run" if issued is None else f"{now - issued:.1f} s old"
            )
            more = f"the state behind the command is {age}: the base stops ({MAX_STATE_AGE:g} s at most)"
            raise BadMessage("stale", more, "release the input, and drive when the connection is faster")
        if issued < self._state_at:
            self._stop_base()
            raise BadMessage("out_of_order", "its state is older than that of the last command: the base stops")
        self._state_at = issued

    def _stop_base(self) -> None:
        if self._pilot is not None:
            self._pilot.steer(None)
        self._handle(WheelEvent.STOP)

    def _hand_to(self, client: object | None) -> None:
        self._driver = client
        self._number, self._state_at = -1, -inf
        self._handle(WheelEvent.LET_GO)
        self.round_trip = 0.0

    def _handle(self, event: WheelEvent) -> None:
        self._state = TRANSITIONS.get((self._state, event), WheelState.STOPPED)


def _let_go_error() -> BadMessage:
    return BadMessage(
        "let_go", "the base has stopped, as commands or states were late", "release the input, then drive again"
    )
