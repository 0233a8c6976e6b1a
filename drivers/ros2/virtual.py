"""A robot of ROS 2 behind a router of Zenoh: its virtual devices, each on its topics, on loopback."""

import socket
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass
from functools import partial
from math import atan2, cos, pi, sin
from threading import Event, RLock, Thread
from typing import Any, TypeVar

from drivers.api import BASE_RADIUS, STILL, HeadPose, Image, Pose2D, Velocity
from drivers.clock import Clock
from drivers.pictures.capture import unturned
from drivers.ros2 import wire
from drivers.ros2.actions import CANCELLING, SUCCEEDED, ActionServer, Goal, ignored
from drivers.ros2.declared import (
    Ros2ArmKeys,
    Ros2AxisKeys,
    Ros2BaseKeys,
    Ros2CameraKeys,
    Ros2HeadKeys,
    Ros2RangeKeys,
    ZenohKeys,
)
from drivers.ros2.graph import TF, THROUGH, TO_POSE
from drivers.ros2.line import Channel
from drivers.ros2.make import domain_of, joints_of_arm, joints_of_head, topics_of
from drivers.ros2.node import Node
from drivers.ros2.publisher import Publisher
from drivers.ros2.session import Access, open_session
from drivers.ros2.types import types
from drivers.ros2.virtual_joints import VirtualJoints
from drivers.ros2.virtual_topics import Topics, VirtualBase, VirtualPictures, VirtualScan
from drivers.sim.navigator import ABORTED, NO_PROGRESS, Navigator
from drivers.sim.render import Renderer
from drivers.sim.scanner import looking
from drivers.sim.stage import Stage
from drivers.sim.things import SIZE, BackupLimit, Dock
from drivers.sim.viewpoint import Pinhole
from drivers.sim.world import World
from drivers.virtual.plugged import Plugged

# A stand-in for Nav2 and a Create 3's docking as ROS 2 sees them: actions that drive a virtual base, and its place.

TOLD_PERIOD = 0.1
"""Seconds between two messages of feedback, and of where the robot is on the map."""


DOCK = "irobot_create_msgs/action/Dock"


class VirtualNav2:
    """Serves actions under ``names`` (to a pose, through poses, onto the ``dock``), and drives ``base`` by them.

    ``rejects`` has it reject goals.
    """

    def __init__(self, base: VirtualBase, names: tuple[str, str, str], dock: Dock | None = None) -> None:
        self.rejects = False
        self._base, self._names, self._dock = base, names, dock
        self._goal: tuple[Goal, Navigator, str] | None = None
        self._told_at = -1.0
        base.steered = self._steer

    def serve(self, node: Node) -> None:
        """Offer the actions on a node: also on a new one, when the router was away."""
        for name, kind in zip(self._names, (TO_POSE, THROUGH, DOCK), strict=True):
            ActionServer(node, name, kind, partial(self._begin, kind), ignored)

    def _begin(self, kind: str, goal: Goal) -> bool:
        if kind == DOCK:
            places, frame = _onto(self._dock), DOCK
        else:
            poses = [goal.values.pose] if kind == TO_POSE else list(goal.values.poses)
            places, frame = [_place(each) for each in poses], poses[-1].header.frame_id if poses else ""
        if self.rejects or not places:
            return False
        before, self._goal = self._goal, (goal, Navigator(places), frame)
        if before is not None:
            before[0].end(ABORTED, {})  # one at a time: the newest
        return True

    def _steer(self, now: float, odometry: Pose2D) -> Velocity | None:
        """Say how the base is to drive; None where no goal is under way."""
        if self._goal is None:
            return None
        goal, navigator, frame = self._goal
        if goal.status == CANCELLING:
            navigator.cancel()
        pose = odometry if frame == "odom" else self._base.pose(now)
        docks, docked = frame == DOCK, self._base.body.docked
        velocity = None if docks and docked else navigator.velocity(now, pose)
        if velocity is None:
            self._goal = None
            ended = navigator.ended or SUCCEEDED
            if docks:
                goal.end(ABORTED if ended == SUCCEEDED and not docked else ended, {"is_docked": docked})
            else:
                goal.end(ended, {"error_code": NO_PROGRESS if ended == ABORTED else 0})
            return STILL
        if now - self._told_at >= TOLD_PERIOD:
            self._told_at = now
            goal.tell({"sees_dock": True} if docks else {"distance_remaining": navigator.distance(pose)})
        return velocity


class VirtualFrames(Topics):
    """Tells by /tf where the robot's odometry is on the map, and where the robot is in its odometry."""

    def __init__(self, base: VirtualBase, topic: str) -> None:
        super().__init__([Channel(topic, (TF,))])
        self._base = base
        self._due = -1.0

    def _messages(self, now: float) -> Iterable[tuple[int, bytes]]:
        if now < self._due:
            return
        self._due = now + TOLD_PERIOD
        true, own = self._base.pose(now), self._base.odometry
        turn = true.heading - own.heading
        x = true.x - (own.x * cos(turn) - own.y * sin(turn))
        y = true.y - (own.x * sin(turn) + own.y * cos(turn))
        transforms = [_transform("map", "odom", Pose2D(x, y, turn)), _transform("odom", "base_link", own)]
        yield 0, types().encode(TF, {"transforms": transforms})


def _transform(frame: str, child: str, pose: Pose2D) -> dict[str, object]:
    turned = {"z": sin(pose.heading / 2), "w": cos(pose.heading / 2)}
    at = {"translation": {"x": pose.x, "y": pose.y}, "rotation": turned}
    return {"header": {"frame_id": frame}, "child_frame_id": child, "transform": at}


def _onto(dock: Dock | None) -> list[tuple[float, float, float]]:
    """Return the way onto a dock: from before it to a little beyond where the contacts meet."""
    away = () if dock is None else (0.6, SIZE[0] / 2 + BASE_RADIUS - 0.04)
    return [
        (dock.x + it * cos(dock.heading), dock.y + it * sin(dock.heading), dock.heading + pi) for it in away if dock
    ]


def _place(told: Any) -> tuple[float, float, float]:
    at, turned = told.pose.position, told.pose.orientation
    return at.x, at.y, 2 * atan2(turned.z, turned.w)


T = TypeVar("T")

PERIOD = 0.005
"""Seconds between two looks at what the devices have to say."""


@dataclass(frozen=True, slots=True)
class Served:
    """What the devices of a robot are served by: its domain, its namespace, and where its router listens."""

    domain: int
    namespace: str
    listen: str


class Ros2Terminal:
    """Serves ``devices`` by Zenoh, with a router of its own; as ``drivers.virtual.terminal.Terminal`` does on a wire.

    ``path`` is where the router listens. ``unplug`` ends the router, and with it all that was declared.
    """

    def __init__(self, served: Served, clock: Clock) -> None:
        self.devices: list[Topics] = []
        self.path = served.listen
        self._served, self._clock = served, clock
        self._lock = RLock()
        self._session: Any = None
        self._node: Node | None = None
        self._senders: dict[tuple[int, int], Publisher] = {}
        self._ending = Event()
        self._thread: Thread | None = None
        self.serving: list[Callable[[Node], None]] = []
        """Called with each new node: what else it is to serve, such as actions."""

    def open(self) -> None:
        """Plug everything in. Does nothing while it is open."""
        if self._thread is None:
            self.replug()
            self._ending.clear()
            self._thread = Thread(target=self._run, name="virtual ros2", daemon=True)
            self._thread.start()

    def close(self) -> None:
        """Unplug, and end the thread. Safe more than once."""
        self._ending.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None
        self.unplug()

    def unplug(self) -> None:
        """End the router."""
        with self._lock:
            session, self._session, self._node = self._session, None, None
            self._senders.clear()
        if session is not None:
            session.close()

    def replug(self) -> None:
        """Start the router, and declare everything."""
        if self._session is not None:
            return
        session = open_session("virtual ros2", Access(endpoints=(), mode="router", listen=(self.path,)))
        node = Node(session, self._clock, domain=self._served.domain, namespace=self._served.namespace, name="robot")
        for place, device in enumerate(self.devices):
            for number, channel in enumerate(device.channels):
                if channel.sends:  # the driver does
                    node.subscribe(channel.topic, channel.kinds[:1], self._heard(device, number))
                else:
                    self._senders[place, number] = node.publisher(channel.topic, channel.kinds[0])
        for serve in self.serving:
            serve(node)
        with self._lock:
            self._session, self._node = session, node

    def ask(self, question: Callable[[], T]) -> T:
        """Ask the devices something while they stand still."""
        with self._lock:
            return question()

    def _heard(self, device: Topics, number: int) -> Callable[[str, bytes], None]:
        def heard(kind: str, payload: bytes) -> None:
            del kind
            with self._lock:
                device.feed(wire.frame(number, payload), self._clock.now())

        return heard

    def _run(self) -> None:
        finder = wire.FrameFinder()
        while not self._ending.wait(PERIOD):
            with self._lock:
                now = self._clock.now()
                for place, device in enumerate(self.devices):
                    for number, payload in finder.feed(device.poll(now)):
                        if number != wire.ABOUT and (sender := self._senders.get((place, number))) is not None:
                            sender.send(payload)


def free_address() -> str:
    """Return an address on loopback at which nobody listens."""
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{found.getsockname()[1]}"


def graph(keys: ZenohKeys, stage: Stage) -> Plugged:
    """Return the router of a virtual robot, for the other parts to be served by."""
    terminal = Ros2Terminal(Served(domain_of(keys), keys.namespace, stage.listen or free_address()), stage.clock)
    return Plugged(None, "ros2", terminal=terminal)


def base(keys: Ros2BaseKeys, stage: Stage) -> Plugged:
    """Return a virtual base."""
    full = _full(stage)
    device = VirtualBase(stage.body(), {word: full(name) for word, name in topics_of(keys).items()})
    if keys.hazards:  # a Create 3
        device.body.backup_limit = BackupLimit()
    terminal = _terminal(stage)
    nodes: ZenohKeys = stage.keys["ros2"]
    terminal.devices += [device, VirtualFrames(device, "/tf")]
    names = full(nodes.navigation), full(nodes.through), full("dock")
    terminal.serving.append(VirtualNav2(device, names, None if stage.world is None else stage.world.dock).serve)

    def state(now: float) -> object:
        return asdict(device.pose(now)) | asdict(device.body.velocity)

    return Plugged(None, pose=device.pose, state=state)


def ranger(keys: Ros2RangeKeys, stage: Stage) -> Plugged:
    """Return a virtual range finder, which sees the world from where the base truly is."""
    world = World() if stage.world is None else stage.world
    look = looking(world, keys.place, stage.pose, height=keys.position[2])
    device = VirtualScan(look, _full(stage)(keys.scan), yaw=keys.yaw, seed=stage.seed)
    _terminal(stage).devices.append(device)
    return Plugged(None)


def camera(keys: Ros2CameraKeys, stage: Stage) -> Plugged:
    """Return a virtual camera, which sees the world from where it truly is."""
    upright = keys.upright()
    lens = Pinhole(upright.width, upright.height, upright.field_of_view)
    renderer = Renderer(stage.world or World(), lens, noise=stage.noise, seed=stage.seed)

    def draw(now: float) -> Image:
        return unturned(renderer.draw(stage.viewpoint(now), now), keys.turn)  # as it is mounted

    device = VirtualPictures(draw, _full(stage)(keys.image))
    _terminal(stage).devices.append(device)
    return Plugged(None)


def arm(keys: Ros2ArmKeys, stage: Stage) -> Plugged:
    """Return the joints of a virtual arm; its state are their angles in radians, by the names of the robot file."""
    full, joints = _full(stage), joints_of_arm(keys)
    device = VirtualJoints(keys.states, keys.command, joints, full=full)
    _terminal(stage).devices.append(device)

    def state(now: float) -> object:
        return {name: joint.direction * device.position(joint.there, now) for name, joint in joints.items()}

    return Plugged(None, state=state)


def head(keys: Ros2HeadKeys, stage: Stage) -> Plugged:
    """Return the two joints of a virtual head."""
    full, joints = _full(stage), joints_of_head(keys)
    device = VirtualJoints(keys.states, keys.command, joints, full=full)
    _terminal(stage).devices.append(device)

    def angle(axis: Ros2AxisKeys, now: float) -> float:
        return joints[axis.joint].direction * device.position(axis.joint, now) - axis.trim

    return Plugged(None, looks=lambda now: HeadPose(angle(keys.pan, now), angle(keys.tilt, now)))


def _terminal(stage: Stage) -> Ros2Terminal:
    terminal: Ros2Terminal = stage.parts["ros2"].terminal
    return terminal


def _full(stage: Stage) -> Callable[[str], str]:
    namespace = stage.keys["ros2"].namespace
    return lambda name: wire.whole(name, namespace)
