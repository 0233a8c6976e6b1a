"""The leaves for the nodes of ROS 2: what they ask for, how they end, and what a halt waits for."""

import json
from dataclasses import replace
from typing import Any

import pytest

from behaviours.docking import DockLeaf
from behaviours.driving.go_to import GoTo
from behaviours.leaf import FAILURE, RUNNING, SUCCESS, Leaf
from behaviours.ros2 import CallService, Navigate, NavigateThrough, Publish, Ros2Action, TopicLeaf
from drivers.api import BaseState, GoalState, Pose2D, Progress, Quality, Reading, Velocity
from drivers.errors import NotConnected
from missions.plugins.testing.recorders import STOP, LeafTestBench, good

PLACES = {"kitchen": (1.0, 2.0, 0.5, "map"), "hall": (0.0, 1.0, 0.0, "map"), "ramp": (3.0, 0.0, 0.0, "odom")}


def put(bench: LeafTestBench, leaf: Any, **arguments: object) -> Any:
    bench.robot = replace(bench.robot, places=PLACES)
    return bench.put(leaf, **arguments)


def test_navigate_goes_to_a_named_place_and_reports_the_distance() -> None:
    bench = LeafTestBench()
    leaf = put(bench, Navigate("navigate"), to="kitchen")
    bench.ros2.goal_progress = Progress(
        GoalState.RUNNING, feedback='{"distance_remaining": 2.34, "number_of_recoveries": 1}'
    )
    assert bench.tick(leaf) is RUNNING
    assert bench.ros2.commands == [("navigate", ((1.0, 2.0, 0.5),), "map")]
    assert leaf.feedback_message == "2.34 m to go, 1 times stuck"
    bench.ros2.goal_progress = Progress(GoalState.SUCCEEDED, result='{"error_code": 0}')
    assert bench.tick(leaf) is SUCCESS
    assert leaf.result == {"error_code": 0}


@pytest.mark.parametrize("state", [GoalState.FAILED, GoalState.UNKNOWN, GoalState.CANCELLED])
def test_navigate_fails_with_the_reason_of_its_goal_and_stops_the_base(state: GoalState) -> None:
    bench = LeafTestBench()
    leaf = put(bench, Navigate("navigate"), to="kitchen")
    bench.tick(leaf)
    bench.ros2.goal_progress = Progress(state, "/navigate_to_pose: no path to the goal (error 208)")
    assert bench.tick(leaf) is FAILURE
    assert leaf.feedback_message == "/navigate_to_pose: no path to the goal (error 208)"
    assert STOP in bench.base.commands


def test_navigate_cancels_on_halt_and_waits_for_the_end() -> None:
    bench = LeafTestBench()
    leaf = put(bench, Navigate("navigate"), to="kitchen")
    bench.tick(leaf)
    assert not bench.halt(leaf)
    assert bench.ros2.commands[-1] == ("cancel", 1)
    bench.ros2.goal_progress = Progress(GoalState.CANCELLING)
    assert not bench.halt(leaf)
    bench.ros2.goal_progress = Progress(GoalState.CANCELLED)
    assert bench.halt(leaf)
    assert bench.safe_stops == []


def test_navigate_halt_without_an_end_safe_stops_the_base() -> None:
    bench = LeafTestBench()
    leaf = put(bench, Navigate("navigate"), to="kitchen")
    bench.tick(leaf)
    while not bench.halt(leaf, after=0.5):
        assert bench.clock.now() < 110.0
    assert bench.safe_stops == [frozenset({"base"})]


def test_navigate_to_an_unknown_place_fails_with_the_known_ones() -> None:
    bench = LeafTestBench()
    leaf = put(bench, Navigate("navigate"), to="cellar")
    assert bench.tick(leaf) is FAILURE
    assert leaf.feedback_message == "unknown place 'cellar'; places: hall, kitchen, ramp"


def test_navigate_waits_for_nav2() -> None:
    bench = LeafTestBench()
    bench.ros2.trouble = NotConnected("ros2: no server of /navigate_to_pose")
    leaf = put(bench, Navigate("navigate"), x=1.0, y=1.0)
    assert bench.tick(leaf) is RUNNING
    bench.ros2.trouble = None
    assert bench.tick(leaf) is RUNNING
    assert bench.ros2.commands == [("navigate", ((1.0, 1.0, 0.0),), "map")]


def test_navigate_through_accepts_places_of_one_frame() -> None:
    bench = LeafTestBench()
    leaf = put(bench, NavigateThrough("through"), through=["hall", "kitchen"])
    assert bench.tick(leaf) is RUNNING
    assert bench.ros2.commands == [("navigate", ((0.0, 1.0, 0.0), (1.0, 2.0, 0.5)), "map")]
    other = put(LeafTestBench(), NavigateThrough("through"), through=["hall", "ramp"])
    assert bench.tick(other) is FAILURE
    assert "several frames: map, odom" in other.feedback_message


def test_go_to_uses_nav2_where_available() -> None:
    bench = LeafTestBench()
    bench.ros2.nav2 = True
    bench.base.reading = good(BaseState(Pose2D(0.0, 0.0, 0.0), Velocity(0.0, 0.0)))
    leaf = put(bench, GoTo("go_to"), x=1.0, y=1.0)
    assert bench.tick(leaf) is RUNNING
    assert bench.ros2.commands == [("navigate", ((1.0, 1.0, pytest.approx(0.785, abs=1e-3)),), "start")]
    bench.ros2.goal_progress = Progress(GoalState.FAILED, "/navigate_to_pose: no progress (error 105)")
    assert bench.tick(leaf) is FAILURE
    assert leaf.feedback_message == "/navigate_to_pose: no progress (error 105)"


LEAVES: tuple[tuple[type[Leaf], dict[str, object]], ...] = (
    (Navigate, {"to": "kitchen"}),
    (NavigateThrough, {"through": ["hall", "kitchen"]}),
    (GoTo, {"x": 1.0, "y": 1.0}),
    (DockLeaf, {}),
    (Ros2Action, {"action": "/dock"}),
)


@pytest.mark.parametrize(("leaf", "arguments"), LEAVES)
def test_nothing_is_begun_while_the_base_is_latched(leaf: type[Leaf], arguments: dict[str, object]) -> None:
    bench = LeafTestBench()
    bench.ros2.nav2, bench.base.latched = True, "the stop button"
    it = put(bench, leaf(leaf.tag), **arguments)
    assert bench.tick(it) is FAILURE
    assert it.feedback_message == "the base is stopped: the stop button"
    assert bench.ros2.commands == []


@pytest.mark.parametrize(("leaf", "arguments"), LEAVES)
def test_latched_base_fails_the_leaf_and_cancels_the_action(leaf: type[Leaf], arguments: dict[str, object]) -> None:
    bench = LeafTestBench()
    bench.ros2.nav2 = True
    it = put(bench, leaf(leaf.tag), **arguments)
    assert bench.tick(it) is RUNNING
    bench.base.latched = "it was away for a while"
    assert bench.tick(it) is FAILURE
    assert it.feedback_message == "the base is stopped: it was away for a while"
    assert bench.ros2.commands[1:] == [("cancel", 1)]


def test_call_service_stores_the_response() -> None:
    bench = LeafTestBench()
    leaf = put(bench, CallService("call"), service="/reset", type="std_srvs/srv/SetBool", values={"data": True})
    assert bench.tick(leaf) is RUNNING
    assert bench.ros2.commands == [("call", "/reset", "std_srvs/srv/SetBool", '{"data": true}')]
    bench.ros2.goal_progress = Progress(GoalState.SUCCEEDED, result='{"success": true, "message": ""}')
    assert bench.tick(leaf) is SUCCESS
    assert leaf.result == {"success": True, "message": ""}


def test_an_action_of_any_type_is_begun_and_cancelled_by_a_halt() -> None:
    bench = LeafTestBench()
    leaf = put(bench, Ros2Action("dock"), action="/dock")
    bench.tick(leaf)
    bench.halt(leaf)
    assert bench.ros2.commands == [("begin", "/dock", "", "{}"), ("cancel", 1)]


def test_a_message_is_sent_at_once() -> None:
    bench = LeafTestBench()
    leaf = put(bench, Publish("publish"), topic="/chatter", type="std_msgs/msg/String", values={"data": "hello"})
    assert bench.tick(leaf) is SUCCESS
    assert bench.ros2.commands == [("publish", "/chatter", "std_msgs/msg/String", '{"data": "hello"}')]


MESSAGE = {"percentage": 0.8, "pose": {"x": 1.5}, "ranges": [0.5, 2.0], "present": True, "name": "a"}


@pytest.mark.parametrize(
    ("asked", "holds"),
    [
        ({"field": "percentage", "above": 0.5}, True),
        ({"field": "percentage", "above": 0.9}, False),
        ({"field": "pose.x", "below": 2.0, "above": 1.0}, True),
        ({"field": "ranges[1]", "equals": 2.0}, True),
        ({"field": "ranges[7]"}, False),
        ({"field": "present"}, True),
        ({"field": "name", "above": 1.0}, False),
        ({"field": "nobody"}, False),
        ({}, True),
    ],
)
def test_topic_condition_checks_any_field(asked: dict[str, object], holds: bool) -> None:
    bench = LeafTestBench()
    bench.ros2.messages["/it"] = Reading(json.dumps(MESSAGE), bench.clock.now(), Quality.GOOD)
    leaf = put(bench, TopicLeaf("topic"), topic="/it", **asked)
    assert bench.tick(leaf) is (SUCCESS if holds else FAILURE)
    assert leaf.feedback_message


def test_old_topic_message_suspends_the_condition() -> None:
    bench = LeafTestBench()
    leaf = put(bench, TopicLeaf("topic"), topic="/it")
    assert bench.tick(leaf) is RUNNING
    assert (leaf.is_suspended, leaf.reason) == (True, "waiting: the topic /it does not report")
    bench.ros2.messages["/it"] = Reading("{}", bench.clock.now() - 5.0, Quality.STALE)
    assert bench.tick(leaf) is RUNNING
    assert leaf.is_suspended
