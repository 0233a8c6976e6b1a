"""Runs that are told to ROS 2, and missions that nodes of ROS 2 start: by a program that is not ours."""

import json
import subprocess
import sys
from collections.abc import Iterator
from importlib.util import find_spec
from math import isnan, nan, radians
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from drivers.clock import SystemClock, unix_time_ns
from drivers.ros2.action_server import ActionGoal, ActionServer
from drivers.ros2.declared import ZenohKeys
from drivers.ros2.node import Ros2Node
from drivers.ros2.session import ZenohAccess, open_session
from drivers.ros2.types import types
from drivers.ros2.virtual import Ros2Terminal, RouterSettings, free_address
from missions.executive.event_reporter import percept_event
from missions.executive.events import Ended, Event, NodeChanged, Started, Ticked, VariableSet
from missions.library.drivers import load_named_robot
from missions.plugins.ros2 import mission_server
from missions.plugins.ros2.command import run_arguments
from missions.plugins.ros2.mission_server import RUN_MISSION, MissionServer, _parse_params
from missions.plugins.ros2.run_publisher import DETECTION_ARRAY, STRING, RunPublisher, detections, make_run_publisher
from perception.api import Box, Face, Marker, Thing, View
from perception.geometry import Pinhole
from tests.waiting import wait_until

CLIENT = Path(__file__).parent.parent / "other_programs" / "zenoh_sdk_client.py"

MISSIONS = {
    "short": "mission: short\ntree:\n  sequence: [log: hello, fail: the kettle is empty]\n",
    "long": "mission: long\ntree:\n  wait: 60 s\n",
}


@pytest.fixture
def router() -> Iterator[Ros2Terminal]:
    router = Ros2Terminal(RouterSettings(0, "", free_address()), SystemClock())
    router.open()
    yield router
    router.close()


@pytest.fixture
def node(router: Ros2Terminal) -> Iterator[Ros2Node]:
    session = open_session("test", ZenohAccess((router.path,)))
    node = Ros2Node(session, SystemClock(), name="rviz")
    yield node
    node.close()
    session.close()  # type: ignore[no-untyped-call]


CAMERA = Pinhole(640, 480, radians(60))


def pixels_of(message: Any) -> tuple[float, float, float, float]:
    """Where a detection is in its picture, as a program of ROS 2 reads it: its middle, width and height."""
    box = message.bbox
    return box.center.position.x, box.center.position.y, box.size_x, box.size_y


def percept(box: Box, away: float) -> tuple[int, float, Box, float, float, float, float, float, float, float]:
    """The figures of a percept in a picture that was taken at 0.2 s."""
    bearing, drop = CAMERA.pixel_to_angles(*box.centre)
    return 7, 0.2, box, bearing, drop, bearing, drop, 0.0, 0.0, away


ANNA = Face(*percept(Box(100, 80, 60, 80), 2.0), name="Anna")

RUN: tuple[Event, ...] = (
    Started(0.0, "greet", "greet.yaml", "turtlebot4", {}),
    VariableSet(0.1, 1, "", "people", 2),
    NodeChanged(0.2, 1, "1.1", "look", "look", 4, "running", "3 s to go"),
    Ticked(0.25, 1, "running"),
    percept_event(View(0.2, (ANNA,)), 0.3),
    NodeChanged(0.4, 2, "1.1", "look", "look", 4, "success", ""),
    Ended(0.5, "greet", "success", "", 0.5, 2),
)


@pytest.mark.real_time
def test_run_is_published_as_topics_with_history(router: Ros2Terminal, node: Ros2Node) -> None:
    heard: dict[str, list[Any]] = {}

    def hear(name: str, kind: str) -> None:
        def took(_: str, payload: bytes) -> None:
            heard.setdefault(name, []).append(types().to_plain(types().decode(kind, payload)))

        node.subscribe(name, [kind], took)

    for name in ("/mission/events", "/mission/tree", "/mission/variables"):
        hear(name, STRING)
    hear("/mission/detections", DETECTION_ARRAY)
    announcer = RunPublisher(ZenohAccess((router.path,)), 0)
    announcer.open()

    clock, sent_at = SystemClock(), list[float]()

    def found() -> bool:
        if not sent_at or clock.now() - sent_at[-1] > 0.25:
            sent_at.append(clock.now())
            for event in (RUN[1], RUN[4]):  # the first are lost: nobody knew yet who listens
                announcer(event)
        return {"/mission/detections", "/mission/events", "/mission/tree", "/mission/variables"} <= heard.keys()

    wait_until(found)
    for event in RUN:
        announcer(event)
    announcer.close()
    wait_until(lambda: json.loads(heard["/mission/tree"][-1]["data"]).get("status") == "success")
    tree = json.loads(heard["/mission/tree"][-1]["data"])
    assert (tree["mission"], tree["robot"]) == ("greet", "turtlebot4")
    assert [(each["name"], each["status"]) for each in tree["nodes"]] == [("look", "success")]
    assert json.loads(heard["/mission/variables"][-1]["data"]) == {"people": 2}
    wait_until(lambda: json.loads(heard["/mission/events"][-1]["data"])["event"] == "ended")
    kinds = [json.loads(each["data"])["event"] for each in heard["/mission/events"]][-6:]
    assert kinds == ["started", "variable", "node_changed", "percept", "node_changed", "ended"]
    (seen,) = heard["/mission/detections"][-1]["detections"]
    assert (seen["id"], seen["results"][0]["hypothesis"]["class_id"]) == ("7", "face:Anna")
    assert seen["results"][0]["pose"]["pose"]["position"]["x"] < 0
    assert 0 <= unix_time_ns() / 1e9 - seen["header"]["stamp"]["sec"] < 60


def test_of_many_events_at_once_none_is_lost(router: Ros2Terminal, node: Ros2Node) -> None:
    heard = list[int]()

    def took(_: str, payload: bytes) -> None:
        told = json.loads(types().to_plain(types().decode(STRING, payload))["data"])
        heard.append(told["tick"])

    node.subscribe("/mission/events", [STRING], took)
    announcer = RunPublisher(ZenohAccess((router.path,)), 0)
    announcer.open()

    def found() -> bool:
        announcer(VariableSet(0.0, 0, "", "people", 0))
        return bool(heard)

    wait_until(found)
    for number in range(1, 1001):
        announcer(VariableSet(0.1, number, "", "people", number))
    announcer.close()
    wait_until(lambda: heard[-1] == 1000)
    assert [each for each in heard if each] == list(range(1, 1001))


def test_run_publisher_works_without_a_router() -> None:
    announcer = RunPublisher(ZenohAccess((free_address(),)), 0)
    announcer.open()
    for event in RUN:
        announcer(event)
    announcer.close()


def test_percepts_are_published_as_box_position_and_time() -> None:
    ball = Thing(*percept(Box(400, 300, 30, 20), nan), name="", colour="red", shape="ball")
    robot = Marker(*percept(Box(310, 230, 20, 20), 1.5), number=12, name="", heading=0.1)
    event = percept_event(View(0.25, (ANNA,), (ball,), (robot,)), 0.3)
    told = types().decode(
        DETECTION_ARRAY, types().encode(DETECTION_ARRAY, detections(event, 1_700_000_000_050_000_000))
    )
    assert (told.header.stamp.sec, told.header.stamp.nanosec) == (1_700_000_000, 0)
    assert told.header.frame_id == "camera_optical_frame"
    face, thing, marker = told.detections
    assert (face.header.stamp.sec, face.header.stamp.nanosec) == (1_699_999_999, 950_000_000)
    assert [each.results[0].hypothesis.class_id for each in (face, thing, marker)] == [
        "face:Anna",
        "thing:red",
        "marker:12",
    ]
    assert [pixels_of(each) for each in (face, thing)] == [(130, 120, 60, 80), (415, 310, 30, 20)]
    at = face.results[0].pose.pose.position
    assert (at.x**2 + at.y**2 + at.z**2) ** 0.5 == pytest.approx(2.0)
    # Projected as by image_pipeline's pinhole, it is the middle of its box.
    assert 320 + CAMERA.focal * at.x / at.z == pytest.approx(130, abs=0.1)
    assert 240 + CAMERA.focal * at.y / at.z == pytest.approx(120, abs=0.1)
    assert isnan(thing.results[0].pose.pose.position.z)
    assert marker.results[0].pose.pose.position.z == pytest.approx(1.5, abs=0.01)


@pytest.mark.real_time
@pytest.mark.skipif(find_spec("zenoh_ros2_sdk") is None, reason="zenoh_ros2_sdk is not installed: `make test` does")
def test_ros2_node_starts_monitors_and_cancels_missions(router: Ros2Terminal, node: Ros2Node, tmp_path: Path) -> None:
    files = {}
    for name, text in MISSIONS.items():
        files[name] = str(tmp_path / f"{name}.yaml")
        Path(files[name]).write_text(text)
    robot = tmp_path / "bare.yaml"
    robot.write_text("robot: bare\nvoice: {driver: print}\n")
    server = MissionServer(
        node, ["--simulate", "wire", "--robot", str(robot)], is_known=set(files.values()).__contains__
    )
    digest = types().digest(f"{RUN_MISSION}_FeedbackMessage")
    order = [files["short"], files["long"] + "!", "--help"]
    command = [sys.executable, str(CLIENT), router.path.split(":")[-1], digest, *order]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    server.close()
    assert done.returncode == 0, done.stderr
    short, long, option = json.loads(done.stdout)
    assert any("hello" in line for line in short["running"])
    assert (short["status"], short["result"], short["reason"]) == (6, "failure", "the kettle is empty")
    assert (long["cancelled"], long["status"]) == (1, 5)
    assert not option["accepted"]


class _Silent:
    """A node that nobody hears."""

    def publisher(self, *_: object) -> None:
        return None

    def serve(self, *_: object) -> None:
        return None


def test_mission_server_refuses_paths_and_invalid_params(tmp_path: Path) -> None:
    path = tmp_path / "short.yaml"
    path.write_text(MISSIONS["short"])
    server = MissionServer(cast(Ros2Node, _Silent()), ["--simulate", "nonsense"])
    deep, escape = "[" * 100_000, json.dumps({"who": "\x1b[2J"})
    for name, params in ((str(path), ""), ("../x", ""), ("greet", deep), ("greet", escape), ("--help", "")):
        values = SimpleNamespace(mission=name, parameters=params)
        assert not server._begin(ActionGoal(cast(ActionServer, None), [], values))


def test_runs_of_the_mission_server_use_its_domain() -> None:
    words = run_arguments("turtlebot4", None, 42, "wire", None)
    assert words == ["--robot", "turtlebot4", "--simulate", "wire", "--ros2-domain", "42", "--ros2"]
    keys = load_named_robot("turtlebot4", 42).keys(ZenohKeys)
    assert keys is not None
    assert keys.domain == 42
    assert make_run_publisher("turtlebot4", None, 42).domain == 42
    assert load_named_robot("turtlebot2", 42).name == "turtlebot2"


def test_goal_params_are_converted_to_arguments() -> None:
    told = _parse_params('{"loud": true, "who": "Anna", "times": 3, "patience": "5 s", "quiet": false}')
    assert told == ["loud=true", "who=Anna", "times=3", "patience=5 s", "quiet=false"]
    assert _parse_params("[1]") is None


def test_late_cancel_does_not_stop_the_next_run(monkeypatch: pytest.MonkeyPatch) -> None:
    stopped = list[object]()
    monkeypatch.setattr(mission_server, "_stop", stopped.append)
    server = MissionServer(cast(Ros2Node, _Silent()), [])
    values = SimpleNamespace(mission="greet", parameters="")
    before, now = (ActionGoal(cast(ActionServer, None), [number], values) for number in (1, 2))
    server._running, server._goal = cast(Any, "the run of now"), now
    server._cancel(before)
    assert stopped == [None]
    server._cancel(now)
    assert stopped == [None, "the run of now"]


def test_run_publisher_reconnects_to_the_router(router: Ros2Terminal) -> None:
    announcer = RunPublisher(ZenohAccess((router.path,)), 0)
    announcer.open()

    def told() -> list[str]:
        node = router._node
        return [] if node is None else [each.name for each in node.entities("MP") if each.node == "mission"]

    wait_until(lambda: len(told()) == 4)
    router.unplug()
    for event in RUN:
        announcer(event)
    router.replug()
    wait_until(lambda: len(told()) == 4)
    announcer.close()
    wait_until(lambda: not told())
