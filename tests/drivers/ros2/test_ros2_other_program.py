"""A robot of ROS 2 that is not ours: by ROBOTIS' `zenoh_ros2_sdk`, in a process of its own."""

import json
import subprocess
import sys
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

from drivers.api import GoalState, Progress, Velocity
from drivers.api.driver import DriverContext
from drivers.clock import SystemClock
from drivers.ros2.declared import Ros2BaseKeys, Ros2RangeKeys, ZenohKeys
from drivers.ros2.make import base as make_base
from drivers.ros2.make import graph as make_graph
from drivers.ros2.make import ranger as make_ranger
from drivers.ros2.virtual import Ros2Terminal, RouterSettings, free_address
from tests.waiting import wait_until

pytestmark = [
    pytest.mark.real_time,
    pytest.mark.skipif(find_spec("zenoh_ros2_sdk") is None, reason="zenoh_ros2_sdk is not installed: `make test` does"),
]

ROBOT = Path(__file__).parent.parent.parent / "other_programs" / "zenoh_sdk_robot.py"


class Other:
    """That robot behind a router, and our drivers of it."""

    def __init__(self) -> None:
        clock = SystemClock()
        self.router = Ros2Terminal(RouterSettings(0, "", free_address()), clock)
        self.router.open()
        command = [sys.executable, str(ROBOT), self.router.path.split(":")[-1]]
        self.process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
        )
        assert self.process.stdout is not None
        assert self.process.stdout.readline() == "ready\n"
        self.graph = make_graph(ZenohKeys(router=self.router.path, domain=0), DriverContext(clock))
        site = DriverContext(clock, needed_parts={"ros2": self.graph})
        self.base = make_base(Ros2BaseKeys(), site)
        self.ranger = make_ranger(Ros2RangeKeys(), site)
        self.devices = (self.base, self.ranger, self.graph)
        for device in self.devices:
            device.open()
        wait_until(lambda: all(each.health().online for each in self.devices) and self.graph.navigates())

    def ended(self) -> dict[str, Any]:
        """Let the robot end; return what it has heard."""
        heard: dict[str, Any] = json.loads(self.process.communicate("", timeout=20)[0])
        return heard

    def over(self, number: int) -> Progress:
        wait_until(lambda: self.graph.progress(number).is_final)
        return self.graph.progress(number)

    def close(self) -> None:
        for device in self.devices:
            device.close()
        self.process.kill()
        self.process.communicate()
        self.router.close()


@pytest.fixture
def other() -> Iterator[Other]:
    other = Other()
    yield other
    other.close()


def test_other_program_is_driven_measured_and_sent_goals(other: Other) -> None:
    def driven() -> bool:
        other.base.drive(Velocity(0.2, 0.1))
        state = other.base.state().value
        return state is not None and state.pose.x > 0.05 and state.pose.heading > 0.01

    wait_until(driven, pause=0.02)
    other.base.stop()
    scan = other.ranger.scan().value
    assert scan is not None
    assert (len(scan.ranges), scan.nearest()) == (720, 2.5)

    there = other.graph.navigate(((1.0, 2.0, 0.5),), "map")
    assert other.over(there).state is GoalState.SUCCEEDED

    refused = other.graph.navigate(((-1.0, 0.0, 0.0),), "map")
    assert other.over(refused) == Progress(GoalState.FAILED, "/navigate_to_pose: the goal was rejected")

    far = other.graph.navigate(((9.0, 0.0, 0.0),), "map")
    wait_until(lambda: other.graph.progress(far).state is GoalState.RUNNING)
    other.graph.cancel(far)
    assert other.over(far).state is GoalState.CANCELLED

    heard = other.ended()
    assert heard["twists"] > 3
    assert heard["last"] == [0.0, 0.0]
    assert heard["goals"] == [["map", 1.0, 2.0], ["map", -1.0, 0.0], ["map", 9.0, 0.0]]
    assert heard["cancelled"] == 1


def test_goal_of_a_killed_server_is_unknown_and_the_base_goes_offline(other: Other) -> None:
    far = other.graph.navigate(((9.0, 0.0, 0.0),), "map")
    wait_until(lambda: other.graph.progress(far).state is GoalState.RUNNING)
    other.process.kill()
    assert other.over(far).state is GoalState.UNKNOWN
    wait_until(lambda: not other.base.health().online)
    assert not other.graph.navigates()
