"""Motion faults: results of the progress monitor, and their messages."""

from collections import deque
from collections.abc import Mapping
from math import degrees
from types import MappingProxyType

from drivers.api import COMMAND_TIMEOUT, ZERO_VELOCITY, BaseState, Sides, Source, Velocity
from drivers.api.fast_dataclass import dataclass

# Changes between two states of a base: of contacts, buttons and hazards.

# Names of the hazards in ``BaseState.hazards``, with advice. A side may follow a name: "stall left".

BACKUP_LIMIT = "backup limit"
STALL = "stall"
OBJECT_NEAR = "object near"
UNKNOWN = "hazard of type"
"""First words of the name of a hazard of an unknown type, such as "hazard of type 9"; its number follows them."""

_ADVICE: Mapping[str, tuple[str, str]] = MappingProxyType(
    {
        BACKUP_LIMIT: (
            "it does not drive backwards",
            "drive it forwards a little; to lift the limit see `safety_override` in docs/ros2.md",
        ),
        STALL: ("a wheel is blocked", "check for objects that block the wheels"),
        UNKNOWN: ("not known to this version", "`mission ros2 echo /hazard_detection` shows the message"),
    }
)
"""Effect and hint by hazard. Only these hazards are reported as faults; others, such as near objects, are not."""


def describe(hazard: str) -> tuple[str, str] | None:
    """Return a message on a hazard of a base and a hint; None if the hazard is not reported as a fault."""
    for name, (effect, hint) in _ADVICE.items():
        if hazard.startswith(name):
            return f"{hazard}: {effect}", hint
    return None


ON_THE_FLOOR = "stand the base on the floor, away from the edge"


@dataclass(frozen=True, slots=True)
class StateChange:
    """Difference between two states of a base.

    ``faults`` are new faults, each a message and a hint: the base now refuses some motion. ``inputs_changed`` is True
    if a contact, button or hazard changed.
    """

    faults: tuple[tuple[str, str], ...]
    inputs_changed: bool


def compare(before: BaseState | None, after: BaseState) -> StateChange:
    """Compare two states of a base; ``before`` is None if ``after`` is the first state."""
    faults = []
    if drop := _risen(before.wheel_drop if before else Sides(), after.wheel_drop):
        faults.append((f"wheel drop {drop}: it does not drive", ON_THE_FLOOR))
    if cliff := _risen(before.cliff if before else Sides(), after.cliff):
        faults.append((f"cliff {cliff}: it does not drive forward", ON_THE_FLOOR))
    if after.hazards:
        new = after.hazards - (before.hazards if before else frozenset())
        faults += [fault for hazard in sorted(new) if (fault := describe(hazard)) is not None]
    return StateChange(tuple(faults), _contacts(before) != _contacts(after))


def _risen(before: Sides, after: Sides) -> str:
    """Return the names of the sides of a sensor that became active, such as "left and centre"."""
    names = ("left", "centre", "right")
    return " and ".join(name for name in names if getattr(after, name) and not getattr(before, name))


def _contacts(state: BaseState | None) -> tuple[Sides, Sides, Sides, frozenset[int], frozenset[str]]:
    if state is None:
        return Sides(), Sides(), Sides(), frozenset(), frozenset()
    return state.bumper, state.cliff, state.wheel_drop, state.buttons, state.hazards


@dataclass(frozen=True, slots=True)
class MotionFault:
    """Fault for which a base was stopped: ``reason`` is a message with the likely cause, ``hint`` is what to do."""

    reason: str
    hint: str


LINEAR_CAUSES: Mapping[str, tuple[str, str]] = {
    "none": (
        "blocked or not connected",
        "free its wheels; is an E-stop pressed? check motors, encoders and their cables",
    ),
    "less": (
        "held back, or one wheel is blocked or not connected",
        "free its wheels; check motors, encoders and their cables",
    ),
    "more": ("faster than commanded", "check the wheels' measures in the robot file, and the slope"),
    "opposite": (
        "the sign of its motors or encoders is swapped",
        "swap the wires of both motors, or of both encoders; `mission doctor --move` shows which",
    ),
}
"""Likely cause and hint for a driving base by the kind of deviation: "none", "less", "more" or "opposite" motion."""

ANGULAR_CAUSES: Mapping[str, tuple[str, str]] = {
    "none": (
        "blocked, slipping, or its gyro or encoders are not connected",
        "free its wheels; check motors, encoders and their cables",
    ),
    "less": ("held back, slipping, or one wheel is blocked or not connected", "free its wheels"),
    "more": (
        "one wheel is blocked or not connected, or the sign of one is swapped",
        "free its wheels; check motors, encoders and their cables",
    ),
    "opposite": (
        "the sides of its wheels, or the sign of one, are swapped",
        "swap left and right; `mission doctor --move` shows which",
    ),
}
"""Likely cause and hint for a turning base by the kind of deviation: "none", "less", "more" or "opposite" motion."""


def describe_command(velocity: Velocity) -> str:
    """Return a commanded velocity as text, such as "commanded 0.2 m/s"."""
    parts = []
    if velocity.linear or not velocity.angular:
        parts.append(f"{velocity.linear:.2g} m/s")
    if velocity.angular:
        parts.append(f"{degrees(velocity.angular):.0f} deg/s")
    return f"commanded {' and '.join(parts)}"


def describe_instrument(instrument: str) -> str:
    """Return the first words of a message on measured motion, such as "the encoders report"."""
    return f"{instrument} {'report' if instrument.endswith('s') else 'reports'}"


def describe_overcurrent(state: BaseState) -> str:
    """Return the wheels whose motors are overloaded, as text."""
    wheels = "wheels" if state.overcurrent.left and state.overcurrent.right else "wheel"
    return f"overcurrent on the {state.overcurrent} {wheels}"


def describe_causes(state: BaseState) -> str:
    """Return overcurrents and hazards in ``state`` that may have caused a motion fault, as text; empty if none."""
    found = [describe_overcurrent(state)] if state.overcurrent else []
    return "".join(f"; {each}" for each in (*found, *sorted(state.hazards)))


def hint_of(state: BaseState) -> str:
    """Return the hints for all hazards in ``state``, joined to one text."""
    told = (describe(hazard) for hazard in sorted(state.hazards))
    return "; ".join(dict.fromkeys(hint for _, hint in filter(None, told)))


# Hold after a motion fault: the source in command is refused until it lets go; repeated faults latch the base.

RELEASE_TIMEOUT = 2 * COMMAND_TIMEOUT
"""Seconds without a command of a source after which its commands are no longer refused for a motion fault."""

MAX_FAULTS = 3
"""Number of motion faults within ``FAULT_WINDOW`` seconds after which the base is latched."""

FAULT_WINDOW = 60.0


class MotionHold:
    """After a motion fault, refuses the commands of the source that drove the base. Not thread-safe.

    The refusal ends when the source stops the base, commands zero or the opposite direction, or sends nothing for
    ``RELEASE_TIMEOUT``. So a source that repeats its command does not drive against an obstacle again. A leaf stops the
    base when it fails, so the next leaf can drive at once. A stop of the mission does not end the refusal of an
    operator's commands.
    """

    def __init__(self) -> None:
        self.fault: MotionFault | None = None
        self._held: dict[Source, float] = {}  # with the time of the last command
        self.wanted = ZERO_VELOCITY
        """Velocity that the refused source requested when the motion fault occurred."""
        self._faults: deque[float] = deque(maxlen=MAX_FAULTS)

    def begin(self, fault: MotionFault, source: Source | None, wanted: Velocity, now: float) -> str:
        """Refuse the commands of ``source`` from now on. Return the reason to latch the base, empty if it need not be.

        ``wanted`` is the setpoint of the source at the fault.
        """
        self.wanted = wanted
        self._held = {} if source is None or source is Source.SAFETY else {source: now}
        self.fault = fault if self._held else None
        self._faults.append(now)
        if len(self._faults) == MAX_FAULTS and now - self._faults[0] <= FAULT_WINDOW:
            self._faults.clear()
            return f"{MAX_FAULTS} motion faults within {FAULT_WINDOW:g} s: {fault.reason}"
        return ""

    def refuses(self, source: Source, wanted: Velocity, now: float) -> bool:
        """Return whether a command of ``source`` is refused after a motion fault.

        It is refused if ``source`` commanded the base at the fault. If the operator did, all sources are refused. A
        command that ends the refusal is not refused.
        """
        if source not in self._held:
            return source is not Source.TELEOP and self.holder(now) is Source.TELEOP
        if wanted == ZERO_VELOCITY or now - self._held[source] > RELEASE_TIMEOUT or _opposite(wanted, self.wanted):
            self.release(source)
            return False
        self._held[source] = now
        return True

    def reason(self, source: Source | None) -> str:
        """Return the fault for which the commands of ``source`` are refused; empty if they are not."""
        return self.fault.reason if self.fault is not None and source in self._held else ""

    def release(self, source: Source | None) -> None:
        """End the refusal of the commands of a source, or of all sources if None."""
        if source is None:
            self._held.clear()
        else:
            self._held.pop(source, None)
        if not self._held:
            self.fault = None

    def holder(self, now: float) -> Source | None:
        """Return the source whose commands are refused at ``now``; None if no commands are refused."""
        for source, at in list(self._held.items()):
            if now - at > RELEASE_TIMEOUT:
                self.release(source)
        return next(iter(self._held), None)


def _opposite(one: Velocity, other: Velocity) -> bool:
    """Return whether ``one`` drives in the opposite direction to ``other``, or turns so if ``other`` does not drive."""
    if other.linear:
        return one.linear * other.linear < 0.0
    return one.angular * other.angular < 0.0
