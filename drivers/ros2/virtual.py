"""Virtual robot with ROS 2: virtual devices on topics behind a Zenoh router on loopback, and a simulated Nav2."""

import socket
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass
from functools import partial
from math import atan2, cos, pi, sin
from threading import Event, RLock, Thread
from typing import Any, TypeVar

from drivers.api import BASE_RADIUS, ZERO_VELOCITY, HeadPose, Image, Pose2D, Velocity
from drivers.clock import Clock
from drivers.pictures.capture import unturn_image
from drivers.ros2 import wire
from drivers.ros2.action_server import CANCELLING, SUCCEEDED, ActionGoal, ActionServer, ignore_cancel
from drivers.ros2.declared import (
    Ros2ArmKeys,
    Ros2AxisKeys,
    Ros2BaseKeys,
    Ros2CameraKeys,
    Ros2HeadKeys,
    Ros2RangeKeys,
    ZenohKeys,
)
from drivers.ros2.graph import NAVIGATE_THROUGH_POSES, NAVIGATE_TO_POSE, TF
from drivers.ros2.make import arm_joints, base_topics, head_joints, ros_domain
from drivers.ros2.node import Ros2Node
from drivers.ros2.publisher import Publisher
from drivers.ros2.session import ZenohAccess, open_session
from drivers.ros2.topic_port import TopicChannel
from drivers.ros2.types import types
from drivers.ros2.virtual_joints import VirtualJoints
from drivers.ros2.virtual_topics import VirtualPictures, VirtualRos2Base, VirtualScan, VirtualTopics
from drivers.sim.context import SimContext
from drivers.sim.navigator import ABORTED, NO_PROGRESS_ERROR, Navigator
from drivers.sim.render import Renderer
from drivers.sim.scanner import make_range_function
from drivers.sim.viewpoint import PinholeLens
from drivers.sim.world import SimulatedWorld
from drivers.sim.world_objects import DOCK_SIZE, BackupLimit, WorldDock
from drivers.virtual.device import VirtualDevice

# Simulated Nav2 and docking of a Create 3: actions that drive a virtual base, and its pose.

FEEDBACK_INTERVAL = 0.1
"""Seconds between two feedback messages, and between two transforms."""


DOCK = "irobot_create_msgs/action/Dock"


class VirtualNav2:
    """Simulated Nav2: executes goals of three actions by driving the virtual ``base``.

    ``names`` are the names of the three actions: drive to a pose, drive through poses, and drive onto the ``dock``. If
    ``rejects_goals`` is True, all goals are rejected.
    """

    def __init__(self, base: VirtualRos2Base, names: tuple[str, str, str], dock: WorldDock | None = None) -> None:
        self.rejects_goals = False
        self._base, self._names, self._dock = base, names, dock
        self._goal: tuple[ActionGoal, Navigator, str] | None = None
        self._feedback_at = -1.0
        base.velocity_source = self._steer

    def serve(self, node: Ros2Node) -> None:
        """Serve the actions on ``node``; called again for a new node after each restart of the router."""
        for name, kind in zip(self._names, (NAVIGATE_TO_POSE, NAVIGATE_THROUGH_POSES, DOCK), strict=True):
            ActionServer(node, name, kind, partial(self._begin, kind), ignore_cancel)

    def _begin(self, kind: str, goal: ActionGoal) -> bool:
        if kind == DOCK:
            places, frame = _dock_approach(self._dock), DOCK
        else:
            poses = [goal.values.pose] if kind == NAVIGATE_TO_POSE else list(goal.values.poses)
            places, frame = [_pose_of(each) for each in poses], poses[-1].header.frame_id if poses else ""
        if self.rejects_goals or not places:
            return False
        before, self._goal = self._goal, (goal, Navigator(places), frame)
        if before is not None:
            before[0].end(ABORTED, {})  # one at a time, the newest
        return True

    def _steer(self, now: float, odometry: Pose2D) -> Velocity | None:
        """Return the velocity for the base at time ``now``; None without an active goal.

        ``odometry`` is its pose by odometry, for goals in that frame.
        """
        if self._goal is None:
            return None
        goal, navigator, frame = self._goal
        if goal.status == CANCELLING:
            navigator.cancel()
        pose = odometry if frame == "odom" else self._base.pose(now)
        docks, docked = frame == DOCK, self._base.body.docked
        velocity = None if docks and docked else navigator.next_velocity(now, pose)
        if velocity is None:
            self._goal = None
            ended = navigator.result or SUCCEEDED
            if docks:
                goal.end(ABORTED if ended == SUCCEEDED and not docked else ended, {"is_docked": docked})
            else:
                goal.end(ended, {"error_code": NO_PROGRESS_ERROR if ended == ABORTED else 0})
            return ZERO_VELOCITY
        if now - self._feedback_at >= FEEDBACK_INTERVAL:
            self._feedback_at = now
            goal.send_feedback(
                {"sees_dock": True} if docks else {"distance_remaining": navigator.distance_to_next(pose)}
            )
        return velocity


class VirtualFrames(VirtualTopics):
    """Publishes two transforms: the robot's odometry frame on the map, and the robot in that frame."""

    def __init__(self, base: VirtualRos2Base, topic: str) -> None:
        super().__init__([TopicChannel(topic, (TF,))])
        self._base = base
        self._due = -1.0

    def _messages(self, now: float) -> Iterable[tuple[int, bytes]]:
        if now < self._due:
            return
        self._due = now + FEEDBACK_INTERVAL
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


def _dock_approach(dock: WorldDock | None) -> list[tuple[float, float, float]]:
    """Return the poses of a drive onto a dock, each as x, y and heading; empty without a dock.

    The first is before the dock, the last slightly beyond its contacts.
    """
    away = () if dock is None else (0.6, DOCK_SIZE[0] / 2 + BASE_RADIUS - 0.04)
    return [
        (dock.x + it * cos(dock.heading), dock.y + it * sin(dock.heading), dock.heading + pi) for it in away if dock
    ]


def _pose_of(pose: Any) -> tuple[float, float, float]:
    at, turned = pose.pose.position, pose.pose.orientation
    return at.x, at.y, 2 * atan2(turned.z, turned.w)


T = TypeVar("T")

POLL_INTERVAL = 0.005
"""Seconds between two polls of the devices."""


@dataclass(frozen=True, slots=True)
class RouterSettings:
    """Settings of a virtual robot's router: ROS domain, namespace, and the address at which it listens."""

    domain: int
    namespace: str
    listen: str


class Ros2Terminal:
    """Serves virtual ``devices`` over Zenoh with its own router, as a ``PseudoTerminal`` does on a serial line.

    ``path`` is the address of the router. ``unplug`` ends the router with all topics and services on it.
    """

    def __init__(self, settings: RouterSettings, clock: Clock) -> None:
        self.devices: list[VirtualTopics] = []
        self.path = settings.listen
        self._settings, self._clock = settings, clock
        self._lock = RLock()
        self._session: Any = None
        self._node: Ros2Node | None = None
        self._publishers: dict[tuple[int, int], Publisher] = {}
        self._end_requested = Event()
        self._thread: Thread | None = None
        self.node_setups: list[Callable[[Ros2Node], None]] = []
        """Functions that are called with each new node, to add services such as actions."""

    def open(self) -> None:
        """Connect all devices. Does nothing while it is open."""
        if self._thread is None:
            self.replug()
            self._end_requested.clear()
            self._thread = Thread(target=self._run, name="virtual ros2", daemon=True)
            self._thread.start()

    def close(self) -> None:
        """Disconnect, and end the thread. Safe more than once."""
        self._end_requested.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None
        self.unplug()

    def unplug(self) -> None:
        """End the router."""
        with self._lock:
            session, self._session, self._node = self._session, None, None
            self._publishers.clear()
        if session is not None:
            session.close()

    def replug(self) -> None:
        """Start the router, and declare all topics."""
        if self._session is not None:
            return
        session = open_session("virtual ros2", ZenohAccess(endpoints=(), mode="router", listen=(self.path,)))
        node = Ros2Node(
            session, self._clock, domain=self._settings.domain, namespace=self._settings.namespace, name="robot"
        )
        for place, device in enumerate(self.devices):
            for number, channel in enumerate(device.channels):
                if channel.is_command:  # published by the driver
                    node.subscribe(channel.topic, channel.kinds[:1], self._message_handler(device, number))
                else:
                    self._publishers[place, number] = node.publisher(channel.topic, channel.kinds[0])
        for serve in self.node_setups:
            serve(node)
        with self._lock:
            self._session, self._node = session, node

    def call_paused(self, question: Callable[[], T]) -> T:
        """Return the result of ``question``, which is called while no device is advanced."""
        with self._lock:
            return question()

    def _message_handler(self, device: VirtualTopics, number: int) -> Callable[[str, bytes], None]:
        def heard(kind: str, payload: bytes) -> None:
            del kind
            with self._lock:
                device.feed(wire.frame(number, payload), self._clock.now())

        return heard

    def _run(self) -> None:
        finder = wire.TopicFrameFinder()
        while not self._end_requested.wait(POLL_INTERVAL):
            with self._lock:
                now = self._clock.now()
                for place, device in enumerate(self.devices):
                    for number, payload in finder.feed(device.poll(now)):
                        if (
                            number != wire.ABOUT_CHANNEL
                            and (sender := self._publishers.get((place, number))) is not None
                        ):
                            sender.send(payload)


def free_address() -> str:
    """Return an unused address on loopback."""
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{found.getsockname()[1]}"


def graph(keys: ZenohKeys, stage: SimContext) -> VirtualDevice:
    """Return the router of a virtual robot as a device. The other virtual parts are served by it."""
    terminal = Ros2Terminal(
        RouterSettings(ros_domain(keys), keys.namespace, stage.listen_address or free_address()), stage.clock
    )
    return VirtualDevice(None, "ros2", port=terminal)


def base(keys: Ros2BaseKeys, stage: SimContext) -> VirtualDevice:
    """Return a virtual base on ROS 2 topics."""
    full = _full_names(stage)
    device = VirtualRos2Base(stage.make_body(), {word: full(name) for word, name in base_topics(keys).items()})
    if keys.hazards:  # a Create 3
        device.body.backup_limit = BackupLimit()
    terminal = _terminal(stage)
    nodes: ZenohKeys = stage.part_keys["ros2"]
    terminal.devices += [device, VirtualFrames(device, "/tf")]
    names = full(nodes.navigation), full(nodes.through), full("dock")
    terminal.node_setups.append(VirtualNav2(device, names, None if stage.world is None else stage.world.dock).serve)

    def state(now: float) -> object:
        return asdict(device.pose(now)) | asdict(device.body.velocity)

    return VirtualDevice(None, pose=device.pose, state=state)


def ranger(keys: Ros2RangeKeys, stage: SimContext) -> VirtualDevice:
    """Return a virtual range finder, which sees the world from the true pose of the base."""
    world = SimulatedWorld() if stage.world is None else stage.world
    look = make_range_function(world, keys.place, stage.pose, height=keys.position[2])
    device = VirtualScan(look, _full_names(stage)(keys.scan), yaw=keys.yaw, seed=stage.seed)
    _terminal(stage).devices.append(device)
    return VirtualDevice(None)


def camera(keys: Ros2CameraKeys, stage: SimContext) -> VirtualDevice:
    """Return a virtual camera, which sees the simulated world from its true pose."""
    upright = keys.upright()
    lens = PinholeLens(upright.width, upright.height, upright.field_of_view)
    renderer = Renderer(stage.world or SimulatedWorld(), lens, noise=stage.camera_noise, seed=stage.seed)

    def draw(now: float) -> Image:
        return unturn_image(renderer.draw(stage.viewpoint(now), now), keys.orientation)  # as it is mounted

    device = VirtualPictures(draw, _full_names(stage)(keys.image))
    _terminal(stage).devices.append(device)
    return VirtualDevice(None)


def arm(keys: Ros2ArmKeys, stage: SimContext) -> VirtualDevice:
    """Return a virtual arm; its state is the joint angles in radians, by the names of the robot file."""
    full, joints = _full_names(stage), arm_joints(keys)
    device = VirtualJoints(keys.states, keys.command, joints, full=full)
    _terminal(stage).devices.append(device)

    def state(now: float) -> object:
        return {name: joint.direction * device.position(joint.ros_name, now) for name, joint in joints.items()}

    return VirtualDevice(None, state=state)


def head(keys: Ros2HeadKeys, stage: SimContext) -> VirtualDevice:
    """Return a virtual head of two joints."""
    full, joints = _full_names(stage), head_joints(keys)
    device = VirtualJoints(keys.states, keys.command, joints, full=full)
    _terminal(stage).devices.append(device)

    def angle(axis: Ros2AxisKeys, now: float) -> float:
        return joints[axis.joint].direction * device.position(axis.joint, now) - axis.trim

    return VirtualDevice(None, head_pose=lambda now: HeadPose(angle(keys.pan, now), angle(keys.tilt, now)))


def _terminal(stage: SimContext) -> Ros2Terminal:
    terminal: Ros2Terminal = stage.parts["ros2"].port
    return terminal


def _full_names(stage: SimContext) -> Callable[[str], str]:
    namespace = stage.part_keys["ros2"].namespace
    return lambda name: wire.full_name(name, namespace)
