"""Reflexes of a base: back-off, latch and forbidden directions, after contacts. No I/O; times are arguments."""

from math import hypot
from typing import Literal

from drivers.api import ZERO_VELOCITY, BaseState, Pose2D, Reflexes, Sides, Velocity
from drivers.api.fast_dataclass import dataclass

BACK_OFF_TIME = 1.0
"""Seconds that a back-off may take in addition to its distance divided by its speed.

A base that needs longer is blocked.
"""

CARRIED_TIME = 0.5
"""Seconds with both wheels dropped after which the base is assumed to stand at another place.

It is longer than the bounce of a wheel switch at an edge.
"""

BACK_OFF_TURN = 0.4
"""Turn rate in rad/s of a back-off, away from the side that was hit, as in the vendor's driver of the Kobuki."""

MAX_GENTLE_SPEED = 0.06
"""Maximum speed in m/s at which a bump does not cause a back-off, since a base bumps slowly into its dock."""


@dataclass(frozen=True, slots=True)
class _BackingOff:
    """Active back-off: pose at its start, deadline, velocity and reason."""

    origin: Pose2D
    until: float
    command: Velocity
    because: str


class SafetyController:
    """Reflexes of one base, configured by ``reflexes``. Not thread-safe.

    The attribute ``latch_reason`` is the reason for which the newest state latches the base; empty if there is none.
    """

    def __init__(self, reflexes: Reflexes) -> None:
        self._reflexes = reflexes
        self._before: BaseState | None = None
        self._edge: Pose2D | None = None  # pose at the last cliff, until the base is far enough from it
        self._lifted_at: float | None = None  # since when both wheels are dropped, or one of them still is
        self._backing: _BackingOff | None = None
        self.latch_reason = ""

    @property
    def needs_pose(self) -> bool:
        """True if ``update`` needs the pose: during a back-off, and after a cliff until the base is far from it."""
        return self._backing is not None or self._edge is not None

    def update(self, state: BaseState, sent: Velocity, now: float) -> tuple[Velocity, str] | None:
        """Update the reflexes with a new state; return the velocity and the reason of a back-off, or None.

        ``sent`` is the velocity that was last sent to the base.
        """
        self.latch_reason = ""
        if state is self._before and not self.needs_pose:
            return None
        before, self._before = self._before or BaseState(state.pose, state.velocity), state
        self.latch_reason = self._latch(before, state)
        self._remember_edge(state, now)
        hard = sent.linear > MAX_GENTLE_SPEED and not state.docked
        if hard and _risen(before.bumper, state.bumper) and self._reflexes.bumper == "back_off":
            self._backing = self._begin(state, now)
        backing = self._backing
        if backing is None:
            return None
        gone = _away(state.pose, backing.origin) >= self._reflexes.back_off_distance and not state.bumper
        if gone or state.cliff or state.wheel_drop or now > backing.until:
            self._backing = None
            return None
        return backing.command, backing.because

    def cancel_back_off(self) -> None:
        """End an active back-off. The position of a known cliff is kept."""
        self._backing = None

    def permit(self, setpoint: Velocity, state: BaseState | None) -> tuple[Velocity, str]:
        """Return the part of ``setpoint`` that ``state`` permits, and the reason for the restriction (empty if none).

        With a dropped wheel or without a state nothing is permitted. At a cliff, and until the base is far enough from
        it, only driving straight back is permitted. A pressed bumper forbids driving forward.
        """
        if state is None:
            return ZERO_VELOCITY, "no reports"
        if state.wheel_drop:
            return ZERO_VELOCITY, f"wheel drop {state.wheel_drop}"
        if state.cliff or self._edge is not None:
            given = Velocity(min(setpoint.linear, 0.0), 0.0)
            return given, "" if given == setpoint else f"cliff {state.cliff}" if state.cliff else "at an edge"
        if state.bumper and setpoint.linear > 0.0:
            return Velocity(0.0, setpoint.angular), f"bumper {state.bumper}"
        return setpoint, ""

    def _latch(self, before: BaseState, state: BaseState) -> str:
        reflexes = self._reflexes
        contacts: tuple[tuple[str, Literal["stop", "back_off", "latch"], Sides, Sides], ...] = (
            ("wheel drop", reflexes.wheel_drop, before.wheel_drop, state.wheel_drop),
            ("cliff", reflexes.cliff, before.cliff, state.cliff),
            ("bumper", reflexes.bumper, before.bumper, state.bumper),
        )
        for name, reflex, was, now in contacts:
            if reflex == "latch" and _risen(was, now):
                return f"{name} {now}"
        return ""

    def _remember_edge(self, state: BaseState, now: float) -> None:
        if state.wheel_drop.left and state.wheel_drop.right and self._lifted_at is None:
            self._lifted_at = now
        if state.cliff:
            self._edge = state.pose
        elif self._edge is not None and not state.wheel_drop:
            carried = self._lifted_at is not None and now - self._lifted_at >= CARRIED_TIME
            if carried or _away(state.pose, self._edge) >= self._reflexes.back_off_distance:
                self._edge = None
        if not state.wheel_drop:
            self._lifted_at = None

    def _begin(self, state: BaseState, now: float) -> _BackingOff:
        """Return a new back-off, which turns away from the side of the pressed bumper."""
        left, right = state.bumper.left, state.bumper.right
        turn = 0.0 if left == right or state.bumper.centre else -BACK_OFF_TURN if left else BACK_OFF_TURN
        command = Velocity(-self._reflexes.back_off_speed, turn)
        until = now + self._reflexes.back_off_distance / self._reflexes.back_off_speed + BACK_OFF_TIME
        return _BackingOff(state.pose, until, command, f"backing off: bumper {state.bumper}")


def _risen(before: Sides, after: Sides) -> bool:
    """Return whether a side of a sensor has become active."""
    return (
        (after.left and not before.left) or (after.centre and not before.centre) or (after.right and not before.right)
    )


def _away(here: Pose2D, there: Pose2D) -> float:
    return hypot(here.x - there.x, here.y - there.y)
