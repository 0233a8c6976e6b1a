"""The ``away`` section of a part that moves: what it does when it is back after it was unplugged, or silent."""

from dataclasses import dataclass

from config.fields import Fields


@dataclass(frozen=True, slots=True)
class AwayConfig:
    """After how many seconds away a part waits for a new decision, and to be enabled; see ``drivers.api.Away``."""

    decide: float = 1.0
    latch: float = 5.0


def read_away(fields: Fields | None) -> AwayConfig:
    """Read the section."""
    usual = AwayConfig()
    if fields is None:
        return usual
    mistakes = len(fields.faults)
    away = AwayConfig(
        decide=fields.quantity("decide_after", "duration", usual.decide, low=0.1),
        latch=fields.quantity("latch_after", "duration", usual.latch, low=0.1),
    )
    given = fields.node_of("latch_after") or fields.node_of("decide_after")
    if given is not None and len(fields.faults) == mistakes and away.latch < away.decide:
        fields.fault(given.mark, f"'latch_after' ({away.latch:g} s) is below 'decide_after' ({away.decide:g} s)")
    fields.done()
    return away
