"""A run from beginning to end: read the mission, put the robot together, tick, and leave everything at rest."""

import signal
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from types import FrameType

from behaviours.node import Node
from behaviours.run import Run, log
from config.library import find
from config.robot import RobotConfig, load_robot
from config.world import load_world
from drivers.api import Notice
from drivers.clock import SystemClock
from drivers.errors import NotConnected
from missions.assembly.assemble import Ears, Wishes, assemble
from missions.assembly.assembled import Assembled
from missions.executive.build import build
from missions.executive.commands import robot_for
from missions.executive.events import CommandSent, FaultRaised, Listener, PerceptSeen, Stream
from missions.executive.executive import Executive, Result
from missions.executive.state import state_of
from missions.language.plan import Plan
from missions.library import load_mission
from perception.api import Face

DEFAULT_ROBOT = "turtlebot2_arm"
DEFAULT_WORLD = "living_room"

CONNECT_TIME = 8.0
"""Seconds that the parts of a robot have to appear: a board that boots needs two, a servo bus a second."""

REMARK_TIME = 1.0
"""Seconds after which a part that is still missing is mentioned."""

FAREWELL = {signal.SIGINT: "Ctrl-C", signal.SIGTERM: "SIGTERM", signal.SIGHUP: "the terminal was closed"}
"""The signals that end a run safely."""


@dataclass(frozen=True, slots=True)
class Order:
    """What to run, and on what: names as the user gives them. Without a ``robot`` the default one is simulated."""

    mission: str
    params: Mapping[str, str] = field(default_factory=dict)
    robot: str | None = None
    simulate: bool = False
    world: str | None = None
    camera: str | None = None
    ports: Mapping[str, str] = field(default_factory=dict)
    seed: int = 0


class Runner:
    """One run of one mission. Make it (which reads and checks everything), then ``run`` it, once.

    Raises InvalidFileError or UnknownNameError for what is wrong with the files; nothing has been opened then.
    """

    def __init__(self, order: Order, *, listeners: Sequence[Listener] = (), out: Callable[[str], None] = print) -> None:
        config = load_robot(find("robots", order.robot or DEFAULT_ROBOT))
        self.plan: Plan = load_mission(
            order.mission, params=order.params, complete=True, robot=(config.name, config.parts)
        )
        self.stream = Stream(list(listeners))
        self._context = Run(SystemClock(), seed=order.seed)
        self._robot: Assembled = self._assemble(config, order, out)
        self._context.settle = self._robot.settle
        self._context.variables.update(state_of(self._robot.robot, self._context.clock))
        self.root: Node = build(
            self.plan, self._context, lambda leaf: robot_for(leaf, self._robot.robot, self._commanded)
        )
        self.executive = Executive(self.root, self._context, self.stream, rate=config.rate, mission=self.plan.mission)

    def _assemble(self, config: RobotConfig, order: Order, out: Callable[[str], None]) -> Assembled:
        simulated = order.simulate or order.robot is None
        world = load_world(find("worlds", order.world or DEFAULT_WORLD)) if simulated else None
        wishes = Wishes(world, order.camera, order.ports, order.seed)
        ears = Ears(self._noticed, self._context.wake, out, self._seen)
        return assemble(config, self.plan.tree.needs | self.plan.tree.claims, self._context.clock, wishes, ears)

    def run(self) -> Result:
        """Run the mission until it ends, or a signal ends it; whatever happens, the robot is left at rest.

        Raises NotConnected when a part of the robot does not appear; its message names all that are missing.
        """
        self.executive.tell_start(file=self.plan.source.name, robot=self._robot.name)
        result = Result(self.plan.mission, "error", "", 0.0, 0)
        try:
            with _signals(self.executive.stop):
                try:
                    self._robot.open()
                    self._connect()
                    result = self.executive.loop()
                finally:
                    self._close()
        except Exception as error:
            reason = str(error) or type(error).__name__
            result = Result(self.plan.mission, "error", reason, self.executive.time(), self._context.tick)
            raise
        finally:
            self.executive.tell_end(result)
        return result

    def _connect(self) -> None:
        """Wait until every part is there. Raises NotConnected with all that are not."""
        begun = self._context.now()
        mentioned: set[str] = set()
        while (missing := self._robot.missing()) and not self.executive.stopping:
            waited = self._context.now() - begun
            for part, (detail, hint) in missing.items():
                if waited > REMARK_TIME and part not in mentioned:
                    mentioned.add(part)
                    self._noticed(Notice(part, "offline", f"waiting for it: {detail.removeprefix(f'{part}: ')}", hint))
            if waited > CONNECT_TIME:
                details = "\n".join(f"  {detail}" for detail, _ in missing.values())
                hints = dict.fromkeys(hint for _, hint in missing.values() if hint)
                raise NotConnected(f"{self._robot.name} is not complete:\n{details}", hint="\n       ".join(hints))
            self._context.woken.wait(0.02)
            self._context.woken.clear()

    def _close(self) -> None:
        for problem in self._robot.close():
            log.error("%s", problem)
            part, _, detail = problem.partition(": ")
            self.stream.emit(FaultRaised(self.executive.time(), part, "fault", detail))

    # --- what the robot tells, from its own threads -------------------------------------------------------------------

    def _noticed(self, notice: Notice) -> None:
        time = self._context.now()
        self.stream.emit(FaultRaised(time, notice.device, notice.kind, notice.what, notice.hint))
        self._context.wake()

    def _seen(self, stamp: float, faces: tuple[Face, ...]) -> None:
        seen = tuple(_face(face) for face in faces)
        self.stream.emit(PerceptSeen(self._context.now(), stamp, seen))
        self._context.wake()

    def _commanded(self, to: str, source: str, values: Mapping[str, object]) -> None:
        self.stream.emit(CommandSent(self._context.now(), self._context.tick, to, source, values))


def _face(face: Face) -> Mapping[str, object]:
    box = [round(value, 1) for value in (face.box.x, face.box.y, face.box.width, face.box.height)]
    angles = {name: round(getattr(face, name), 4) for name in ("bearing", "drop", "yaw", "pitch")}
    return {"id": face.id, "box": box, "stamp": face.stamp, **angles, "distance": round(face.distance, 2)}


@contextmanager
def _signals(stop: Callable[[str], None]) -> Iterator[None]:
    """Turn the signals that end a process into a request to stop. Off the main thread, signals are not ours to take."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def request(number: int, frame: FrameType | None) -> None:
        del frame
        stop(FAREWELL[signal.Signals(number)])

    before = {number: signal.signal(number, request) for number in FAREWELL}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
