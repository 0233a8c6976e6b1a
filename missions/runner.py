"""Execution of one run of a mission: read the files, assemble the robot, tick, and leave the robot at rest."""

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
from behaviours.run import RunState, log
from config.robot import RobotConfig
from config.units import quantity_text
from drivers.api import DeviceStatus
from drivers.api.sections import SerialKeys
from drivers.clock import Clock, SystemClock
from drivers.errors import BadRequest
from drivers.transport.loop import guard_callback
from missions.assembly.assembled_robot import AssembledRobot
from missions.assembly.part_factory import Hooks, Overrides
from missions.executive.build import Substitute, build, keep_leaf
from missions.executive.event_reporter import EventReporter, capture_log
from missions.executive.events import FaultRaised
from missions.executive.executive import Executive, Result, TickObserver
from missions.executive.guard import BaseGuard
from missions.executive.proxied_robot import StaleCommandGuard, robot_for, with_proxies
from missions.executive.signals import Lifeline, SignalHandler
from missions.executive.state import state_of
from missions.executive.stop_latch import StopLatch
from missions.executive.stream import EventStream, Listener
from missions.executive.tick_cache import TickCache
from missions.executive.watchdog import Watchdog, WatchdogLimits, attempt_all
from missions.language.plan import Plan
from missions.library.drivers import load_named_robot
from missions.library.interests import interests_of
from missions.library.shipped import behaviour_files, load_mission
from missions.library.target import target_of, target_of_parts
from missions.library.vocabulary import load_leaves
from missions.request import RunRequest
from perception.api import Frame, Gaze, View, ignore

if TYPE_CHECKING:
    from missions.assembly.twins import Twins
    from missions.executive.pace import PausedPacer

CLOSE_TIMEOUT = 3.0
"""Seconds that devices have to close when the main thread hangs and the run is abandoned."""

SIMULATED_LIMITS = WatchdogLimits(slow=inf, stall=inf, fail=10.0)
"""Watchdog limits in simulated time, in seconds of the wall clock.

A leaf that blocks a tick fails only after 10 s: a busy computer must not make two equal runs differ.
"""


OWN_PACKAGES = frozenset({"behaviours", "config", "drivers", "missions", "perception"})
"""Packages of MissionTree. Their leaves and devices never block a tick in simulated time, so they need no watchdog."""


def end_process(result: Result) -> None:
    """End this process immediately, with the exit code of ``result``; other threads are not waited for."""
    os._exit(130 if result.result == "interrupted" else 1)


class Runner:
    """One run of one mission. The constructor reads and checks everything; then call ``run`` once.

    ``give_up`` is called from the watchdog's thread if the main thread hangs for good; the robot has been closed by
    then. ``substitute`` may replace each leaf, by a mock for example. ``plan`` is the checked mission if the caller has
    loaded it already; a plan can be run any number of times. The attribute ``twins`` holds the simulated devices, or
    None in real time. Raises InvalidFileError or UnknownNameError for invalid files, before anything is opened.
    """

    def __init__(
        self,
        request: RunRequest,
        *,
        listeners: Sequence[Listener] = (),
        limits: WatchdogLimits | None = None,
        give_up: Callable[[Result], None] = end_process,
        substitute: Substitute = keep_leaf,
        plan: Plan | None = None,
    ) -> None:
        self.request = request
        self.config = requested_robot(request)
        self._observers: tuple[object, ...] = ()
        self._on_view: list[Callable[[View], None]] = []
        self._on_frame: list[Callable[[Frame, Gaze | None], None]] = []
        self.plan: Plan = load_plan(request, self.config) if plan is None else plan
        self.stream = EventStream(listeners)
        self._give_up = give_up
        self.twins: Twins | None = None
        self.paused_pace: PausedPacer | None = None  # in simulated time
        self._context, self._robot = (
            self._assemble_simulated(request) if request.simulation == "fast" else self._assemble_real(request)
        )
        self._context.sensor_timeout = self.config.sensor_timeout
        self._context.safe_stop = self._stop_safely
        self.watchdog = self._watchdog(SIMULATED_LIMITS if limits is None and request.simulation == "fast" else limits)
        robot = self._robot
        self.latch = StopLatch(
            robot.devices,
            robot.stoppable_parts,
            robot.robot.base_part,
            robot.safe_stop,
            self._hold,
            self.watchdog.permit,
        )
        self.root, self.executive = self._executive(substitute)
        self._process = os.getpid()
        self._is_watched = limits is not None or not (request.is_batch and self._is_ours())
        self._is_watching = False
        self.is_reachable = False
        """Whether a control socket serves this run, by which it can be stopped."""
        self._signals = SignalHandler(self._request_stop, with_socket=self._is_watched)
        self._lifeline = Lifeline(self._signals)

    def _stop_safely(self, claims: frozenset[str]) -> None:
        """Stop actuators for a leaf that did not, and report it."""
        self._robot.safe_stop(claims)
        self._tell.on_safe_stop(claims)

    def _end(self, time: float) -> None:
        """Stop a run that still runs at ``time`` (s); the reason of its result names the running leaves."""
        leaves = [
            f"{node.name} (line {node.line})"
            for node in self.root.iterate()
            if isinstance(node, Leaf) and node.status is Status.RUNNING
        ]
        reason = f"still running after {quantity_text(time, 'duration')} of simulated time: {', '.join(leaves)}"
        self.executive.stop(reason)

    def _watchdog(self, limits: WatchdogLimits | None) -> Watchdog:
        """Return the watchdog that stops the robot while a tick hangs."""
        return Watchdog(
            self._context,
            self.stream,
            stop_actions={part: partial(self._robot.safe_stop, frozenset({part})) for part in self._robot.moving_parts},
            first_signal=self._poll_signals,
            abandon=self._abandon,
            limits=limits,
        )

    def _executive(self, substitute: Substitute) -> tuple[Node, Executive]:
        """Return the tree of the plan, whose leaves use the robot through proxies, and the executive that ticks it."""
        answers = TickCache()
        robot = with_proxies(self._robot.robot, answers, StaleCommandGuard(self.latch.permit))
        guard = self._guard(self.config, robot)
        self._context.variables.update(state_of(robot, self._context, guard))
        root = build(
            self.plan,
            self._context,
            lambda leaf: robot_for(leaf, robot, self._tell.on_command),
            substitute=substitute,
        )
        executive = Executive(
            root,
            self._context,
            self.stream,
            rate=self.config.rate,
            mission=self.plan.mission,
            guard=guard,
            cache=answers,
            after_tick=self._undo_process_changes,
        )
        if self.paused_pace is not None:
            executive.idle = self.paused_pace
        if self.request.until is not None and self.twins is not None:
            self.twins.timeline.call_at(self.request.until, partial(self._end, self.request.until))
        return root, executive

    def _assemble_real(self, request: RunRequest) -> tuple[RunState, AssembledRobot]:
        """Return a new run state and the robot in real time: on the hardware, or on virtual devices."""
        from missions.assembly.assemble import assemble  # noqa: PLC0415 - simulated time opens no port

        world = None if request.simulation is None else request.world_file()
        interests = interests_of(self.plan.tree, self.config.camera)
        overrides = Overrides(world, request.camera, request.ports, request.seed, interests)
        run = RunState(overrides.clock(), seed=request.seed)
        self._tell = EventReporter(run, self.stream)
        return run, assemble(self.config, self.plan.tree.parts, run.clock, overrides, self._hooks(run))

    def _assemble_simulated(self, request: RunRequest) -> tuple[RunState, AssembledRobot]:
        """Return a new run state and the robot in simulated time."""
        from drivers.sim.timeline import Timeline  # noqa: PLC0415 - the metal imports no simulation
        from missions.assembly.twin_assembly import twin_robot  # noqa: PLC0415
        from missions.executive.pace import PausedPacer, SimulationPacer  # noqa: PLC0415

        timeline = Timeline()
        run = RunState(timeline.clock, seed=request.seed, wall=SystemClock())
        self._tell = EventReporter(run, self.stream)
        run.wait = SimulationPacer(run, timeline, speed=request.speed)
        self.twins, robot = twin_robot(
            self.config,
            self.plan.tree.parts,
            timeline,
            request.world_file(),
            self._hooks(run),
            interests=interests_of(self.plan.tree, self.config.camera),
            seed=request.seed,
            truth=request.eyes == "truth",
            physics=request.physics,
        )
        self.paused_pace = PausedPacer(run, timeline, robot.robot, speed=request.speed)
        return run, robot

    def _guard(self, config: RobotConfig, robot: Robot) -> BaseGuard | None:
        if robot.base_part is None or config.base is None:
            return None
        return BaseGuard(robot.base_part, config.base.reflexes, self._context, self.stream, self.latch.enable)

    def _hold(self, held: bool) -> None:
        self.executive.hold(held=held)

    def _hooks(self, run: RunState) -> Hooks:
        tell = self._tell
        return Hooks(
            tell.on_notice,
            run.wake,
            tell.on_speech,
            self._report_view,
            tell.on_person_speech,
            tell.on_steering,
            on_frame=self._report_frame,
        )

    def _report_view(self, view: View) -> None:
        for on_view in self._on_view:
            on_view(view)
        self._tell.on_view(view)

    def _report_frame(self, frame: Frame, gaze: Gaze | None) -> None:
        for on_frame in self._on_frame:
            on_frame(frame, gaze)

    def observe(
        self,
        on_tick: TickObserver | None = None,
        on_view: Callable[[View], None] = ignore,
        on_frame: Callable[[Frame, Gaze | None], None] = ignore,
    ) -> None:
        """Add observers before the run starts.

        ``on_tick`` gets the record of each tick, with all input from outside. ``on_view`` gets the percepts of each
        picture, and ``on_frame`` each picture that the detectors have searched; both are called on the threads of the
        eyes. If an observer raises an exception, it is logged once, and the run goes on.
        """
        self._observers += (on_tick, on_view, on_frame)
        if on_tick is not None:
            self.executive.observe(guard_callback(on_tick))
        self._on_view.append(guard_callback(on_view))
        self._on_frame.append(guard_callback(on_frame))

    def report(self, notice: DeviceStatus) -> None:
        """Report the status of a device as if it were one of the robot's own."""
        self._tell.on_notice(notice)

    @property
    def assembled_robot(self) -> AssembledRobot:
        """Robot of the run."""
        return self._robot

    @property
    def clock(self) -> Clock:
        """Clock of the run, which the times of all events refer to."""
        return self._context.clock

    def run(self) -> Result:
        """Run the mission until it ends, or until a signal ends it, and always leave the robot at rest.

        Raises NotConnected that lists all parts that do not appear.
        """
        if self.twins is None:  # in simulated time all is told at once, in the one order that there is
            self.stream.open()
        # Listeners and observers of plug-ins have come since this was made.
        self._is_watched |= not all(map(_is_ours, (*self.stream.listeners, *self._observers)))
        self._signals.with_socket = self._is_watched
        self.executive.emit_start(file=self.plan.source.name, robot=self._robot.name, params=self.plan.params)
        result = Result(self.plan.mission, "error", "", 0.0, 0)
        self._process = os.getpid()
        self._context.interruptible = False  # signals are taken here: a KeyboardInterrupt is a leaf's own
        try:
            line = nullcontext() if self.twins is not None else self._lifeline  # nothing moves there
            with self._signals, line, capture_log(self._tell.on_log), self._watchdog_running(), self.ready():
                self._context.record_heartbeat()
                self.watchdog.is_armed = True
                if self._robot.eyes is not None:
                    self._robot.eyes.may_rest = True
                result = self.executive.loop()
        except Exception as error:
            reason = str(error) or type(error).__name__
            result = Result(self.plan.mission, "error", reason, self.executive.time(), self._context.tick)
            raise
        finally:
            self.executive.emit_end(result)
            self.stream.close()
        return result

    def _is_ours(self) -> bool:
        """Return True if all leaves and devices are MissionTree's own, and need no watchdog in simulated time.

        They never block a tick there.
        """
        parts = [*(node for node in self.root.iterate() if isinstance(node, Leaf)), *self._robot.devices.values()]
        return all(map(_is_ours, parts))

    @contextmanager
    def _watchdog_running(self) -> Iterator[None]:
        """Run the watchdog within the context; if no leaf or device can hang, only from the first signal on."""
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
        """Open the robot and wait for its parts; at the end stop and close it in any case.

        Raises NotConnected that lists all parts that do not appear, and BadRequest for hardware that no stop can reach.
        """
        if self.request.simulation is None and not (self.is_reachable or self.request.without_stop):
            message = f"mission '{self.plan.mission}': `mission stop` cannot reach this run, and the robot would move"
            raise BadRequest(message, hint="run it by missions.run or `mission run`, or within a ControlSocket")
        self._context.record_heartbeat()
        try:
            self._robot.open()
            self._robot.wait_until_complete(self._context, self._tell.on_notice, lambda: self.executive.stopping)
            yield
        finally:
            self.watchdog.is_armed = False
            self._context.is_held = True  # no thread of a leaf moves anything while the parts close
            self._context.record_heartbeat()
            self._close()

    def _undo_process_changes(self) -> None:
        """Undo the changes of a behaviour to this process: end it if it is a forked copy; restore signal handlers."""
        self._leave_if_forked()
        if taken := self._signals.reinstall():
            detail = f"a behaviour had taken {', '.join(taken)}, by which a run is ended: taken back"
            self.stream.emit(FaultRaised(self.executive.time(), "executive", "fault", detail))

    def _leave_if_forked(self) -> None:
        """End this process if a behaviour has forked it: it shares the robot's ports with its parent, which drives."""
        if os.getpid() != self._process:
            os._exit(1)

    def _poll_signals(self) -> str | None:
        self._lifeline.beat()
        return self._signals.first_signal()

    def _abandon(self, outcome: str, reason: str) -> None:
        """Close the robot and end the run with the result ``outcome``, since the main thread hangs.

        The devices are closed in parallel, with a timeout.
        """
        result = Result(self.plan.mission, outcome, reason, self.executive.time(), self._context.tick)
        robot = self._robot
        closing = {name: device.close for name, device in robot.devices.items()}
        attempt_all(closing if robot.eyes is None else {**closing, "eyes": robot.eyes.close}, CLOSE_TIMEOUT)
        if robot.simulation is not None:
            attempt_all({"simulation": robot.simulation.close}, CLOSE_TIMEOUT)
        self.executive.emit_end(result)
        attempt_all({"events": self.stream.close}, CLOSE_TIMEOUT)
        self._give_up(result)

    def _close(self) -> None:
        self._leave_if_forked()
        for problem in self._robot.close():
            log.error("%s", problem)
            part, _, detail = problem.partition(": ")
            self.stream.emit(FaultRaised(self.executive.time(), part, "fault", detail))


def _is_ours(part: object) -> bool:
    """Return True if a leaf, device or listener is MissionTree's own, or built into Python."""
    while isinstance(part, partial):
        part = part.func
    module = getattr(part, "__module__", None)
    return module is None or module.partition(".")[0] in OWN_PACKAGES


def requested_robot(request: RunRequest) -> RobotConfig:
    """Return the robot that a request names. Raises InvalidFileError or UnknownNameError."""
    return load_named_robot(request.robot, request.ros2_domain)


def parts_with_ports(request: RunRequest) -> Sequence[str]:
    """Return the names of the robot's additional parts (such as a second arm) that have a port.

    Raises InvalidFileError or UnknownNameError.
    """
    robot = requested_robot(request)
    return [name for name in robot.extra_parts if isinstance(robot.sections[name].keys, SerialKeys)]


def load_plan(request: RunRequest, robot: RobotConfig | Robot | None) -> Plan:
    """Read and check the mission of a request. Raises InvalidFileError or UnknownNameError.

    ``robot`` is the robot to check it for: from a robot file, or an existing one; None for any robot.
    """
    return load_mission(
        request.mission,
        params=request.params,
        complete=True,
        robot=target_of_parts(robot) if isinstance(robot, Robot) else None if robot is None else target_of(robot),
        leaves=load_leaves(behaviour_files(request.mission, request.behaviours), request.behaviours),
    )
