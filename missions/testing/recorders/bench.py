"""A run over a robot of recorders."""

from dataclasses import replace
from typing import Any, TypeVar

from py_trees.common import Status

from behaviours.leaf import Leaf
from behaviours.node import Node
from behaviours.robot import Robot
from behaviours.run import NodeByNode, Run
from drivers.api.driver import resolved
from drivers.api.kinds import KINDS, Kind
from drivers.clock import ManualClock
from missions.testing.recorders.base import RecordedBase, RecordedRanger
from missions.testing.recorders.joints import RecordedHead, RecordedJoints
from missions.testing.recorders.ros2 import RecordedRos2
from missions.testing.recorders.screen import RecordedScreen
from missions.testing.recorders.senses import RecordedHearing, RecordedSight, RecordedVoice
from missions.testing.recorders.spy import Spy

L = TypeVar("L", bound=Leaf)


class Bench:
    """A run over a robot of recorders: ``settled`` keeps what had to be stopped for a leaf, ``news`` what changed.

    That ``robot`` takes the recorders is also what holds them to the protocols: mypy checks it. ``others`` are those of
    parts for which none is written, by their fields in ``Robot``: they keep commands by their names.
    """

    def __init__(self, clock: ManualClock | None = None) -> None:
        self.clock = ManualClock(100.0) if clock is None else clock
        self.run = Run(self.clock)
        self.base = RecordedBase(self.clock)
        self.ranger = RecordedRanger(self.clock)
        self.head = RecordedHead(self.clock)
        self.arm = RecordedJoints(self.clock)
        self.voice = RecordedVoice(self.clock)
        self.sight = RecordedSight()
        self.sight.searched = self.clock.now()
        self.hearing = RecordedHearing(self.clock)
        self.screen = RecordedScreen(self.clock)
        self.ros2 = RecordedRos2(self.clock)
        self.robot = Robot(
            base_part=self.base,
            ranger_part=self.ranger,
            head_part=self.head,
            arm_part=self.arm,
            voice_part=self.voice,
            sight_part=self.sight,
            hearing_part=self.hearing,
            screen_part=self.screen,
            ros2_part=self.ros2,
        )
        unwritten = (kind for kind in KINDS.values() if not hasattr(self, kind.field))
        self.others = {kind.field: plain(kind, self.clock) for kind in unwritten}
        parts: Any = {f"{field}_part": recorder for field, recorder in self.others.items()}
        self.robot = replace(self.robot, **parts)
        self.settled: list[frozenset[str]] = []
        self.run.safe_stop = self.settled.append
        self.news: list[tuple[str, Status]] = []
        self.run.observer = NodeByNode(lambda node: self.news.append((node.name, node.status)))

    def put(self, leaf: L, **arguments: object) -> L:
        """Give ``leaf`` the run, the robot and its arguments, as a mission would."""
        leaf.run, leaf.robot, leaf.kind = self.run, self.robot, leaf.word or leaf.name
        leaf.scope = self.run.variables
        for name, value in arguments.items():
            setattr(leaf, name, value)
        return leaf

    def tick(self, node: Node, *, after: float = 0.05) -> Status:
        """Let ``after`` seconds pass, then tick once."""
        self.clock.advance(after)
        self.run.tick += 1
        return node.execute_tick()

    def halt(self, node: Node, *, after: float = 0.05) -> bool:
        """Let ``after`` seconds pass, then ask it to halt, as a tick does."""
        self.clock.advance(after)
        self.run.tick += 1
        return node.halt()


def plain(kind: Kind, clock: ManualClock) -> Spy:
    """Return a spy for parts of a kind, by its protocol alone."""
    protocol = resolved(kind.seen or kind.device)
    made: type[Spy] = type(f"Recorded{protocol.__name__}", (Spy,), {"protocol": protocol})
    return made(kind.name, clock)
