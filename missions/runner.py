"""A run from beginning to end: read the mission, put the robot together, tick, and leave everything at rest."""

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext, suppress
from functools import partial
from math import inf
from typing import TYPE_CHECKING

from py_trees.common import Status

from behaviours.leaf import Leaf
from behaviours.node import Node
from behaviours.robot import Robot
from behaviours.run import Run, log
from config.robot import RobotConfig
from config.units import written
from drivers.api import DeviceStatus
from drivers.api.sections import Wired
from drivers.clock import Clock, SystemClock
from drivers.errors import BadRequest
from drivers.transport.loop import guarded
from missions.assembly.assembled import Assembled
from missions.assembly.together import Hooks, Overrides
from missions.executive.answers import Answers
from missions.executive.asked import Decided, asked, robot_for
from missions.executive.build import Substitute, as_it_is, build
from missions.executive.events import FaultRaised
from missions.executive.executive import Executive, OnMoment, Result
from missions.executive.guard import Guard
from missions.executive.signals import Lifeline, Signals
from missions.executive.state import state_of
from missions.executive.stop_latch import StopLatch
from missions.executive.stream import Listener, Stream
from missions.executive.telling import Teller, logging_to
from missions.executive.watchdog import Limits, Watchdog, attempt_all
from missions.language.plan import Plan
from missions.library.drivers import robot_named
from missions.library.interests import interests_of
from missions.library.shipped import behaviour_files, load_mission
from missions.library.target import target_of, target_of_parts
from missions.library.vocabulary import vocabulary
from missions.request import RunRequest
from perception.api import Frame, Gaze, View, ignore

if TYPE_CHECKING:
    from missions.assembly.twins import Twins
    from missions.executive.pace import PausedPace

CLOSE_TIME = 3.0
"""Seconds that devices have to close when a run is given up while its main thread hangs."""

PATIENT = Limits(slow=inf, stall=inf, fail=10.0)
"""The limits in simulated time, by the clock on the wall: there is nothing to keep still, and a machine that was busy
for half a second must not make two runs differ."""


OURS = frozenset({"behaviours", "config", "drivers", "missions", "perception"})
"""Packages whose leaves and devices never hold up a tick in simulated time."""


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
        order: RunRequest,
        *,
        listeners: Sequence[Listener] = (),
        limits: Limits | None = None,
        give_up: Callable[[Result], None] = end_process,
        substitute: Substitute = as_it_is,
        plan: Plan | None = None,
    ) -> None:
        self.order = order
        self.config = robot_of(order)
        self._observers: tuple[object, ...] = ()
        self._on_view: list[Callable[[View], None]] = []
        self._on_frame: list[Callable[[Frame, Gaze | None], None]] = []
        self.plan: Plan = load(order, self.config) if plan is None else plan
        self.stream = Stream(listeners)
        self._give_up = give_up
        self.twins: Twins | None = None
        self.paused_pace: PausedPace | None = None  # in simulated time
        self._context, self._robot = self._simulated(order) if order.simulation == "fast" else self._real(order)
        self._context.sensor_timeout = self.config.sensor_timeout
        self._context.safe_stop = self._robot.safe_stop
        self.watchdog = self._watchdog(PATIENT if limits is None and order.simulation == "fast" else limits)
        robot = self._robot
        self.latch = StopLatch(
            robot.devices, robot.stilled, robot.robot.base_part, robot.safe_stop, self._hold, self.watchdog.permit
        )
        self.root, self.executive = self._executive(substitute)
        self._process = os.getpid()
        self._is_watched = limits is not None or not (order.is_batch and self._is_ours())
        self._is_watching = False
        self.is_reachable = False
        """Whether a control socket serves this run, by which it can be stopped."""
        self._signals = Signals(self._request_stop, with_socket=self._is_watched)
        self._lifeline = Lifeline(self._signals)

    def _end(self, time: float) -> None:
        """Stop a run that still goes on at ``time`` (s), and name the leaves that are running."""
        leaves = [
            f"{node.name} (line {node.line})"
            for node in self.root.iterate()
            if isinstance(node, Leaf) and node.status is Status.RUNNING
        ]
        reason = f"still running after {written(time, 'duration')} of simulated time: {', '.join(leaves)}"
        self.executive.stop(reason)

    def _watchdog(self, limits: Limits | None) -> Watchdog:
        """Return who keeps the robot still while a tick hangs."""
        return Watchdog(
            self._context,
            self.stream,
            still={part: partial(self._robot.safe_stop, frozenset({part})) for part in self._robot.moving},
            heard=self._heard,
            abandon=self._abandon,
            limits=limits,
        )

    def _executive(self, substitute: Substitute) -> tuple[Node, Executive]:
        """Return the tree of the plan, whose leaves ask and command the robot through proxies, and what ticks it."""
        answers = Answers()
        robot = asked(self._robot.robot, answers, Decided(self._context, self.latch.permit))
        guard = self._guard(self.config, robot)
        self._context.variables.update(state_of(robot, self._context, guard))
        root = build(
            self.plan,
            self._context,
            lambda leaf: robot_for(leaf, robot, self._tell.commanded),
            substitute=substitute,
        )
        executive = Executive(
            root,
            self._context,
            self.stream,
            rate=self.config.rate,
            mission=self.plan.mission,
            guard=guard,
            answers=answers,
            after_tick=self._mind,
        )
        if self.paused_pace is not None:
            executive.idle = self.paused_pace
        if self.order.until is not None and self.twins is not None:
            self.twins.timeline.at(self.order.until, partial(self._end, self.order.until))
        return root, executive

    def _real(self, order: RunRequest) -> tuple[Run, Assembled]:
        """Return the run and the robot in real time: on the metal, or on virtual devices."""
        from missions.assembly.assemble import assemble  # noqa: PLC0415 - simulated time opens no port

        world = None if order.simulation is None else order.world_file()
        interests = interests_of(self.plan.tree, self.config.camera)
        overrides = Overrides(world, order.camera, order.ports, order.seed, interests)
        run = Run(overrides.clock(), seed=order.seed)
        self._tell = Teller(run, self.stream)
        return run, assemble(self.config, self.plan.tree.parts, run.clock, overrides, self._hooks(run))

    def _simulated(self, order: RunRequest) -> tuple[Run, Assembled]:
        """Return the run and the robot in simulated time."""
        from drivers.sim.timeline import Timeline  # noqa: PLC0415 - the metal imports no simulation
        from missions.assembly.twinning import twin_robot  # noqa: PLC0415
        from missions.executive.pace import Pace, PausedPace  # noqa: PLC0415

        timeline = Timeline()
        run = Run(timeline.clock, seed=order.seed, wall=SystemClock())
        self._tell = Teller(run, self.stream)
        run.wait = Pace(run, timeline, speed=order.speed)
        self.twins, robot = twin_robot(
            self.config,
            self.plan.tree.parts,
            timeline,
            order.world_file(),
            self._hooks(run),
            interests=interests_of(self.plan.tree, self.config.camera),
            seed=order.seed,
            truth=order.eyes == "truth",
            physics=order.physics,
        )
        self.paused_pace = PausedPace(run, timeline, robot.robot, speed=order.speed)
        return run, robot

    def _guard(self, config: RobotConfig, robot: Robot) -> Guard | None:
        """Return who looks at the base, where the mission uses one."""
        if robot.base_part is None or config.base is None:
            return None
        return Guard(robot.base_part, config.base.reflexes, self._context, self.stream, self.latch.enable)

    def _hold(self, held: bool) -> None:
        self.executive.hold(held=held)

    def _hooks(self, run: Run) -> Hooks:
        tell = self._tell
        return Hooks(tell.noticed, run.wake, tell.said, self._seen, tell.answered, tell.steered, watched=self._searched)

    def _seen(self, view: View) -> None:
        for on_view in self._on_view:
            on_view(view)
        self._tell.seen(view)

    def _searched(self, frame: Frame, gaze: Gaze | None) -> None:
        for on_frame in self._on_frame:
            on_frame(frame, gaze)

    def observe(
        self,
        on_moment: OnMoment | None = None,
        on_view: Callable[[View], None] = ignore,
        on_frame: Callable[[Frame, Gaze | None], None] = ignore,
    ) -> None:
        """Have a run observed that has not begun.

        ``on_moment`` gets the record of each tick, with all input from outside; ``on_view`` what perception finds, and
        ``on_frame`` each picture that it has searched, on the threads of the eyes.
        One that raises is logged once; the run goes on.
        """
        self._observers += (on_moment, on_view, on_frame)
        if on_moment is not None:
            self.executive.observe(guarded(on_moment))
        self._on_view.append(guarded(on_view))
        self._on_frame.append(guarded(on_frame))

    def report(self, notice: DeviceStatus) -> None:
        """Take notice of a device, as of one of the robot's own."""
        self._tell.noticed(notice)

    @property
    def assembled(self) -> Assembled:
        """The robot that it runs on, put together."""
        return self._robot

    @property
    def clock(self) -> Clock:
        """The run's clock: it counts the seconds of all that a run tells."""
        return self._context.clock

    def run(self) -> Result:
        """Run the mission until it ends, or a signal ends it; whatever happens, the robot is left at rest.

        Raises NotConnected when a part of the robot does not appear; its message names all that are missing.
        """
        if self.twins is None:  # in simulated time all is told at once, in the one order that there is
            self.stream.open()
        # Listeners and observers of plug-ins have come since this was made.
        self._is_watched |= not all(map(_is_ours, (*self.stream.listeners, *self._observers)))
        self._signals.with_socket = self._is_watched
        self.executive.tell_start(file=self.plan.source.name, robot=self._robot.name, params=self.plan.params)
        result = Result(self.plan.mission, "error", "", 0.0, 0)
        self._process = os.getpid()
        self._context.interruptible = False  # signals are taken here: a KeyboardInterrupt is a leaf's own
        try:
            line = nullcontext() if self.twins is not None else self._lifeline  # nothing moves there
            with self._signals, line, logging_to(self._tell.logged), self._watching(), self.ready():
                self._context.beat()
                self.watchdog.armed = True
                if self._robot.eyes is not None:
                    self._robot.eyes.may_rest = True
                result = self.executive.loop()
        except Exception as error:
            reason = str(error) or type(error).__name__
            result = Result(self.plan.mission, "error", reason, self.executive.time(), self._context.tick)
            raise
        finally:
            self.executive.tell_end(result)
            self.stream.close()
        return result

    def _is_ours(self) -> bool:
        """Return True if all leaves and devices are MissionTree's own: they never hold up a tick in simulated time."""
        parts = [*(node for node in self.root.iterate() if isinstance(node, Leaf)), *self._robot.devices.values()]
        return all(map(_is_ours, parts))

    @contextmanager
    def _watching(self) -> Iterator[None]:
        """Have the watchdog look while this is entered; where nothing can hang, from the first signal on."""
        self._is_watching = True
        try:
            if self._is_watched:
                self.watchdog.start()
            yield
        finally:
            self._is_watching = False  # before the stop: a watchdog that is started later ends the process
            self.watchdog.stop()

    def _request_stop(self, word: str) -> None:
        self.executive.stop(word)
        if self._is_watching:
            with suppress(RuntimeError):  # Python in a browser has no threads
                self.watchdog.start()

    @contextmanager
    def ready(self) -> Iterator[None]:
        """Open the robot and wait for its parts; in the end bring it to rest and close it, whatever happened.

        Raises NotConnected with all parts that do not appear, and BadRequest for hardware that no stop can reach.
        """
        if self.order.simulation is None and not (self.is_reachable or self.order.without_stop):
            what = f"mission '{self.plan.mission}': `mission stop` cannot reach this run, and the robot would move"
            raise BadRequest(what, hint="run it by missions.run or `mission run`, or within a ControlSocket")
        self._context.beat()
        try:
            self._robot.open()
            self._robot.wait_until_complete(self._context, self._tell.noticed, lambda: self.executive.stopping)
            yield
        finally:
            self.watchdog.armed = False
            self._context.beat()
            self._close()

    def _mind(self) -> None:
        """Undo what a behaviour has done to the process: a fork ends, and the signals that end a run are taken back."""
        self._leave_if_forked()
        if taken := self._signals.retake():
            detail = f"a behaviour had taken {', '.join(taken)}, by which a run is ended: taken back"
            self.stream.emit(FaultRaised(self.executive.time(), "executive", "fault", detail))

    def _leave_if_forked(self) -> None:
        """End a process that a behaviour has forked, here and now: it has the robot's ports, and its parent drives."""
        if os.getpid() != self._process:
            os._exit(1)

    def _heard(self) -> str | None:
        self._lifeline.beat()
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

    def _close(self) -> None:
        self._leave_if_forked()
        for problem in self._robot.close():
            log.error("%s", problem)
            part, _, detail = problem.partition(": ")
            self.stream.emit(FaultRaised(self.executive.time(), part, "fault", detail))


def _is_ours(part: object) -> bool:
    """Return True if a leaf, a device or a listener is MissionTree's own, or built into Python."""
    while isinstance(part, partial):
        part = part.func
    module = getattr(part, "__module__", None)
    return module is None or module.partition(".")[0] in OURS


def robot_of(order: RunRequest) -> RobotConfig:
    """Read the file of the order's robot. Raises InvalidFileError or UnknownNameError."""
    return robot_named(order.robot, order.ros2_domain)


def ports_of(order: RunRequest) -> Sequence[str]:
    """Return the parts of the order's robot under names of their own that have a port. Raises as ``robot_of`` does."""
    robot = robot_of(order)
    return [name for name in robot.others if isinstance(robot.sections[name].keys, Wired)]


def load(order: RunRequest, robot: RobotConfig | Robot | None) -> Plan:
    """Read and check the mission of ``order``, for a robot of a file, one that is there, or any.

    Raises InvalidFileError or UnknownNameError.
    """
    return load_mission(
        order.mission,
        params=order.params,
        complete=True,
        robot=target_of_parts(robot) if isinstance(robot, Robot) else None if robot is None else target_of(robot),
        leaves=vocabulary(behaviour_files(order.mission, order.behaviours), order.behaviours),
    )
