"""What the base does by itself with what it feels, whoever commands. Its time and its state are handed in."""

from math import hypot
from typing import Literal

from drivers.api import STILL, BaseState, Pose2D, Reflexes, Sides, Velocity
from drivers.api.quick import dataclass

BACK_OFF_TIME = 1.0
"""Seconds that backing off may take beyond what its way needs: then something holds it."""

CARRIED = 0.5
"""Seconds for which both wheels must have hung to count as carried elsewhere: a switch may flicker at an edge."""

BACK_OFF_TURN = 0.4
"""rad/s that it turns away from the side that was hit; the figure of the vendor's safety controller."""

GENTLE = 0.06
"""m/s up to which a bump was meant: a dock is driven against."""


@dataclass(frozen=True, slots=True)
class _BackingOff:
    """A back-off on its way: from where, until when at most, with what command."""

    origin: Pose2D
    until: float
    command: Velocity
    because: str


class SafetyController:
    """The reflexes of a base. Tell it every state by ``feel``; then ask it what is permitted.

    ``latching`` says why somebody must enable the base before it drives again; empty when there is no reason.
    """

    def __init__(self, reflexes: Reflexes) -> None:
        self._reflexes = reflexes
        self._before: BaseState | None = None
        self._edge: Pose2D | None = None  # where a cliff was felt last, until it is left behind
        self._lifted_at: float | None = None  # since when both wheels hang, or have hung
        self._backing: _BackingOff | None = None
        self.latching = ""

    @property
    def alert(self) -> bool:
        """True while it backs off, or there is an edge to get away from: while places matter."""
        return self._backing is not None or self._edge is not None

    def feel(self, felt: BaseState, going: Velocity, now: float) -> tuple[Velocity, str] | None:
        """Take in a state, while it was ``going`` so; return what to do about it, and why, or None for nothing."""
        self.latching = ""
        if felt is self._before and not self.alert:
            return None
        before, self._before = self._before or BaseState(felt.pose, felt.velocity), felt
        self.latching = self._latch(before, felt)
        self._remember_edge(felt, now)
        hard = going.linear > GENTLE and not felt.docked
        if hard and _risen(before.bumper, felt.bumper) and self._reflexes.bumper == "back_off":
            self._backing = self._begin(felt, now)
        backing = self._backing
        if backing is None:
            return None
        gone = _away(felt.pose, backing.origin) >= self._reflexes.back_off_way and not felt.bumper
        if gone or felt.cliff or felt.wheel_drop or now > backing.until:
            self._backing = None
            return None
        return backing.command, backing.because

    def calm(self) -> None:
        """Do no more about what was felt so far; an edge stays where it was."""
        self._backing = None

    def permit(self, wanted: Velocity, felt: BaseState | None) -> tuple[Velocity, str]:
        """Return what of ``wanted`` may be done with what is felt, and why not all of it.

        Nothing with a wheel in the air, or with nothing known. At an edge only straight back, and so until it is left
        behind: a base that turns there falls. Not forward with a pressed bumper, but back and round.
        """
        if felt is None:
            return STILL, "no reports"
        if felt.wheel_drop:
            return STILL, f"wheel drop {felt.wheel_drop}"
        if felt.cliff or self._edge is not None:
            given = Velocity(min(wanted.linear, 0.0), 0.0)
            return given, "" if given == wanted else f"cliff {felt.cliff}" if felt.cliff else "at an edge"
        if felt.bumper and wanted.linear > 0.0:
            return Velocity(0.0, wanted.angular), f"bumper {felt.bumper}"
        return wanted, ""

    def _latch(self, before: BaseState, felt: BaseState) -> str:
        reflexes = self._reflexes
        contacts: tuple[tuple[str, Literal["stop", "back_off", "latch"], Sides, Sides], ...] = (
            ("wheel drop", reflexes.wheel_drop, before.wheel_drop, felt.wheel_drop),
            ("cliff", reflexes.cliff, before.cliff, felt.cliff),
            ("bumper", reflexes.bumper, before.bumper, felt.bumper),
        )
        for name, reflex, was, now in contacts:
            if reflex == "latch" and _risen(was, now):
                return f"{name} {now}"
        return ""

    def _remember_edge(self, felt: BaseState, now: float) -> None:
        if felt.wheel_drop.left and felt.wheel_drop.right and self._lifted_at is None:
            self._lifted_at = now
        if felt.cliff:
            self._edge = felt.pose
        elif self._edge is not None and not felt.wheel_drop:
            carried = self._lifted_at is not None and now - self._lifted_at >= CARRIED
            if carried or _away(felt.pose, self._edge) >= self._reflexes.back_off_way:
                self._edge = None
        if not felt.wheel_drop:
            self._lifted_at = None

    def _begin(self, felt: BaseState, now: float) -> _BackingOff:
        """Back off, and away from the side that was hit."""
        left, right = felt.bumper.left, felt.bumper.right
        turn = 0.0 if left == right or felt.bumper.centre else -BACK_OFF_TURN if left else BACK_OFF_TURN
        command = Velocity(-self._reflexes.back_off_speed, turn)
        until = now + self._reflexes.back_off_way / self._reflexes.back_off_speed + BACK_OFF_TIME
        return _BackingOff(felt.pose, until, command, f"backing off: bumper {felt.bumper}")


def _risen(before: Sides, after: Sides) -> bool:
    """Say whether one more side has come on."""
    return (
        (after.left and not before.left) or (after.centre and not before.centre) or (after.right and not before.right)
    )


def _away(here: Pose2D, there: Pose2D) -> float:
    return hypot(here.x - there.x, here.y - there.y)
