"""The light in a simulated world, and how it changes with time."""

from dataclasses import dataclass

from drivers.errors import BadRequest


@dataclass(frozen=True, slots=True)
class Change:
    """From ``at`` seconds on the light goes to ``level``, evenly within ``over`` seconds."""

    at: float
    level: float
    over: float = 0.0


@dataclass(frozen=True, slots=True)
class Light:
    """How bright it is: 1 is daylight, 0.25 a quarter of it. ``level`` at first, then what ``changes`` make of it.

    Each change begins from what the one before it had reached. Raises BadRequest for a level or a length below 0, and
    for changes that are not in the order of time.
    """

    level: float = 1.0
    changes: tuple[Change, ...] = ()

    def __post_init__(self) -> None:
        before = 0.0
        for level in (self.level, *(change.level for change in self.changes)):
            if not level >= 0:
                raise BadRequest(f"world: light {level}: must not be negative")
        for change in self.changes:
            if change.over < 0 or not change.at >= before:
                raise BadRequest(f"world: light changes at {change.at} s over {change.over} s: not in order of time")
            before = change.at

    def at(self, time: float) -> float:
        """Return the level at ``time`` seconds."""
        level = self.level
        for number, change in enumerate(self.changes):
            if change.at > time:
                break
            until = time if number + 1 == len(self.changes) else min(time, self.changes[number + 1].at)
            share = 1.0 if until - change.at >= change.over else (until - change.at) / change.over
            level += share * (change.level - level)
        return level
