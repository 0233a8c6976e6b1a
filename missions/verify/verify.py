"""From a checked mission to a report on it."""

from drivers.clock import Clock
from missions.language.plan import Plan
from missions.verify.explore import Space
from missions.verify.judge import Judge
from missions.verify.model import Model
from missions.verify.verdicts import Report

BOUND = 10_000
"""States after which an exploration gives up; the shipped missions have a few hundred at most."""


def verify(plan: Plan, clock: Clock, *, bound: int = BOUND) -> Report:
    """Explore a mission up to ``bound`` states and return what that proves and refutes; ``clock`` times it."""
    began = clock.now()
    space = Space(Model(plan), bound)
    space.explore()
    verdicts = tuple(Judge(space, plan).verdicts())
    seconds = clock.now() - began
    figures = len(space.places), space.transitions, space.depth
    return Report(plan.source.name, plan.mission, verdicts, *figures, seconds, _left_out(space))


def _left_out(space: Space) -> str:
    """Say what was not explored, and what to do about it."""
    if space.open:
        return f"{len(space.open)} of {len(space.places)} states were not followed; try --bound {10 * space.bound}"
    return "" if space.whole else "not every order of a random composite with many children was tried"
