"""Manual control of a robot: inputs become commands to base and head."""

from collections.abc import Mapping
from math import degrees, radians
from types import MappingProxyType

from drivers.api import ZERO_VELOCITY, Base, Head, HeadPose, Source, Velocity
from drivers.api.fast_dataclass import dataclass
from drivers.errors import DriverError, NotConnected

DEFAULT_SPEED_SHARE = 0.5
MIN_SHARE, MAX_SHARE = 0.05, 1.0
"""Range of the speed that a person can choose, as shares of the base's limits."""

HEAD_STEP = radians(3)
"""Angle in radians by which an arrow key turns the head."""

MAX_STATE_AGE = 0.5
"""Maximum age in seconds of the state message on which a client's drive command is based.

It includes the way to the client and back, and the time until the next command.
"""

RECONNECTED_HINT = "it was disconnected: release the input, then start again"
LATCH_REASON = "stopped by hand: Enter enables"


@dataclass(frozen=True, slots=True)
class DriveInput:
    """Direction of a manual drive, forward and to the left, each -1..1 as a share of the chosen speed."""

    ahead: float
    left: float


SPEED_KEYS: Mapping[str, tuple[float, float]] = MappingProxyType(
    {"q": (1.1, 1.1), "z": (0.9, 0.9), "w": (1.1, 1.0), "x": (0.9, 1.0), "e": (1.0, 1.1), "c": (1.0, 0.9)}
)
"""Keys that change the speed, with the factors of forward speed and turn rate."""

HEAD_KEYS: Mapping[str, tuple[int, int]] = MappingProxyType(
    {"left": (1, 0), "right": (-1, 0), "up": (0, -1), "down": (0, 1)}
)
"""Keys that turn the head, with the steps of pan and tilt."""

LATCH_KEY, ENABLE_KEY = " ", "enter"


class Pilot:
    """Commands a base as ``Source.TELEOP``, and a head if there is one. Not thread-safe.

    ``ahead`` and ``turn`` are the chosen shares of the base's limits.
    """

    def __init__(self, base: Base, head: Head | None = None, *, speed_share: float = DEFAULT_SPEED_SHARE) -> None:
        self._base = base
        self._head = head
        self._goal: HeadPose | None = None
        self._is_driving = False
        self._reconnected_at: float | None = None  # time at which the base last reconnected
        self._is_stale = False  # the current drive command began before the reconnect
        self._trouble = ""
        self.ahead = self.turn = min(max(speed_share, MIN_SHARE), MAX_SHARE)

    def press(self, key: str) -> None:
        """Execute a key: change the speed, turn the head, latch or enable the base. Drive keys are not handled."""
        if key in SPEED_KEYS:
            ahead, turn = SPEED_KEYS[key]
            self.ahead = min(max(self.ahead * ahead, MIN_SHARE), MAX_SHARE)
            self.turn = min(max(self.turn * turn, MIN_SHARE), MAX_SHARE)
        elif key in HEAD_KEYS:
            pan, tilt = HEAD_KEYS[key]
            self.look(pan * HEAD_STEP, tilt * HEAD_STEP)
        elif key == LATCH_KEY:
            self._base.latch(LATCH_REASON)
        elif key == ENABLE_KEY:
            self._base.enable()

    def steer(self, drive_input: DriveInput | None) -> None:
        """Drive by ``drive_input`` until the next call, which must come within 0.3 s.

        After this time (``drivers.api.steering.COMMAND_TIMEOUT``) the base stops by itself. None stops the base and
        ends manual control: the base stands until this command has expired, then the mission controls it again. If the
        base reconnects while a key is held, the input is ignored until None is passed once.
        """
        before, self._reconnected_at = self._reconnected_at, self._base.health().reconnected_at
        self._is_stale = drive_input is not None and (self._is_stale or self._reconnected_at != before)
        if self._is_stale:
            drive_input = None
        if drive_input is None and not self._is_driving:
            return
        limits = self._base.limits
        velocity = ZERO_VELOCITY
        if drive_input is None:
            self._base.stop(source=Source.TELEOP)
        else:
            velocity = Velocity(
                drive_input.ahead * self.ahead * limits.speed, drive_input.left * self.turn * limits.turn
            )
        self._is_driving, self._trouble = drive_input is not None, ""
        try:
            self._base.drive(velocity, source=Source.TELEOP)
        except NotConnected as error:
            self._trouble = str(error)
        except DriverError:  # latched: the status shows it already
            self._is_driving = False

    def status_line(self) -> str:
        """Return a line of text about the base: speed, source of commands, contacts, battery and errors."""
        reading, steering = self._base.state(), self._base.steering()
        state = reading.value
        paces = dict.fromkeys(f"{100 * pace:.0f}" for pace in (self.ahead, self.turn))
        words = [f"{'/'.join(paces)} %"]
        if state is None or not reading.good:
            return " | ".join((*words, self._trouble or self._base.health().detail or "no reports"))
        words.append(f"{state.velocity.linear:+.2f} m/s {degrees(state.velocity.angular):+4.0f} deg/s")
        why = f": {steering.reason}" if steering.reason else ""
        if state.reckoned:
            words.append("dead reckoning")
        words.append(
            self._base.latched or (RECONNECTED_HINT if self._is_stale else "") or f"{steering.source or 'idle'}{why}"
        )
        touched = {"bumper": state.bumper, "cliff": state.cliff, "wheel drop": state.wheel_drop}
        words += [f"{name} {sides}" for name, sides in touched.items() if sides]
        words += sorted(state.hazards)
        words.append(f"battery {state.battery_percent:.0f} %{' charging' if state.charging else ''}")
        return " | ".join([*words, self._trouble] if self._trouble else words)

    @property
    def trouble(self) -> str:
        """Error of the last command; empty if it succeeded."""
        return self._trouble

    def look(self, pan: float, tilt: float) -> None:
        """Turn the head by ``pan`` and ``tilt`` radians from its last setpoint, or else from its position."""
        if self._head is None:
            return
        here = self._goal or self._head.pose().value or HeadPose(0.0, 0.0)
        try:
            self._goal = self._head.look(HeadPose(here.pan + pan, here.tilt + tilt))
            self._trouble = ""
        except DriverError as error:
            self._trouble = str(error)
