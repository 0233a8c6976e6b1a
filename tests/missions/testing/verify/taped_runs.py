"""All short runs of a mission whose leaves, sensors and draws read their answers from a tape."""

from collections.abc import Iterator
from dataclasses import replace
from random import Random
from typing import Any

from py_trees.common import Status

from behaviours.basics import Check, Set, WaitUntil
from behaviours.leaf import FAILURE, RUNNING, SUCCESS, Leaf
from behaviours.robot import Robot
from behaviours.run import RunState
from drivers.clock import ManualClock
from drivers.errors import SensorSilent
from missions.executive.build import build
from missions.language.plan import Plan, Step

STATUSES = (SUCCESS, FAILURE, RUNNING)


class Tape:
    """The answers of all leaves and sensors in one run, as digits of a number that counts up."""

    def __init__(self) -> None:
        self.digits: list[int] = []
        self.place = 0
        self.silent: dict[tuple[int, float | None], bool] = {}

    def read(self) -> Status:
        if self.place == len(self.digits):
            self.digits.append(0)
        self.place += 1
        return STATUSES[self.digits[self.place - 1]]

    def rewind(self) -> bool:
        """Go on to the next number; False after the last."""
        del self.digits[self.place :]
        self.place = 0
        self.silent.clear()
        while self.digits and self.digits[-1] == len(STATUSES) - 1:
            self.digits.pop()
        if self.digits:
            self.digits[-1] += 1
        return bool(self.digits)


def taped(step: Step, tape: Tape) -> Step:
    """The step with leaves that read ``tape``."""

    class Reader(Leaf):
        """Do what the tape says; drive what the real leaf drives, since that halts what has to make way."""

        drives = frozenset() if step.leaf is None else step.leaf.drives
        instant = step.leaf is not None and step.leaf.instant
        acts = step.leaf is not None and step.leaf.acts

        def update(self) -> Status:
            status = tape.read()
            if not self.instant:
                return status
            waiting = self.run.tick, self._silent_since  # all conditions here are equal, and see the same picture
            silent = tape.silent.setdefault(waiting, status is RUNNING)
            return self.suspend("camera") if silent else SUCCESS if status is RUNNING else status

    if step.leaf in (Check, WaitUntil, Set):
        return step
    children = tuple(taped(child, tape) for child in step.children)
    return replace(step, children=children) if step.leaf is None else replace(step, leaf=Reader, arguments={})


class TapedRandom(Random):
    """Chance that reads ``tape``: each child that can be drawn next is drawn in some run."""

    def __init__(self, tape: Tape) -> None:
        super().__init__(0)
        self._tape = tape

    def random(self) -> float:
        """Return one of three numbers that tell the bounds of all conditions here apart."""
        return (0.0, 0.5, 0.9)[STATUSES.index(self._tape.read())]

    def choices(self, population: Any, *args: Any, **options: Any) -> list[Any]:
        del args, options
        return [population[STATUSES.index(self._tape.read()) % len(population)]]


class TapedFace:
    """The face of the robot's state: whether one is seen is read from the tape, or that the camera does not report."""

    def __init__(self, tape: Tape) -> None:
        self._tape = tape

    @property
    def seen(self) -> bool:
        answer = self._tape.read()
        if answer is RUNNING:
            raise SensorSilent("the camera does not report")
        return answer is SUCCESS


def taped_runs(plan: Plan, seconds: tuple[float, ...]) -> Iterator[tuple[RunState, Status]]:
    """Yield each run of ``plan`` at its end or last tick, with the status. ``seconds`` pass before the ticks."""
    tape = Tape()
    tree = taped(plan.tree, tape)
    more = True
    while more:
        clock = ManualClock()
        run = RunState(clock)
        run.variables["face"] = TapedFace(tape)
        run.random = TapedRandom(tape)
        root = build(replace(plan, tree=tree), run, lambda _: Robot())
        status = RUNNING
        for wait in seconds:
            clock.advance(wait)
            run.tick += 1
            status = root.execute_tick()
            if status is not RUNNING:
                break
        yield run, status
        more = tape.rewind()
