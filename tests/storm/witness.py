"""Who watches a run of the storm: what was told, what was decided, and every 20 ms how everything truly moves."""

import hashlib
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from behaviours.leaf import RUNNING, Leaf
from config.robot import RobotConfig
from drivers.api import BaseState, Reading, ignore
from missions.executive.events import CommandSent, Event, FaultRaised, NodeChanged, Started, Ticked
from missions.executive.tick_record import TickRecord
from missions.plugins.testing.case_history import CaseHistory
from missions.plugins.testing.fault_specs import FaultSpec
from missions.runner import Runner
from tests.storm.leaves import LEFT, STOPS_NOT
from tests.storm.record import StormRecord
from tests.storm.touching import TouchWatch

SAMPLE = 0.02
"""Seconds between two looks at the truth."""


@dataclass(slots=True)
class Truth:
    """How everything truly is at a ``time``.

    There are the ``speeds`` of the base (m/s, rad/s), and the ``angles`` (radians) of every axis of every head and arm
    by part and name. ``by_hand`` says that no mission has the wheels, ``latched`` that the base stands until it is
    enabled (as it does where there is none), ``weak`` that its battery is below what its reflexes call critical.
    """

    time: float
    speeds: tuple[float, float]
    by_hand: bool
    angles: Mapping[tuple[str, str], float]
    latched: bool = True
    weak: bool = False


@dataclass(slots=True)
class Witness:
    """All that is known of one run. It is a listener of the run's events, and is told of its moments.

    ``claimed`` says at which times each part was a running leaf's, ``back`` when it came back; ``ended`` is when the
    mission was over, ``lag`` by how much later the wheels obey. ``at_command`` is called at each command, within the
    tick that it comes from. ``touching`` looks at what a base with a range guard drives into.
    """

    history: CaseHistory = field(default_factory=CaseHistory)
    tick_records: list[TickRecord] = field(default_factory=list)
    samples: list[Truth] = field(default_factory=list)
    claimed: dict[str, list[float]] = field(default_factory=dict)
    back: dict[str, list[float]] = field(default_factory=dict)
    struck: list[FaultSpec] = field(default_factory=list)
    ended: float = 0.0
    seed: int = 0
    lag: float = 0.0
    left: list[str] = field(default_factory=list)
    is_complete: bool = True
    leaves: Mapping[str, Leaf] = field(default_factory=dict)
    record: StormRecord | None = None
    at_command: Callable[[], object] = ignore
    touching: TouchWatch | None = None
    _runner: Runner | None = None
    _left: set[str] = field(default_factory=set)  # by one that meant to leave it moving
    _claiming: set[str] = field(default_factory=set)  # as of the last tick: also while none comes

    def watch(self, runner: Runner) -> None:
        """Look at a run from now on, on its own timeline."""
        self._runner = runner
        self.leaves = {leaf.key: leaf for leaf in runner.root.iterate() if isinstance(leaf, Leaf)}
        base = self.twins.base
        self.history.attach(runner.root, None if base is None else lambda: base.body.velocity)
        keys, finder = self.config.base, self.config.range
        if (
            base is not None
            and keys is not None
            and finder is not None
            and "range" in self.twins.parts
            and keys.has_range_guard
        ):
            self.touching = TouchWatch(
                self.twins.world, base, finder.place, acceleration=keys.acceleration, height=finder.position[2]
            )
        self.twins.timeline.call_every(SAMPLE, self._sample)

    def __call__(self, event: Event) -> None:
        """Take in one event."""
        self.history(event)
        if self.record is not None:
            self.record(event)
        if isinstance(event, CommandSent) and self.runner.root.run.active_leaf is not None:
            if (leaf := self.leaf(event)) is not None:
                self._claims(leaf, event.t)  # of one that begins in this tick, which hangs, nobody is told yet
            self.at_command()  # not where a device tells of itself: its own thread goes on while a tick hangs
        if isinstance(event, NodeChanged) and event.status != "idle" and event.node in self.leaves:
            leaf = self.leaves[event.node]
            self._claims(leaf, event.t)
            way = getattr(leaf, "way", "")
            if not (event.status == "failure" and way == STOPS_NOT and getattr(leaf, "hopeless", False)):
                self._left -= leaf.claims  # what was left moving goes on where nothing but refusals came of it
            if event.status == "success" and way == LEFT:
                self._left |= leaf.claims
        elif isinstance(event, Ticked):
            running = (leaf for leaf in self.leaves.values() if leaf.status is RUNNING or leaf.is_acting)
            self._claiming = {part for leaf in running for part in leaf.claims}
        elif isinstance(event, FaultRaised) and event.status == "online":
            self.back.setdefault(event.part, []).append(event.t)

    def moment(self, moment: TickRecord) -> None:
        """Keep a moment."""
        self.tick_records.append(moment)
        if self.record is not None:
            self.record.moment(moment)

    def _claims(self, leaf: Leaf, time: float) -> None:
        for part in leaf.claims:
            self.claimed.setdefault(part, []).append(time)

    # --- what a record has (missions.plugins.records.replay.rerun.RerunSource)

    @property
    def events(self) -> list[Event]:
        """All that happened."""
        return self.history.events

    # --- for invariants ----------------------------------------------------------------------------------------------

    @property
    def runner(self) -> Runner:
        """The run."""
        if self._runner is None:
            raise RuntimeError("nothing is watched yet")
        return self._runner

    @property
    def twins(self) -> Any:
        """The twins of the run."""
        return self.runner.twins

    @property
    def config(self) -> RobotConfig:
        """The robot."""
        return self.runner.config

    @property
    def commands(self) -> list[CommandSent]:
        """What parts were told."""
        return [event for event in self.events if isinstance(event, CommandSent)]

    def kind(self, part: str) -> str:
        """Return what a part is, which may go by a name of its own."""
        return self.config.extra_parts.get(part, part)

    def leaf(self, command: CommandSent) -> Leaf | None:
        """Return who gave a command; None for what is no leaf."""
        return self.leaves.get(command.source.rpartition("(")[2].rstrip(")"))

    def digest(self, folder: str) -> str:
        """Return a fingerprint of all that happened, wherever the files of the run were."""
        found = hashlib.sha256()
        for event in self.events:
            told = {**event.as_dict(), **({"file": ""} if isinstance(event, Started) else {})}
            found.update(json.dumps(told, default=str, sort_keys=True).replace(folder, "").encode())
        for sample in self.samples:
            found.update(repr((sample.time, sample.speeds, sorted(sample.angles.items()))).encode())
        return found.hexdigest()

    def _sample(self) -> None:
        twins, now = self.twins, self.twins.timeline.clock.now()
        for part in self._claiming | self._left if not self.ended else ():
            self.claimed.setdefault(part, []).append(now)
        if self.touching is not None:
            parts = twins.parts
            self.touching.look(now, scans=parts["range"].plug.online and parts["base"].plug.online)
        speeds, by_hand, latched, weak = (0.0, 0.0), False, True, False
        angles: dict[tuple[str, str], float] = {}
        for part, twin in twins.parts.items():
            if part == "base":
                velocity = twin.body.velocity
                speeds, source = (velocity.linear, velocity.angular), twin.steering().source
                by_hand = source is not None and source != "mission"
                latched, weak = bool(twin.latched), self._weak(twin.state())
            elif self.kind(part) == "arm":
                angles |= {(part, joint): twin.true_angle(joint, now) for joint in twin.limits}
            elif hasattr(twin, "true_pose"):
                pose = twin.true_pose(now)
                angles |= {(part, "pan"): pose.pan, (part, "tilt"): pose.tilt}
        self.samples.append(Truth(now, speeds, by_hand, angles, latched, weak))

    def _weak(self, reading: Reading[BaseState]) -> bool:
        state, base = reading.value, self.config.base
        if state is None or base is None or not reading.good or state.charging:
            return False
        return state.battery_percent < base.reflexes.battery_critical
