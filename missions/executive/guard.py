"""Checks the base before every tick: reports its contacts and reflexes, and ends a mission with a critical battery."""

from collections.abc import Callable
from math import inf

from behaviours.run import RunState
from drivers.api import Base, BaseState, Reflexes, Sides, ignore
from missions.executive.events import ReflexFired
from missions.executive.stream import EventStream

CONFIRM_TIME = 2.0
"""Seconds between two battery readings that must agree: under load the voltage dips, and the percentage with it."""

HYSTERESIS_PERCENT = 3.0
"""Percent of charge by which the battery must be above a threshold before it no longer counts as below it."""


class BatteryWatch:
    """Detects a low battery: compares the battery charge with two thresholds, ``low`` and ``critical``.

    Thresholds are in percent, 0 for never. A threshold is reached if all readings over ``CONFIRM_TIME`` were below it.
    It is released when the battery charges, or is ``HYSTERESIS_PERCENT`` above it.
    """

    def __init__(self, low: float, critical: float) -> None:
        self._low, self._critical = _Threshold(low), _Threshold(critical)
        self._clear_percent = max(low, critical) + HYSTERESIS_PERCENT
        self._was_below = False  # whether the last charge was below the threshold

    @property
    def low(self) -> bool:
        """True if the battery should be charged soon."""
        return self._low.is_reached

    @property
    def critical(self) -> bool:
        """True if no mission should continue."""
        return self._critical.is_reached

    def update(self, percent: float, now: float, *, charging: bool) -> bool:
        """Add a reading (0..100) at ``now`` seconds; return False if the battery is clearly above both thresholds."""
        percent = inf if charging else percent
        if not self._was_below and percent >= self._clear_percent:
            return False
        self._was_below = percent < self._clear_percent
        self._low.update(percent, now)
        self._critical.update(percent, now)
        return True


class _Threshold:
    """Threshold of the battery charge, with confirmation and hysteresis."""

    def __init__(self, percent: float) -> None:
        self._percent = percent
        self._below_since: float | None = None
        self.is_reached = False

    def update(self, percent: float, now: float) -> None:
        if percent >= self._percent:
            self._below_since = None
            self.is_reached = self.is_reached and percent < self._percent + HYSTERESIS_PERCENT
        elif self._below_since is None:
            self._below_since = now
        elif now - self._below_since >= CONFIRM_TIME:
            self.is_reached = True


CONTACTS = ("bumper", "cliff", "wheel_drop")
"""Contact sensors of a base with a left, middle and right side; the names in events and states."""

REFLEXES = (*CONTACTS, "hazard", "button", "docked", "charging", "latched", "battery_low", "battery_critical")
"""Conditions of the base that the guard reports as ReflexFired events."""

_Feedback = tuple[Sides, Sides, Sides, frozenset[str], frozenset[int], bool, bool]
_NO_FEEDBACK: _Feedback = (Sides(), Sides(), Sides(), frozenset(), frozenset(), False, False)


class BaseGuard:
    """Checks a ``base`` before each tick, and reports its contacts, hazards, stops and battery as events.

    It reacts only to a critical battery: it ends the mission. The reflexes, such as stopping at a bumper, are in the
    driver of the base. ``battery`` is the battery state by the thresholds of ``reflexes``. ``on_enable`` is called when
    a person enables the base, or presses the base's button for that; this function must enable all other parts.
    """

    def __init__(
        self, base: Base, reflexes: Reflexes, run: RunState, stream: EventStream, on_enable: Callable[[], None] = ignore
    ) -> None:
        self._on_enable = on_enable
        self._button = reflexes.enable_button
        self.battery = BatteryWatch(reflexes.battery_low, reflexes.battery_critical)
        self._base = base
        self._run = run
        self._stream = stream
        self._feedback = _NO_FEEDBACK
        self._latched = ""
        self._battery_state = False, False  # whether the battery was low, and critical

    def check(self) -> str:
        """Report changes of the base; return the reason if the mission must end, else an empty text.

        If the base does not report, nothing changes.
        """
        latched = self._base.latched
        if latched != self._latched:
            self._emit("latched", latched or self._latched, on=bool(latched))
            self._latched = latched
            if not latched:
                self._on_enable()
        reading = self._base.state()
        state = reading.value
        if state is None or not reading.good:
            return ""
        felt = _feedback_of(state)
        if felt != self._feedback:
            before, self._feedback = self._feedback, felt
            self._emit_feedback(before, felt)
        return self._check_battery(state)

    def has_changed(self) -> bool:
        """Return True if latch, contacts, hazards, buttons or charging have changed since ``check``."""
        reading = self._base.state()
        state = reading.value
        if self._base.latched != self._latched:
            return True
        return state is not None and reading.good and _feedback_of(state) != self._feedback

    def _emit_feedback(self, before: _Feedback, after: _Feedback) -> None:
        """Emit an event for each contact, hazard, button or charging state that differs between two readings."""
        *contacts_before, hazards_before, buttons_before, docked_before, charging_before = before
        *contacts, hazards, buttons, docked, charging = after
        for what, was, now in zip(CONTACTS, contacts_before, contacts, strict=True):
            if now != was:
                self._emit(what, str(now or was), on=bool(now))
        for hazard in sorted(hazards ^ hazards_before):
            self._emit("hazard", hazard, on=hazard in hazards)
        for number in sorted(buttons ^ buttons_before):
            self._emit("button", str(number), on=number in buttons)
            if number == self._button and number in buttons:
                self._on_enable()
        if docked != docked_before:
            self._emit("docked", "", on=docked)
        if charging != charging_before:
            self._emit("charging", "", on=charging)

    def _check_battery(self, state: BaseState) -> str:
        """Update the battery state; return the reason if the mission must end."""
        battery, percent = self.battery, state.battery_percent
        before = self._battery_state
        if not battery.update(percent, self._run.now(), charging=state.charging):
            return ""
        self._battery_state = after = battery.low, battery.critical
        if after != before:
            for what, was, now in zip(("battery_low", "battery_critical"), before, after, strict=True):
                if now != was:
                    self._emit(what, f"{percent:.0f} %", on=now)
        return f"battery critical: {percent:.0f} %" if battery.critical else ""

    def _emit(self, what: str, where: str, *, on: bool) -> None:
        self._stream.emit(ReflexFired(self._run.clock.now(), self._run.tick, what, where, on))


def _feedback_of(state: BaseState) -> _Feedback:
    contacts = state.bumper, state.cliff, state.wheel_drop
    return (*contacts, state.hazards, state.buttons, state.docked, state.charging)
