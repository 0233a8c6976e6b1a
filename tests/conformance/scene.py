"""An executive with a tree of probes, and simulated time in which its loop runs without waiting."""

import math
from collections.abc import Callable
from threading import Event

from behaviours.robot import Robot
from drivers.clock import Clock, ManualClock
from missions.executive import events, stream
from missions.executive.build import build
from missions.executive.executive import Executive, Result
from tests.conformance.harness import Case
from tests.conformance.probes import Bench

PERIOD = 0.125
"""Seconds between two ticks here."""

Script = dict[float, Callable[[], None]]


class Waiting(Event):
    """An event that lets simulated time pass while it is waited for, and has ``script`` happen at its times."""

    def __init__(self, clock: ManualClock) -> None:
        super().__init__()
        self.script: Script = {}
        self._clock = clock

    def wait(self, timeout: float | None = None) -> bool:
        assert timeout is not None, "the loop waits for what may never come"
        end = self._clock.now() + timeout
        while not self.is_set():
            due = min(self.script, default=math.inf)
            if due > end:
                self._clock.advance(max(0.0, end - self._clock.now()))
                return False
            self._clock.advance(max(0.0, due - self._clock.now()))
            self.script.pop(due)()
        return True


class Scene:
    """An executive with a tree of probes, and all that it told."""

    def __init__(self, tree: str, clock: Clock, *, woken: Event | None = None, rate: float = 1 / PERIOD) -> None:
        self.run = Bench(clock)
        if woken is not None:
            self.run.wake_event = woken
        root = build(Case("a run", "run", f"mission: run\ntree:\n  {tree}\n").plan(), self.run, lambda _: Robot())
        self.told: list[events.Event] = []
        self.at_tick: Callable[[int], None] = lambda _: None
        self.executive = Executive(root, self.run, stream.EventStream([self._hear]), rate=rate, mission="run")

    @property
    def ticks(self) -> list[float]:
        """When each tick came; what ``at_tick`` spends comes on top, as part of it."""
        return [event.t for event in self.told if isinstance(event, events.Ticked)]

    def _hear(self, event: events.Event) -> None:
        self.told.append(event)
        if isinstance(event, events.Ticked):
            self.at_tick(event.tick)


class Simulated(Scene):
    """A scene in simulated time: ``play`` runs the loop while the script happens."""

    def __init__(self, tree: str = "probe: running", *, rate: float = 1 / PERIOD) -> None:
        self.clock = ManualClock()
        self.woken = Waiting(self.clock)
        super().__init__(tree, self.clock, woken=self.woken, rate=rate)

    def play(self, script: Script | None = None) -> Result:
        self.woken.script.update(script or {})
        return self.executive.loop()

    def stop(self) -> None:
        self.executive.stop("told to")

    def settled(self) -> list[float]:
        """Let the run write down when, rather than what, it settles; return that list."""
        times: list[float] = []
        self.run.safe_stop = lambda claims: times.append(self.clock.now()) if claims else None
        return times
