"""A robot of DDS behind zenoh-bridge-ros2dds: found by its tokens, driven by its keys, as safe as over rmw_zenoh."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from zenoh import ext

from drivers.api import ZERO_VELOCITY, GoalState, Velocity
from drivers.clock import SystemClock, unix_time_ns
from drivers.errors import NotConnected
from drivers.ros2 import bridge, wire
from drivers.ros2.action_server import SUCCEEDED, ActionGoal, ActionServer
from drivers.ros2.base import ODOMETRY
from drivers.ros2.node import Ros2Node
from drivers.ros2.session import ZenohAccess, open_session
from drivers.ros2.types import types
from drivers.ros2.virtual import Ros2Terminal, RouterSettings, free_address
from drivers.ros2.wire import BRIDGE, DEFAULT_QOS, LATCHED_QOS, Entity
from tests.drivers.desks import RecordedMachine
from tests.drivers.ros2.dds_bridge import DdsBridge
from tests.drivers.ros2.test_ros2_session import Robot
from tests.missions.command import command
from tests.waiting import wait_until

STRING, TRIGGER, FIBONACCI = "std_msgs/msg/String", "std_srvs/srv/Trigger", "nav2_msgs/action/NavigateToPose"


class Bridged(Robot):
    """The robot of the tests of sessions, with DDS and a bridge in the place of rmw_zenoh."""

    terminal: DdsBridge  # type: ignore[assignment]

    def __init__(self) -> None:
        bridged = DdsBridge()
        super().__init__(router=bridged.path)
        bridged.devices, bridged.node_setups = self.terminal.devices, self.terminal.node_setups
        self.terminal = bridged

    def drives(self) -> bool:
        self.base.drive(Velocity(0.2, 0.0))
        state = self.base.state().value
        return state is not None and state.velocity.linear > 0.15


@pytest.fixture
def robot() -> Iterator[Bridged]:
    robot = Bridged()
    yield robot
    robot.close()


def entity(role: str, name: str = "", kind: str = "", qos: str = DEFAULT_QOS) -> Entity:
    return Entity(role, 0, "1f", "0", "0", BRIDGE, "", name, kind, BRIDGE, qos)


# --- tokens -----------------------------------------------------------------------------------------------------------


def test_bridge_tokens_are_parsed() -> None:
    assert bridge.parse_token("@/1f/@ros2_lv") == [entity("NN", qos="")]
    twist = bridge.parse_token("@/1f/@ros2_lv/MS/bot1§cmd_vel/geometry_msgs§msg§Twist/:1::1,10")
    assert twist == [entity("MS", "/bot1/cmd_vel", "geometry_msgs/msg/Twist")]
    assert (twist[0].is_bridged, twist[0].key) == (True, "bot1/cmd_vel")
    kept = "@/1f/@ros2_lv/MP/map/nav_msgs§msg§OccupancyGrid/K:1:1:1,1:typehash=RIHS01_0a;"
    assert bridge.parse_token(kept) == [entity("MP", "/map", "nav_msgs/msg/OccupancyGrid", LATCHED_QOS)]
    assert bridge.parse_token("@/1f/@ros2_lv/SS/dock/std_srvs§srv§Trigger") == [entity("SS", "/dock", TRIGGER)]
    action = bridge.parse_token("@/1f/@ros2_lv/AS/navigate_to_pose/nav2_msgs§action§NavigateToPose")
    assert [(each.role, each.name.partition("/_action/")[2], each.kind) for each in action] == [
        ("SS", "send_goal", "nav2_msgs/action/NavigateToPose_SendGoal"),
        ("SS", "get_result", "nav2_msgs/action/NavigateToPose_GetResult"),
        ("SS", "cancel_goal", "action_msgs/srv/CancelGoal"),
        ("MP", "feedback", "nav2_msgs/action/NavigateToPose_FeedbackMessage"),
        ("MP", "status", "action_msgs/msg/GoalStatusArray"),
    ]
    asks = bridge.parse_token("@/1f/@ros2_lv/AC/navigate_to_pose/nav2_msgs§action§NavigateToPose")
    assert [each.role for each in asks] == ["SC", "SC", "SC", "MS", "MS"]


@pytest.mark.parametrize(
    "token",
    [
        "",
        "@",
        "@/1f",
        "@/1f/@adv/x",
        "@/1f/@ros2_lv/MP",
        "@/1f/@ros2_lv/MP/odom",
        "@/1f/@ros2_lv/XX/odom/a§msg§B",
        "@/1f/@ros2_lv/MP/o*m/a§msg§B/:::",
        "@/1f/@ros2_lv/MP/odom/a§B/:::",
        "@/1f/@ros2_lv/MP//a§msg§B/:::",
    ],
)
def test_invalid_bridge_token_is_ignored(token: str) -> None:
    assert bridge.parse_token(token) == []


def test_offered_tokens_are_parsed_by_the_same_rules() -> None:
    trigger = bridge.service_token("1f", "/a/dock", TRIGGER)
    assert trigger is not None
    assert bridge.parse_token(trigger) == [entity("SS", "/a/dock", TRIGGER)]
    offered = [
        bridge.service_token("1f", f"/go/_action/{part}", f"{FIBONACCI}_{kind}")
        for part, kind in (("send_goal", "SendGoal"), ("get_result", "GetResult"), ("cancel_goal", "X"))
    ]
    assert offered == ["@/1f/@ros2_lv/AS/go/nav2_msgs§action§NavigateToPose", None, None]


# --- a robot ----------------------------------------------------------------------------------------------------------


@pytest.mark.real_time
def test_base_behind_a_bridge_drives_and_stops(robot: Bridged) -> None:
    robot.open()
    wait_until(robot.drives, pause=0.02)
    robot.base.stop()
    wait_until(lambda: robot.virtual.body.velocity == ZERO_VELOCITY)
    wait_until(lambda: robot.ranger.scan().good)
    assert robot.virtual.pose(robot.clock.now()).x > 0.0
    keys = {key for key, _ in robot.terminal.heard}
    assert keys == {"tb4/cmd_vel"}
    sent = types().decode("geometry_msgs/msg/TwistStamped", robot.terminal.heard[0][1])  # as its token says
    assert sent.header.frame_id == "base_link"
    assert robot.terminal.attached == []
    assert {each.node for each in robot.graph.node().entities(wire.NODE)} == {BRIDGE}


@pytest.mark.real_time
def test_base_stops_without_its_bridge_and_drives_again_with_it(robot: Bridged) -> None:
    robot.open()
    wait_until(robot.drives, pause=0.02)
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
    wait_until(robot.drives, pause=0.02)


@pytest.mark.real_time
def test_base_stops_when_a_leaf_is_silent_and_stop_is_sent_at_once(robot: Bridged) -> None:
    robot.open()
    wait_until(robot.drives, pause=0.02)
    silent = robot.clock.now()
    wait_until(lambda: robot.virtual.body.velocity == ZERO_VELOCITY)
    assert robot.clock.now() - silent < 1.0
    wait_until(robot.drives, pause=0.02)
    robot.base.latch("stopped by hand")
    wait_until(lambda: robot.virtual.body.velocity == ZERO_VELOCITY)
    count = len(robot.terminal.heard)
    wait_until(lambda: len(robot.terminal.heard) > count + 3)  # it is told to stand, again and again
    zero = types().decode("geometry_msgs/msg/TwistStamped", robot.terminal.heard[-1][1]).twist
    assert (zero.linear.x, zero.angular.z) == (0.0, 0.0)


@pytest.mark.real_time
def test_nav2_goal_behind_a_bridge_succeeds_or_is_cancelled_by_a_latch(robot: Bridged) -> None:
    robot.open()
    wait_until(robot.graph.navigates)
    number = robot.graph.navigate(((0.3, 0.0, 0.0),), "odom")
    wait_until(lambda: robot.graph.progress(number).is_final)
    assert robot.graph.progress(number).state is GoalState.SUCCEEDED, robot.graph.progress(number).reason
    assert "distance_remaining" in robot.graph.progress(number).feedback
    number = robot.graph.navigate(((9.0, 0.0, 0.0),), "odom")
    wait_until(lambda: robot.graph.progress(number).state is GoalState.RUNNING)
    robot.base.latch("stopped by hand")
    wait_until(lambda: robot.graph.progress(number).is_final)
    assert robot.graph.progress(number).state is GoalState.CANCELLED
    wait_until(lambda: robot.virtual.body.velocity == ZERO_VELOCITY)
    assert robot.terminal.attached == []


@pytest.mark.real_time
def test_services_topics_and_latched_topics_behind_a_bridge(robot: Bridged) -> None:
    def dock(payload: bytes, answer: Any) -> None:
        types().decode(f"{TRIGGER}_Request", payload)
        answer(types().encode(f"{TRIGGER}_Response", {"success": True, "message": "docked"}))

    robot.open()
    robot.terminal.serve("/tb4/dock_now", TRIGGER, dock)
    wait_until(lambda: robot.graph.offers("dock_now"))
    number = robot.graph.call("dock_now", "", "{}")
    wait_until(lambda: robot.graph.progress(number).is_final)
    assert json.loads(robot.graph.progress(number).result)["message"] == "docked"

    robot.terminal.subscribes("/tb4/say", STRING)
    wait_until(lambda: bool(robot.graph.node().entities(wire.SUBSCRIBER, "/tb4/say")))
    robot.graph.publish("say", "", '{"data": "hello"}')
    wait_until(lambda: ("tb4/say", types().encode(STRING, {"data": "hello"})) in robot.terminal.heard)

    missing: Any = ext.MissDetectionConfig  # whose stub asks for both of two that exclude each other
    publisher: Any = ext.declare_advanced_publisher(
        robot.terminal._session,
        "tb4/map_name",
        cache=ext.CacheConfig(1),
        publisher_detection=True,
        sample_miss_detection=missing(sporadic_heartbeat=5.0),
    )
    publisher.put(types().encode(STRING, {"data": "kitchen"}))
    robot.terminal.token("MP/tb4§map_name/std_msgs§msg§String/:1:1:1,1")
    wait_until(lambda: robot.graph.node().is_latched("/tb4/map_name"))
    wait_until(lambda: robot.graph.latest("map_name").value is not None)
    assert json.loads(robot.graph.latest("map_name").value or "") == {"data": "kitchen"}


@pytest.mark.real_time
def test_bridge_reports_wrong_types_and_malformed_messages(robot: Bridged) -> None:
    robot.open()
    text = types().encode(STRING, {"data": "this is no odometry"})

    def reported(words: str) -> bool:
        robot.terminal.put("/tb4/odom", text)
        return any(words in each.message for each in robot.told)

    wait_until(lambda: reported(f"/tb4/odom: malformed message: expected {ODOMETRY}, got {len(text)} bytes"))
    robot.terminal.token("MP/tb4§note/std_msgs§msg§String/:::10,1")
    robot.terminal.token("MP/tb4§own/my_msgs§msg§Own/:::10,1")

    def noted(words: str) -> bool:
        robot.graph.latest("note")
        robot.graph.latest("own")
        robot.terminal.put("/tb4/note", b"\0\7\0\0abc")
        return any(words in each.message for each in robot.told if each.device == "ros2")

    wait_until(lambda: noted(f"/tb4/note: malformed message: expected {STRING}, got 7 bytes"))
    wait_until(lambda: noted("/tb4/own: malformed message: its type my_msgs/msg/Own is not known here"))
    wrong = robot.terminal.token("MP/tb4§odom/std_msgs§msg§String/:::10,1")
    mismatch = f"/tb4/odom: expected {ODOMETRY}, but a node sends {STRING}"
    wait_until(lambda: mismatch in [each.message for each in robot.told])
    wrong.undeclare()
    wait_until(lambda: robot.base.protocol._faults.fault(1) != mismatch)  # type: ignore[attr-defined]


def test_odometry_of_two_bridges_is_ignored(robot: Bridged) -> None:
    robot.open()
    other: Any = open_session("bridge", ZenohAccess((robot.terminal.path,)), timeout=5.0)
    token = other.liveliness().declare_token(f"@/{other.zid()}/@ros2_lv/MP/tb4§odom/nav_msgs§msg§Odometry/:::10,1")
    wait_until(lambda: "two publishers on /tb4/odom" in robot.base.health().detail)
    token.undeclare()
    other.close()
    wait_until(lambda: robot.base.health().online)


@pytest.mark.real_time
def test_messages_delayed_by_a_stalled_link_are_late_by_their_headers(robot: Bridged) -> None:
    robot.terminal.open()
    session: Any = open_session("test", ZenohAccess((robot.terminal.path,)), timeout=5.0)
    node = Ros2Node(session, SystemClock())
    heard: list[float] = []
    (_, sieve) = node.subscribe("/late", [ODOMETRY], lambda _, payload: heard.append(x_of(payload)))
    robot.terminal.token("MP/late/nav_msgs§msg§Odometry/:::10,1")
    wait_until(lambda: bool(node.entities(wire.PUBLISHER, "/late")))

    def put(x: float, ago: float) -> None:
        seconds, rest = divmod(unix_time_ns() - round(ago * 1e9), 10**9)
        header = {"stamp": {"sec": seconds, "nanosec": rest}}
        robot.terminal.put(
            "/late", types().encode(ODOMETRY, {"header": header, "pose": {"pose": {"position": {"x": x}}}})
        )

    put(1.0, 0.0)
    put(2.0, 0.9)
    put(3.0, 0.0)
    wait_until(lambda: sieve.count == 3)
    assert heard == [1.0, 3.0]
    node.close()
    session.close()


def x_of(payload: bytes) -> float:
    return float(types().decode(ODOMETRY, payload).pose.pose.position.x)


def test_offered_services_and_messages_reach_robots_behind_a_bridge(robot: Bridged) -> None:
    robot.terminal.open()
    session: Any = open_session("test", ZenohAccess((robot.terminal.path,)), timeout=5.0)
    node = Ros2Node(session, SystemClock(), name="server")

    def begin(goal: ActionGoal) -> bool:
        goal.end(SUCCEEDED, {})
        return True

    ActionServer(node, "/go", FIBONACCI, begin, lambda _: None)
    tokens = {str(reply.ok.key_expr) for reply in robot.terminal._session.liveliness().get("@/*/@ros2_lv/**")}
    assert f"@/{session.zid()}/@ros2_lv/AS/go/nav2_msgs§action§NavigateToPose" in tokens
    request = types().encode(f"{FIBONACCI}_SendGoal_Request", {"goal_id": {"uuid": [7] * 16}})
    (reply,) = list(robot.terminal._session.get("go/_action/send_goal", payload=request))
    assert types().decode(f"{FIBONACCI}_SendGoal_Response", bytes(reply.ok.payload)).accepted
    wait_until(lambda: node.has_bridge)
    robot.terminal.subscribes("/status", STRING)
    sender = node.publisher("/status", STRING)

    def heard() -> bool:
        sender.send(types().encode(STRING, {"data": "x"}))
        return any(key == "status" for key, _ in robot.terminal.heard)

    wait_until(heard)
    node.close()
    session.close()


def test_node_on_router_and_bridge_counts_once() -> None:
    """A program of ours on a router without a bridge is no bridge, though it has their tokens."""
    router: Any = open_session("router", ZenohAccess((), mode="router", listen=(path := DdsBridge().path,)))
    ours, other = (open_session("test", ZenohAccess((path,)), timeout=5.0) for _ in range(2))
    server, node = Ros2Node(ours, SystemClock(), name="server"), Ros2Node(other, SystemClock())
    server.serve("/dock", TRIGGER, lambda *_: None)
    wait_until(lambda: bool(node.entities(wire.SERVER, "/dock")))
    assert [each.is_bridged for each in node.entities(wire.SERVER, "/dock")] == [False]
    assert not node.has_bridge
    for each in (server, node):
        each.close()
    for session in (ours, other, router):
        session.close()


@pytest.mark.real_time
def test_topics_command_lists_topics_and_messages_behind_a_bridge(
    robot: Bridged, capsys: pytest.CaptureFixture[str]
) -> None:
    robot.terminal.open()
    told = command(capsys, "ros2", "topics", "--router", robot.terminal.path, "--all")
    assert "/tb4/cmd_vel  geometry_msgs/msg/TwistStamped  (1 subscribes)" in told.out
    assert "/tb4/odom  nav_msgs/msg/Odometry  (1 publishes)" in told.out
    assert "/tb4/navigate_to_pose/_action/send_goal" in told.out
    told = command(capsys, "ros2", "echo", "/tb4/odom", "--router", robot.terminal.path, "--seconds", "0.5")
    assert json.loads(told.out.splitlines()[0])["header"]["frame_id"] == "odom"


ROBOT = "robot: dds\nros2: {router: ROUTER, domain: DOMAIN}\nbase: {driver: ros2}\n"


def test_ports_and_doctor_explain_how_a_robot_is_reached(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bridged, desk, file = DdsBridge(), RecordedMachine(tmp_path / "machine"), tmp_path / "dds.yaml"

    def told(text: str, *, router: str = bridged.path, domain: int = 0) -> bool:
        file.write_text(ROBOT.replace("ROUTER", router).replace("DOMAIN", str(domain)))
        found = command(capsys, "ports", "--root", str(desk.root), "--robot", str(file))
        data = command(capsys, "ports", "--root", str(desk.root), "--robot", str(file), "--json")
        doctor = command(capsys, "doctor", "--root", str(desk.root), "--robot", str(file))
        assert text in found.out, found.out
        assert text in doctor.out.replace("\n", " "), doctor.out
        assert text in " ".join(each["message"] for each in json.loads(data.out)["ros2"])
        return found.code == 0

    assert not told("no Zenoh router answers")
    bridged.open()
    assert told("zenoh-bridge-ros2dds with 0 topics and services, which has its own domain")
    bridged.close()
    terminal = Ros2Terminal(RouterSettings(5, "", free_address()), SystemClock())
    terminal.open()
    assert told("1 node with rmw_zenoh in domain 5", router=terminal.path, domain=5)
    assert not told("no zenoh-bridge-ros2dds found, but nodes in domain 5", router=terminal.path)
    terminal.close()
    router: Any = open_session("router", ZenohAccess((), mode="router", listen=(path := free_address(),)))
    assert not told("no rmw_zenoh node in domain 0 and no zenoh-bridge-ros2dds found", router=path)
    router.close()
