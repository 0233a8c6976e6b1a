"""A run from beginning to end: read the mission, put the robot together, tick, and leave everything at rest."""

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from math import inf
from pathlib import Path
from typing import Literal

from behaviours.node import Node
from behaviours.run import Run, log
from config.library import find
from config.robot import RobotConfig, load_robot
from config.world import WorldConfig, load_world
from drivers.api import Notice
from drivers.clock import SystemClock
from drivers.errors import NotConnected
from drivers.sim.timeline import Timeline
from missions.assembly.assemble import Ears, Wishes, assemble
from missions.assembly.assembled import Assembled
from missions.assembly.interests import interests_of
from missions.assembly.parts import reflexes
from missions.assembly.target import target_of
from missions.assembly.twinning import twin_robot
from missions.assembly.twins import Twins
from missions.executive.build import Substitute, as_it_is, build
from missions.executive.commands import robot_for
from missions.executive.events import FaultRaised, Listener, Stream
from missions.executive.executive import Executive, Result
from missions.executive.guard import Guard
from missions.executive.pace import Pace
from missions.executive.signals import Signals
from missions.executive.state import state_of
from missions.executive.telling import Teller, logging_to
from missions.executive.watchdog import Limits, Watchdog, attempt_all
from missions.language.plan import Plan
from missions.library import load_mission
from missions.vocabulary import vocabulary

DEFAULT_ROBOT = "turtlebot2_arm"
DEFAULT_WORLD = "living_room"

CONNECT_TIME = 6.0
"""Seconds that the parts of a robot have to appear: a board that boots needs two, a servo bus a second."""

REMARK_TIME = 1.0
"""Seconds after which a part that is still missing is mentioned."""

CLOSE_TIME = 3.0
"""Seconds that devices have to close when a run is given up while its main thread hangs."""

PATIENT = Limits(slow=inf, stall=inf, fail=10.0)
"""What holds in simulated time, by the clock on the wall: there is nothing to keep still, and a machine that was busy
for half a second must not make two runs differ."""

Simulate = Literal["wire", "fast"]
"""How a robot is simulated: real drivers over virtual devices in real time, or twins in simulated time."""


@dataclass(frozen=True, slots=True)
class Order:
    """What to run, and on what: names as the user gives them. Without a ``robot`` the default one is simulated.

    In simulated time ``speed`` is how many times faster than real time it goes at most, and ``eyes`` say whether
    pictures are drawn and searched ("pixels") or faces are known from the world ("truth").
    ``behaviours`` are files of Python with leaves of the user's own. ``pad`` is the node of a game pad that takes the
    wheels, in real time only.
    """

    mission: str
    params: Mapping[str, str] = field(default_factory=dict)
    robot: str | None = None
    simulate: Simulate | None = None
    world: str | WorldConfig | None = None
    camera: str | None = None
    ports: Mapping[str, str] = field(default_factory=dict)
    seed: int = 0
    behaviours: Sequence[Path] = ()
    eyes: Literal["pixels", "truth"] = "pixels"
    speed: float = inf
    pad: str | None = None

    @property
    def simulation(self) -> Simulate | None:
        """How the robot is simulated, None when the real one moves."""
        return "wire" if self.simulate is None and self.robot is None else self.simulate


def end_process(result: Result) -> None:
    """End this process here and now, whatever its other threads do, with the exit code that belongs to ``result``."""
    os._exit(130 if result.result == "interrupted" else 1)


class Runner:
    """One run of one mission. Make it (which reads and checks everything), then ``run`` it, once.

    ``give_up`` is called, from the watchdog's thread, once the robot is closed because the main thread hangs for good.
    ``substitute`` may put another leaf in the place of each: a mock. ``twins`` are the robot in simulated time.
    ``plan`` is the order's mission where that was loaded before: a plan can be run any number of times.
    Raises InvalidFileError or UnknownNameError for what is wrong with the files; nothing has been opened then.
    """

    def __init__(
        self,
        order: Order,
        *,
        listeners: Sequence[Listener] = (),
        limits: Limits | None = None,
        give_up: Callable[[Result], None] = end_process,
        substitute: Substitute = as_it_is,
        plan: Plan | None = None,
    ) -> None:
        config = load_robot(find("robots", order.robot or DEFAULT_ROBOT))
        self.plan: Plan = load(order, config) if plan is None else plan
        self.stream = Stream(listeners)
        self._give_up = give_up
        self.twins: Twins | None = None
        if order.simulation == "fast":
            timeline = Timeline()
            self._context = Run(timeline.clock, seed=order.seed, wall=SystemClock())
            self._tell = Teller(self._context, self.stream)
            self._context.let_pass = Pace(self._context, timeline, speed=order.speed)
            self.twins, self._robot = self._twins(config, order, timeline)
        else:
            self._context = Run(SystemClock(), seed=order.seed)
            self._tell = Teller(self._context, self.stream)
            self._robot = self._assemble(config, order)
        self._context.settle = self._robot.settle
        guard = self._guard(config)
        self._context.variables.update(state_of(self._robot.robot, self._context.clock, guard))
        self.watchdog = Watchdog(
            self._context,
            self.stream,
            still={part: partial(self._robot.settle, frozenset({part})) for part in ("base", "head", "arm")},
            heard=self._heard,
            abandon=self._abandon,
            limits=PATIENT if limits is None and self.twins is not None else limits,
        )
        permit = self.watchdog.permit
        self.root: Node = build(
            self.plan,
            self._context,
            lambda leaf: robot_for(leaf, self._robot.robot, self._tell.commanded, permit),
            substitute=substitute,
        )
        self.executive = Executive(
            self.root,
            self._context,
            self.stream,
            rate=config.rate,
            mission=self.plan.mission,
            guard=guard,
        )
        self._signals = Signals(self.executive.stop)

    def _assemble(self, config: RobotConfig, order: Order) -> Assembled:
        world = None if order.simulation is None else _world(order)
        interests = interests_of(self.plan.tree, config.camera)
        wishes = Wishes(world, order.camera, order.ports, order.seed, interests, order.pad)
        return assemble(config, self.plan.tree.parts, self._context.clock, wishes, self._ears)

    def _twins(self, config: RobotConfig, order: Order, timeline: Timeline) -> tuple[Twins, Assembled]:
        return twin_robot(
            config,
            self.plan.tree.parts,
            timeline,
            _world(order),
            self._ears,
            interests=interests_of(self.plan.tree, config.camera),
            seed=order.seed,
            truth=order.eyes == "truth",
        )

    def _guard(self, config: RobotConfig) -> Guard | None:
        """Return who looks at the base, where the mission uses one."""
        base = self._robot.robot.base_part
        if base is None or config.base is None:
            return None
        return Guard(base, reflexes(config.base), self._context, self.stream)

    @property
    def _ears(self) -> Ears:
        tell = self._tell
        return Ears(tell.noticed, self._context.wake, tell.said, tell.seen, tell.answered, tell.steered)

    def run(self) -> Result:
        """Run the mission until it ends, or a signal ends it; whatever happens, the robot is left at rest.

        Raises NotConnected when a part of the robot does not appear; its message names all that are missing.
        """
        if self.twins is None:  # in simulated time all is told at once, in the one order that there is
            self.stream.open()
        self.executive.tell_start(file=self.plan.source.name, robot=self._robot.name, params=self.plan.params)
        result = Result(self.plan.mission, "error", "", 0.0, 0)
        self._context.interruptible = False  # signals are taken here: a KeyboardInterrupt is a leaf's own
        try:
            with self._signals, logging_to(self._tell.logged), self.watchdog, self.ready():
                self._context.beat()
                self.watchdog.armed = True
                result = self.executive.loop()
        except Exception as error:
            reason = str(error) or type(error).__name__
            result = Result(self.plan.mission, "error", reason, self.executive.time(), self._context.tick)
            raise
        finally:
            self.executive.tell_end(result)
            self.stream.close()
        return result

    @contextmanager
    def ready(self) -> Iterator[None]:
        """Open the robot and wait for its parts; in the end bring it to rest and close it, whatever happened.

        Raises NotConnected with all parts that do not appear.
        """
        self._context.beat()
        try:
            self._robot.open()
            self._connect()
            yield
        finally:
            self.watchdog.armed = False
            self._context.beat()
            self._close()

    def _heard(self) -> str | None:
        return self._signals.heard()

    def _abandon(self, outcome: str, reason: str) -> None:
        """Close the robot for a main thread that hangs. No device waits for another, nor anything for ever."""
        result = Result(self.plan.mission, outcome, reason, self.executive.time(), self._context.tick)
        robot = self._robot
        closing = {name: device.close for name, device in robot.devices.items()}
        attempt_all(closing if robot.eyes is None else {**closing, "eyes": robot.eyes.close}, CLOSE_TIME)
        if robot.simulation is not None:
            attempt_all({"simulation": robot.simulation.close}, CLOSE_TIME)
        self.executive.tell_end(result)
        attempt_all({"events": self.stream.close}, CLOSE_TIME)
        self._give_up(result)

    def _connect(self) -> None:
        """Wait until every part is there. Raises NotConnected with all that are not."""
        begun = self._context.now()
        mentioned: set[str] = set()
        while (missing := self._robot.missing()) and not self.executive.stopping:
            waited = self._context.now() - begun
            for part, (detail, hint) in missing.items():
                if waited > REMARK_TIME and part not in mentioned:
                    mentioned.add(part)
                    self._tell.noticed(
                        Notice(part, "offline", f"waiting for it: {detail.removeprefix(f'{part}: ')}", hint)
                    )
            if waited > CONNECT_TIME:
                details = "\n".join(f"  {detail}" for detail, _ in missing.values())
                hints = dict.fromkeys(hint for _, hint in missing.values() if hint)
                raise NotConnected(f"{self._robot.name} is not complete:\n{details}", hint="\n       ".join(hints))
            self._context.let_pass(0.02)
            self._context.woken.clear()
            self._context.beat()

    def _close(self) -> None:
        for problem in self._robot.close():
            log.error("%s", problem)
            part, _, detail = problem.partition(": ")
            self.stream.emit(FaultRaised(self.executive.time(), part, "fault", detail))


def load(order: Order, robot: RobotConfig) -> Plan:
    """Read and check the mission of ``order`` for a robot. Raises InvalidFileError or UnknownNameError."""
    return load_mission(
        order.mission,
        params=order.params,
        complete=True,
        robot=target_of(robot),
        leaves=vocabulary(order.behaviours),
    )


def _world(order: Order) -> WorldConfig:
    if isinstance(order.world, WorldConfig):
        return order.world
    return load_world(find("worlds", order.world or DEFAULT_WORLD))
