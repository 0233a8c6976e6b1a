"""From a checked mission to a report on it."""

from behaviours.run import SENSOR_TIMEOUT
from config.units import written
from drivers.clock import Clock
from missions.language.plan import Plan
from missions.plugins.verify.explore import Space
from missions.plugins.verify.judge import Judge
from missions.plugins.verify.model import Model
from missions.plugins.verify.verdicts import Report

BOUND = 10_000
"""States after which an exploration gives up; the shipped missions have a few hundred at most."""

LIMIT = 60.0
"""Seconds after which it gives up."""


def verify(
    plan: Plan,
    clock: Clock,
    *,
    bound: int = BOUND,
    limit: float = LIMIT,
    sensor_timeout: float = SENSOR_TIMEOUT,
) -> Report:
    """Explore a mission and return what that proves and refutes.

    It goes on to ``bound`` states and for ``limit`` seconds at most, by ``clock``. The robot waits for its sensors for
    ``sensor_timeout`` seconds.
    """
    began = clock.now()
    space = Space(Model(plan, sensor_timeout), bound, lambda: clock.now() - began >= limit)
    space.explore()
    verdicts = tuple(Judge(space, plan).verdicts())
    seconds = clock.now() - began
    figures = len(space.places), space.transitions, space.depth
    return Report(plan.source.name, plan.mission, verdicts, *figures, seconds, _left_out(space, limit))


def _left_out(space: Space, limit: float) -> str:
    """Say what was not explored, and what to do about it."""
    if space.open:
        more = f"--limit '{written(10 * limit, 'duration')}'" if space.out_of_time else f"--bound {10 * space.bound}"
        when = f"after {written(limit, 'duration')} " if space.out_of_time else ""
        return f"{when}{len(space.open)} of {len(space.places)} states were not followed to the end; try {more}"
    return "" if space.whole else "not every order of a random composite with many children was tried"
