"""A robot of ROS 2 behind a router of Zenoh on loopback: found, driven, lost with its router, and found again."""

from collections.abc import Iterator, Mapping
from typing import Literal

import numpy as np
import pytest

from drivers.api import ZERO_VELOCITY, DeviceStatus, Velocity
from drivers.api.driver import DriverContext
from drivers.base.diff_drive import DiffDriveBase
from drivers.clock import SystemClock
from drivers.errors import NotConnected
from drivers.ros2.camera import IMAGES, decode_image
from drivers.ros2.declared import Ros2BaseKeys, Ros2CameraKeys, Ros2RangeKeys, ZenohKeys
from drivers.ros2.graph import Ros2Graph
from drivers.ros2.make import base as make_base
from drivers.ros2.make import camera as make_camera
from drivers.ros2.make import graph as make_graph
from drivers.ros2.make import ranger as make_ranger
from drivers.ros2.ranger import Ros2Ranger
from drivers.ros2.types import types
from drivers.ros2.virtual import Ros2Terminal, RouterSettings, VirtualNav2, free_address
from drivers.ros2.virtual_topics import VirtualPictures, VirtualRos2Base, VirtualScan
from drivers.sim.base_body import BaseBody
from drivers.sim.scanner import make_range_function
from drivers.sim.world import SimulatedWorld
from tests.waiting import wait_until


class Robot:
    """A virtual robot behind its router, and the real drivers of it, which go by ``router`` where one is named."""

    def __init__(
        self, namespace: str = "/tb4", *, router: str = "", mode: Literal["client", "peer"] = "client"
    ) -> None:
        self.clock = SystemClock()
        self.told: list[DeviceStatus] = []
        topics = {"cmd_vel": f"{namespace}/cmd_vel", "odom": f"{namespace}/odom"}
        self.virtual = VirtualRos2Base(BaseBody(), topics, stamped=True)
        look = make_range_function(SimulatedWorld(), (0.0, 0.0, 0.0), self.virtual.pose)
        self.terminal = Ros2Terminal(RouterSettings(0, namespace, free_address()), self.clock)
        self.terminal.devices += [self.virtual, VirtualScan(look, f"{namespace}/scan")]
        actions = (f"{namespace}/navigate_to_pose", f"{namespace}/navigate_through_poses", f"{namespace}/dock")
        self.terminal.node_setups.append(VirtualNav2(self.virtual, actions).serve)
        keys = ZenohKeys(router=router or self.terminal.path, namespace=namespace, domain=0, mode=mode)
        self.graph: Ros2Graph = make_graph(keys, self._site())
        parts = {"ros2": self.graph}
        self.base: DiffDriveBase = make_base(Ros2BaseKeys(), self._site(parts))
        self.ranger: Ros2Ranger = make_ranger(Ros2RangeKeys(), self._site(parts))
        self.devices = (self.base, self.ranger, self.graph)

    def _site(self, parts: Mapping[str, object] | None = None) -> DriverContext:
        return DriverContext(self.clock, report=self.told.append, needed_parts=parts or {})

    def open(self) -> None:
        self.terminal.open()
        for device in self.devices:
            device.open()
        wait_until(lambda: all(device.health().online for device in self.devices))

    def close(self) -> None:
        for device in self.devices:
            device.rest()
        for device in self.devices:
            device.close()
        self.terminal.close()


@pytest.fixture
def robot() -> Iterator[Robot]:
    robot = Robot()
    yield robot
    robot.close()


@pytest.mark.real_time
def test_base_is_found_with_its_message_type_and_driven(robot: Robot) -> None:
    robot.open()

    def driven() -> bool:
        robot.base.drive(Velocity(0.2, 0.0))
        state = robot.base.state().value
        return state is not None and state.pose.x > 0.05

    wait_until(driven, pause=0.02)
    robot.base.stop()
    wait_until(lambda: robot.virtual.body.velocity == ZERO_VELOCITY)
    assert robot.virtual.pose(robot.clock.now()).x > 0.04
    wait_until(lambda: robot.ranger.scan().good)
    nodes = {each.node for each in robot.graph.node().entities("NN")}
    assert nodes == {"robot"}


@pytest.mark.real_time
def test_base_stops_without_its_router_and_reconnects_by_itself(robot: Robot) -> None:
    robot.open()

    def driven() -> bool:
        robot.base.drive(Velocity(0.2, 0.0))
        state = robot.base.state().value
        return state is not None and state.velocity.linear > 0.15

    wait_until(driven, pause=0.02)
    robot.terminal.unplug()
    lost = robot.clock.now()
    wait_until(lambda: robot.virtual.body.velocity == ZERO_VELOCITY)
    assert robot.clock.now() - lost < 0.7
    wait_until(lambda: not robot.graph.health().online and not robot.base.health().online)
    with pytest.raises(NotConnected, match="base:"):
        robot.base.drive(Velocity(0.2, 0.0))
    robot.terminal.replug()
    wait_until(lambda: all(device.health().online for device in robot.devices))
    robot.base.enable()
    wait_until(driven, pause=0.02)
    assert [each.kind for each in robot.told if each.device == "ros2"] == ["online", "offline", "online"]


@pytest.mark.real_time
def test_messages_without_attachment_are_reported_and_ignored(robot: Robot) -> None:
    robot.open()
    session = robot.terminal._session
    payload = types().encode("std_msgs/msg/String", {"data": "hello"})
    robot.graph.latest("bare")
    robot.graph.node().subscribe("/tb4/bare", ["std_msgs/msg/String"], lambda *_: pytest.fail("it is heard"))

    def told() -> bool:
        session.put("0/tb4/bare/std_msgs::msg::dds_::String_/RIHS01_0", payload)
        session.put("0/tb4/bare/std_msgs::msg::dds_::String_/RIHS01_0", payload, attachment=b"12345")
        return any(
            "/tb4/bare: malformed message: without rmw_zenoh's attachment" in each.message for each in robot.told
        )

    wait_until(told)


def test_missing_router_is_reported_with_its_address_and_a_hint(robot: Robot) -> None:
    robot.graph.open()
    wait_until(lambda: "no Zenoh router answers" in robot.graph.health().detail)
    assert robot.terminal.path in robot.graph.health().detail
    assert "rmw_zenohd" in robot.graph.health().hint
    with pytest.raises(NotConnected, match="no Zenoh router answers"):
        robot.graph.publish("say", "std_msgs/msg/String", '{"data": "hello"}')


@pytest.mark.parametrize("compressed", [False, True])
def test_pictures_arrive_unchanged(robot: Robot, compressed: bool) -> None:
    shown = np.zeros((48, 64, 3), np.uint8)
    shown[:, 32:] = (250, 20, 30)
    robot.terminal.devices.append(VirtualPictures(lambda _: shown, "/tb4/oakd/image", compressed=compressed))
    camera = make_camera(Ros2CameraKeys(image="oakd/image"), robot._site({"ros2": robot.graph}))
    camera.open()
    robot.open()
    frame = None
    while frame is None:
        frame = camera.read(1.0)
    assert frame.image.shape == (48, 64, 3)
    assert np.abs(frame.image.astype(int) - shown).mean() < 3
    assert camera.health().online
    camera.close()


@pytest.mark.parametrize("encoding", ["rgb8", "bgr8", "mono8", "bgra8", "rgba8", "yuv422_yuy2"])
def test_each_encoding_is_converted_to_bgr(encoding: str) -> None:
    size = {"mono8": 1, "bgra8": 4, "rgba8": 4, "yuv422_yuy2": 2}.get(encoding, 3)
    values = {"height": 4, "width": 6, "encoding": encoding, "step": 6 * size + 5, "data": bytes(4 * (6 * size + 5))}
    assert decode_image(IMAGES[0], types().encode(IMAGES[0], values)).shape == (4, 6, 3)


@pytest.mark.parametrize(
    "values",
    [{"encoding": "16UC1"}, {"width": 0}, {"step": 3}, {"height": 4000}, {"width": 2**31, "step": 2**32 - 1}],
)
def test_picture_with_inconsistent_size_is_refused(values: dict[str, object]) -> None:
    good = {"height": 4, "width": 6, "encoding": "bgr8", "step": 18, "data": bytes(72)}
    with pytest.raises(ValueError, match=r"."):
        decode_image(IMAGES[0], types().encode(IMAGES[0], {**good, **values}))


def test_topic_is_not_mistaken_for_an_action(robot: Robot) -> None:
    robot.open()
    wait_until(lambda: robot.graph.does("dock") and robot.graph.offers("odom"))
    assert robot.graph.offers("dock")
    assert not robot.graph.does("odom")
