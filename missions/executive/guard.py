"""Looks at the base before every tick, above the tree: tells what it felt, and ends a mission that must end."""

from collections.abc import Callable
from math import inf

from behaviours.run import Run
from drivers.api import Base, BaseState, Reflexes, Sides, ignore
from missions.executive.events import ReflexFired
from missions.executive.stream import Stream

CONFIRM = 2.0
"""Seconds between two readings that have to agree: under load the voltage dips, and the percentage with it."""

HYSTERESIS = 3.0
"""Percent above a threshold from which on it does not hold any more."""


class BatteryWatch:
    """Looks at readings of a battery; ``low`` and ``critical`` say how it is as of the last one.

    Thresholds are in percent, 0 for never. Either holds once two readings at least ``CONFIRM`` apart were below it, and
    none between was above, until the battery charges or is ``HYSTERESIS`` above it.
    """

    def __init__(self, low: float, critical: float) -> None:
        self._low, self._critical = _Threshold(low), _Threshold(critical)
        self._plenty = max(low, critical) + HYSTERESIS
        self._uneasy = False  # below that when it was last looked at

    @property
    def low(self) -> bool:
        """True when it should be charged soon."""
        return self._low.holds

    @property
    def critical(self) -> bool:
        """True when nothing should be begun with it any more."""
        return self._critical.holds

    def update(self, percent: float, now: float, *, charging: bool) -> bool:
        """Take in a reading (0..100) of time ``now`` in seconds; False where there was and is plenty: nothing holds."""
        percent = inf if charging else percent
        if not self._uneasy and percent >= self._plenty:
            return False
        self._uneasy = percent < self._plenty
        self._low.update(percent, now)
        self._critical.update(percent, now)
        return True


class _Threshold:
    """One of the two."""

    def __init__(self, percent: float) -> None:
        self._percent = percent
        self._below_since: float | None = None
        self.holds = False

    def update(self, percent: float, now: float) -> None:
        if percent >= self._percent:
            self._below_since = None
            self.holds = self.holds and percent < self._percent + HYSTERESIS
        elif self._below_since is None:
            self._below_since = now
        elif now - self._below_since >= CONFIRM:
            self.holds = True


CONTACTS = ("bumper", "cliff", "wheel_drop")
"""What a base feels with its left, its middle and its right; events and state call it so."""

REFLEXES = (*CONTACTS, "hazard", "button", "docked", "charging", "latched", "battery_low", "battery_critical")
"""All that the guard tells of."""

_Felt = tuple[Sides, Sides, Sides, frozenset[str], frozenset[int], bool, bool]
_NOTHING: _Felt = (Sides(), Sides(), Sides(), frozenset(), frozenset(), False, False)


class Guard:
    """What a ``base`` does about all this by itself is its driver's business; see ``drivers.api.Reflexes``.

    ``battery`` is what the readings of its battery come to, by the thresholds of ``reflexes``. ``enabled`` is called
    when a person enables the base, or presses its button for that: it enables all other parts as well.
    """

    def __init__(
        self, base: Base, reflexes: Reflexes, run: Run, stream: Stream, enabled: Callable[[], None] = ignore
    ) -> None:
        self._enabled = enabled
        self._button = reflexes.enable_button
        self.battery = BatteryWatch(reflexes.battery_low, reflexes.battery_critical)
        self._base = base
        self._run = run
        self._stream = stream
        self._felt = _NOTHING
        self._latched = ""
        self._weak = False, False  # whether the battery was low, and critical

    def look(self) -> str:
        """Look once; return why the mission must end, or nothing. What is not reported afresh is as it was."""
        latched = self._base.latched
        if latched != self._latched:
            self._tell("latched", latched or self._latched, on=bool(latched))
            self._latched = latched
            if not latched:
                self._enabled()
        reading = self._base.state()
        state = reading.value
        if state is None or not reading.good:
            return ""
        felt = _felt(state)
        if felt != self._felt:
            before, self._felt = self._felt, felt
            self._tell_felt(before, felt)
        return self._weigh(state)

    def stirred(self) -> bool:
        """True while it feels or says something else than when it was looked at last: worth a look at once."""
        reading = self._base.state()
        state = reading.value
        if self._base.latched != self._latched:
            return True
        return state is not None and reading.good and _felt(state) != self._felt

    def _tell_felt(self, before: _Felt, felt: _Felt) -> None:
        """Tell what is new of all that the base feels."""
        *contacts_before, hazards_before, buttons_before, docked_before, charging_before = before
        *contacts, hazards, buttons, docked, charging = felt
        for what, was, now in zip(CONTACTS, contacts_before, contacts, strict=True):
            if now != was:
                self._tell(what, str(now or was), on=bool(now))
        for hazard in sorted(hazards ^ hazards_before):
            self._tell("hazard", hazard, on=hazard in hazards)
        for number in sorted(buttons ^ buttons_before):
            self._tell("button", str(number), on=number in buttons)
            if number == self._button and number in buttons:
                self._enabled()
        if docked != docked_before:
            self._tell("docked", "", on=docked)
        if charging != charging_before:
            self._tell("charging", "", on=charging)

    def _weigh(self, state: BaseState) -> str:
        """Take in how full the battery is; return why the mission must end."""
        battery, percent = self.battery, state.battery_percent
        before = self._weak
        if not battery.update(percent, self._run.now(), charging=state.charging):
            return ""
        self._weak = after = battery.low, battery.critical
        if after != before:
            for what, was, now in zip(("battery_low", "battery_critical"), before, after, strict=True):
                if now != was:
                    self._tell(what, f"{percent:.0f} %", on=now)
        return f"battery critical: {percent:.0f} %" if battery.critical else ""

    def _tell(self, what: str, where: str, *, on: bool) -> None:
        self._stream.emit(ReflexFired(self._run.clock.now(), self._run.tick, what, where, on))


def _felt(state: BaseState) -> _Felt:
    contacts = state.bumper, state.cliff, state.wheel_drop
    return (*contacts, state.hazards, state.buttons, state.docked, state.charging)
