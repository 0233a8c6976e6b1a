"""The way to a robot of ROS 2 is lost: a router that is killed, a link that stalls, a router that peers do without."""

import json
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager, suppress
from pathlib import Path

import pytest

from drivers.api import ZERO_VELOCITY, GoalState, Velocity
from drivers.clock import SystemClock
from drivers.errors import NotConnected
from drivers.ros2.node import Ros2Node
from drivers.ros2.session import ZenohAccess, open_session
from drivers.ros2.types import types
from drivers.ros2.virtual import free_address
from tests.drivers.ros2.test_ros2_session import Robot
from tests.missions.service.fleet_campaign import Proxy
from tests.waiting import wait_until

pytestmark = pytest.mark.real_time

ROUTER = Path(__file__).parents[2] / "other_programs" / "zenoh_router.py"


class Way:
    """A robot and the way to it, which is ``lost`` and ``mended``."""

    def __init__(self, robot: Robot, lost: Callable[[], object], mended: Callable[[], object]) -> None:
        self.robot, self.lost, self.mended = robot, lost, mended

    def drive(self) -> None:
        """Drive, as a leaf does at each tick, where the base takes it."""
        with suppress(NotConnected):
            self.robot.base.drive(Velocity(0.2, 0.0))

    def drives(self) -> bool:
        self.drive()
        return self.robot.virtual.body.velocity.linear > 0.15

    def rests(self) -> bool:
        """Say whether it stands, whatever it is told."""
        self.drive()
        return self.stands()

    def stands(self) -> bool:
        return self.robot.virtual.body.velocity == ZERO_VELOCITY

    def back(self) -> bool:
        return all(device.health().online for device in self.robot.devices) and self.robot.graph.navigates()


@contextmanager
def routed(address: str, to: str, file: Path) -> Iterator["subprocess.Popen[str]"]:
    """Run a router between us and that of the robot, in a process of its own."""
    ends = {"listen": {"endpoints": [address]}, "connect": {"endpoints": [to]}}
    file.write_text(json.dumps({"mode": "router", "scouting": {"multicast": {"enabled": False}}, **ends}))
    command = [sys.executable, str(ROUTER), str(file)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        try:
            yield process
        finally:
            process.kill()


@pytest.fixture(params=["router killed", "link stalled"])
def way(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Way]:
    with ExitStack() as closed:
        if request.param == "router killed":
            address = free_address()
            robot = Robot(router=address)
            robot.terminal.open()

            def start() -> "subprocess.Popen[str]":
                return closed.enter_context(routed(address, robot.terminal.path, tmp_path / "router.json5"))

            way = Way(robot, start().kill, start)
        else:
            robot = Robot()
            proxy = closed.enter_context(closing(Proxy(int(robot.terminal.path.split(":")[-1]))))
            robot.graph._access = ZenohAccess((f"tcp/127.0.0.1:{proxy.port}",))
            way = Way(robot, proxy.cut.set, proxy.cut.clear)
            closed.callback(proxy.cut.clear)
        closed.callback(robot.close)
        robot.open()
        wait_until(way.back)
        yield way


def test_base_stops_without_its_route_and_drives_again_with_it(way: Way) -> None:
    clock = SystemClock()
    wait_until(way.drives, pause=0.02)
    way.lost()
    lost = clock.now()
    wait_until(way.rests, pause=0.02)
    assert clock.now() - lost < 0.7
    wait_until(lambda: not way.robot.base.health().online)
    at = way.robot.virtual.pose(way.robot.clock.now())
    way.mended()
    wait_until(way.back)
    # What was held up on the way does not move it.
    assert way.robot.virtual.pose(way.robot.clock.now()).x == pytest.approx(at.x, abs=0.01)
    way.robot.base.enable()
    wait_until(way.drives, pause=0.02)


def test_lost_goal_is_unknown_then_cancelled_and_the_next_one_succeeds(way: Way) -> None:
    graph = way.robot.graph
    far = graph.navigate(((5.0, 0.0, 0.0),), "odom")
    wait_until(lambda: graph.progress(far).state is GoalState.RUNNING and not way.stands())
    way.lost()
    wait_until(lambda: graph.progress(far).is_final)
    assert graph.progress(far).state is GoalState.UNKNOWN
    way.mended()
    wait_until(way.back)
    wait_until(way.stands)
    assert way.robot.virtual.pose(way.robot.clock.now()).x < 4.5
    near = graph.navigate(((way.robot.virtual.odometry.x + 0.1, 0.0, 0.0),), "odom")
    wait_until(lambda: graph.progress(near).is_final)
    assert graph.progress(near).state is GoalState.SUCCEEDED


def test_peer_connects_to_a_node_directly_and_works_without_the_router() -> None:
    with ExitStack() as closed:
        robot = Robot(mode="peer")
        closed.callback(robot.close)
        robot.open()
        there = open_session("beside", ZenohAccess((robot.terminal.path,), "peer", (free_address(),)))
        closed.callback(there.close)
        node = Ros2Node(there, robot.clock, name="beside")
        closed.callback(node.close)
        kind = "std_msgs/msg/String"
        talker = node.publisher("/beside", kind)

        def heard(text: str) -> bool:
            talker.send(types().encode(kind, {"data": text}))
            value = robot.graph.latest("/beside").value
            return value is not None and json.loads(value)["data"] == text

        wait_until(lambda: heard("with a router"))
        robot.terminal.unplug()
        wait_until(lambda: not robot.base.health().online)
        wait_until(lambda: heard("without one"))
        robot.terminal.replug()
        wait_until(lambda: all(device.health().online for device in robot.devices))
