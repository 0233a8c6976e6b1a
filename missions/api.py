"""Python API: a mission that you tick yourself, and a complete run.

The public names are also in ``missions``: ``missions.load``, ``missions.run``...; see there for examples.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import Literal, Self

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from behaviours.node import Node
from behaviours.py_trees_leaf import WrappedInstance
from behaviours.robot import Robot, hold_still
from behaviours.run import RunState, log
from drivers.api import Reflexes, ignore
from drivers.clock import SystemClock
from drivers.errors import BadRequest
from missions.control.control import ControlSocket
from missions.control.holders import WITHOUT_STOP
from missions.executive.build import build
from missions.executive.executive import Executive, Result
from missions.executive.guard import BaseGuard
from missions.executive.proxied_robot import robot_for, with_proxies
from missions.executive.state import state_of
from missions.executive.stream import EventStream, Listener
from missions.executive.tick_cache import TickCache
from missions.executive.watchdog import WatchdogLimits
from missions.request import RunRequest, Simulate, contradictions
from missions.runner import SIMULATED_LIMITS, Runner, load_plan, parts_with_ports

Params = Mapping[str, object]
"""Params of a mission by name: texts as in a mission ("5 s"), or plain numbers and flags."""


class Mission:
    """Mission that you tick yourself; create one with ``missions.load`` or ``missions.wrap``.

    ``root`` is the tree of py_trees behaviours, for displays and visitors. ``events`` is the event stream: append
    functions to ``events.listeners``. A mission with a robot is a context manager. It opens the robot and waits for its
    parts; at the end it halts, stops every actuator and closes every port. Without a robot the context only halts.

    No watchdog and no signal handler is active; use ``missions.run`` for those. While the robot is open, ``mission
    stop`` works from any terminal: after a pause, ticks do nothing; after a stop, the mission is halted.
    """

    def __init__(
        self,
        executive: Executive,
        *,
        missing_parts: frozenset[str] = frozenset(),
        runner: Runner | None = None,
        opening: Callable[[], AbstractContextManager[None]] | None = None,
    ) -> None:
        self.root: Node = executive.root
        self.events: EventStream = executive.stream
        self._executive = executive
        self._missing_parts = missing_parts
        self._runner, self._opening = runner, opening
        self._opened = ExitStack()
        self._open = runner is None

    @property
    def name(self) -> str:
        """Name of the mission."""
        return self._executive.mission

    @property
    def status(self) -> Status:
        """Status of the tree: INVALID before the first tick and after a halt."""
        return self.root.status

    @property
    def reason(self) -> str:
        """Reason why the mission failed or waits; empty otherwise."""
        return self.root.reason

    @property
    def variables(self) -> Mapping[str, object]:
        """Params of the mission, and the values that its behaviours stored, by name."""
        return self._executive.run.variables

    def tick(self) -> Status:
        """Tick once, immediately, and return the new status; a mission that has ended restarts.

        Raises drivers.errors.BadRequest if it needs a robot and has none, or if the robot is not open.
        """
        if self._missing_parts:
            parts = ", ".join(sorted(self._missing_parts))
            hint = f"missions.load('{self.name}', robot='turtlebot2_arm', simulate=True)"
            raise BadRequest(f"mission '{self.name}' needs a robot with {parts}, and has none", hint=hint)
        if not self._open:
            raise BadRequest(f"the robot of mission '{self.name}' is not open", hint="with mission: mission.tick()")
        if self._runner is not None and self._runner.twins is not None:
            self._executive.wait_period()
        if self._executive.stopping:  # by the control socket, as what follows
            self.halt()
            return self.status
        if self._executive.paused:
            self._executive.keep_still()
            return self.status
        return self._executive.tick()

    def halt(self) -> bool:
        """Stop all running leaves. Returns False while a leaf needs more ticks to stop; then call it again."""
        self._executive.run.tick += 1
        return self._executive.halt()

    def __enter__(self) -> Self:
        """Open the robot and wait for its parts. Raises drivers.errors.NotConnected that lists all missing parts."""
        if self._opening is not None:
            self._opened.enter_context(self._opening())
            self._open = True
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Halt, and close the robot; leaves that need more time to halt are stopped at once."""
        try:
            self.root.stop()
        finally:
            self._open = self._runner is None
            self._opened.close()


def load(
    path: str | Path,
    params: Params | None = None,
    robot: str | Robot | None = None,
    *,
    simulate: bool | Simulate = False,
    world: str | None = None,
    seed: int = 0,
    behaviours: Iterable[str | Path] = (),
    eyes: Literal["pixels", "truth"] = "pixels",
) -> Mission:
    """Read, check and build a mission: a name in the library, or a file. Opens nothing.

    ``robot`` is the name or file of a robot, which moves unless ``simulate``; or a ``behaviours.robot.Robot`` of parts
    that the caller opens and closes. Without a robot you can tick missions that need none. With ``simulate="fast"``
    time is simulated, and advances with the ticks. ``behaviours`` are Python files with your own leaves.

    Raises InvalidFileError, whose ``diagnostics`` are all errors; UnknownNameError for an unknown mission or robot.
    """
    files = [Path(file) for file in behaviours]
    param_texts = _param_texts(params)
    if isinstance(robot, str):
        request = RunRequest(
            str(path), param_texts, robot, _level(simulate), world, seed=seed, behaviours=files, eyes=eyes
        )
        runner = Runner(request)

        @contextmanager
        def opening() -> Iterator[None]:
            with _control_socket(runner), runner.ready():
                yield

        return Mission(runner.executive, runner=runner, opening=opening)
    parts = Robot() if robot is None else robot
    plan = load_plan(RunRequest(str(path), param_texts, behaviours=files), robot)
    run = RunState(SystemClock(), seed=seed)
    run.safe_stop = partial(hold_still, parts)
    stream, answers = EventStream(), TickCache()
    asking = with_proxies(parts, answers)
    base = asking.base_part
    guard = None if base is None else BaseGuard(base, Reflexes(), run, stream)
    run.variables.update(state_of(asking, run, guard))
    root = build(plan, run, lambda node: robot_for(node, asking, ignore))
    executive = Executive(root, run, stream, mission=plan.mission, guard=guard, cache=answers)
    return Mission(executive, missing_parts=(plan.tree.needs | plan.tree.claims) - parts.parts - parts.capabilities)


def wrap(tree: Behaviour) -> Mission:
    """Return a mission around a tree of plain py_trees behaviours, ticked by py_trees' own rules.

    ``behaviours.py_trees_leaf.PyTreesLeaf`` lists the few differences to ``tree.tick_once()``.
    """
    run = RunState(SystemClock())
    leaf = WrappedInstance(tree)
    leaf.run, leaf.scope, leaf.key, leaf.kind, leaf.robot = run, run.variables, "1", leaf.tag, Robot()
    return Mission(Executive(leaf, run, EventStream(), mission=tree.name))


def run(
    mission: str | Path,
    params: Params | None = None,
    robot: str | None = None,
    *,
    simulate: bool | Simulate = False,
    world: str | None = None,
    camera: str | None = None,
    ports: Mapping[str, str] | None = None,
    seed: int = 0,
    behaviours: Iterable[str | Path] = (),
    eyes: Literal["pixels", "truth"] = "pixels",
    speed: float = math.inf,
    physics: bool = False,
    until: float | None = None,
    ros2_domain: int | None = None,
    listeners: Sequence[Listener] = (),
    without_stop: bool = False,
) -> Result:
    """Run a mission to its end and return the result, as ``mission run`` does with the same options.

    ``missions.request.RunRequest`` declares the options, with their bounds; ``until`` is in s.

    The robot is simulated unless ``robot`` is given; ``simulate="fast"`` is simulated time, without waiting. ``mission
    stop`` works from any terminal. On the main thread, Ctrl-C and other signals end the run safely; if a leaf hangs,
    the process ends with the robot at rest. Without a signal, a hanging leaf is waited for while the robot stands
    still. A robot does not move if ``mission stop`` cannot reach the run, unless ``without_stop``.

    Raises ValueError for arguments that are out of bounds or contradict each other, such as a camera in simulated time;
    InvalidFileError, UnknownNameError, or a drivers.errors.DriverError such as NotConnected.
    """
    request = RunRequest(
        str(mission),
        _param_texts(params),
        robot,
        _level(simulate),
        world,
        camera,
        ports or {},
        seed,
        [Path(file) for file in behaviours],
        eyes=eyes,
        speed=speed,
        physics=physics,
        until=until,
        ros2_domain=ros2_domain,
        without_stop=without_stop,
    )
    if problems := "; ".join(contradictions(request, _argument, parts_with_ports)):
        raise ValueError(problems)
    limits = replace(SIMULATED_LIMITS if request.simulation == "fast" else WatchdogLimits(), lost=math.inf)
    runner = Runner(request, listeners=listeners, limits=limits)
    with _control_socket(runner):
        return runner.run()


@contextmanager
def _control_socket(runner: Runner) -> Iterator[None]:
    """Serve the control socket of a run, through which ``mission stop`` reaches it.

    Raises NoStop if the run would move a real robot and no stop can reach it.
    """
    with ControlSocket(runner) as control:
        control.require_stop(f"without_stop=True, or {WITHOUT_STOP}=yes")
        if control.trouble:
            log.warning("%s: `mission stop` cannot reach this run; stop it with Ctrl-C", control.trouble)
        yield


def _argument(name: str, value: str = "") -> str:
    """Return an argument of ``run`` as Python code, such as ``camera="0"``; only its name if ``value`` is empty."""
    return f'{name}="{value}"' if value else {"port": "ports"}.get(name, name.replace("-", "_"))


def _level(simulate: bool | Simulate) -> Simulate | None:
    """Return the level of simulation for the argument ``simulate`` of ``load`` and ``run``: "wire" for True."""
    return ("wire" if simulate else None) if isinstance(simulate, bool) else simulate


def _param_texts(params: Params | None) -> dict[str, str]:
    """Return params as texts, as they would be written in a mission file."""
    return {
        name: str(value).lower() if isinstance(value, bool) else str(value) for name, value in (params or {}).items()
    }
