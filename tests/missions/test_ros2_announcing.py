"""Runs that are told to ROS 2, and missions that nodes of ROS 2 start: by a program that is not ours."""

import json
import subprocess
import sys
from collections.abc import Iterator
from importlib.util import find_spec
from math import radians
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from drivers.clock import SystemClock
from drivers.ros2.actions import ActionServer, Goal
from drivers.ros2.declared import ZenohKeys
from drivers.ros2.node import Node
from drivers.ros2.session import Access, open_session
from drivers.ros2.types import types
from drivers.virtual.ros2 import Ros2Terminal, Served, free_address
from missions.cli import offering
from missions.cli.announcing import DETECTIONS, STRING, Announcer, announcer_of, detection
from missions.cli.offering import RUN_MISSION, MissionServer, _params
from missions.cli.ros2 import options_of_runs
from missions.executive.events import Ended, Event, NodeChanged, PerceptSeen, Started, Ticked, VariableSet
from missions.order import RunRequest
from tests.waiting import wait_until

CLIENT = Path(__file__).parent.parent / "other_programs" / "zenoh_sdk_client.py"

MISSIONS = {
    "short": "mission: short\ntree:\n  sequence: [log: hello, fail: the kettle is empty]\n",
    "long": "mission: long\ntree:\n  wait: 60 s\n",
}


@pytest.fixture
def router() -> Iterator[Ros2Terminal]:
    router = Ros2Terminal(Served(0, "", free_address()), SystemClock())
    router.open()
    yield router
    router.close()


@pytest.fixture
def node(router: Ros2Terminal) -> Iterator[Node]:
    session = open_session("test", Access((router.path,)))
    node = Node(session, SystemClock(), name="rviz")
    yield node
    node.close()
    session.close()  # type: ignore[no-untyped-call]


RUN: tuple[Event, ...] = (
    Started(0.0, "greet", "greet.yaml", "turtlebot4", {}),
    VariableSet(0.1, 1, "", "people", 2),
    NodeChanged(0.2, 1, "1.1", "look", "look", 4, "running", "3 s to go"),
    Ticked(0.25, 1, "running"),
    PerceptSeen(0.3, 0.2, ({"id": 7, "bearing": 0.5, "drop": -0.1, "name": "Anna"},)),
    NodeChanged(0.4, 2, "1.1", "look", "look", 4, "success", ""),
    Ended(0.5, "greet", "success", "", 0.5, 2),
)


@pytest.mark.real_time
def test_a_run_is_told_as_topics_also_to_who_comes_later(router: Ros2Terminal, node: Node) -> None:
    heard: dict[str, list[Any]] = {}

    def hear(name: str, kind: str) -> None:
        def took(_: str, payload: bytes) -> None:
            heard.setdefault(name, []).append(types().values(types().decode(kind, payload)))

        node.subscribe(name, [kind], took, lambda: None)

    for name in ("/mission/events", "/mission/tree", "/mission/variables"):
        hear(name, STRING)
    hear("/mission/detections", DETECTIONS)
    announcer = Announcer(Access((router.path,)), 0)
    announcer.open()

    clock, sent_at = SystemClock(), list[float]()

    def found() -> bool:
        if not sent_at or clock.now() - sent_at[-1] > 0.25:  # more at a time may be dropped on a busy machine
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
    assert seen["results"][0]["pose"]["pose"]["position"]["y"] > 0


def test_without_a_router_a_run_goes_on_and_ends_at_once() -> None:
    announcer = Announcer(Access((free_address(),)), 0)
    announcer.open()
    for event in RUN:
        announcer(event)
    announcer.close()


def test_what_is_seen_on_the_left_and_above_is_left_and_above_for_ros() -> None:
    told = detection("thing", {"colour": "red", "bearing": radians(30), "drop": radians(-10), "size": 0.2})
    result = told["results"][0]  # type: ignore[index]
    position = result["pose"]["pose"]["position"]
    assert result["hypothesis"]["class_id"] == "thing:red"
    assert position["y"] == pytest.approx(0.5)
    assert position["z"] > 0.1


@pytest.mark.real_time
@pytest.mark.skipif(find_spec("zenoh_ros2_sdk") is None, reason="zenoh_ros2_sdk is not installed: `make test` does")
def test_a_node_of_ros_starts_missions_hears_of_them_and_cancels_them(
    router: Ros2Terminal, node: Node, tmp_path: Path
) -> None:
    files = {}
    for name, text in MISSIONS.items():
        files[name] = str(tmp_path / f"{name}.yaml")
        Path(files[name]).write_text(text)
    robot = tmp_path / "bare.yaml"
    robot.write_text("robot: bare\nvoice: {driver: print}\n")
    server = MissionServer(node, ["--simulate", "wire", "--robot", str(robot)], knows=set(files.values()).__contains__)
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


def test_a_path_and_params_that_are_none_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "short.yaml"
    path.write_text(MISSIONS["short"])
    server = MissionServer(cast(Node, _Silent()), ["--simulate", "nonsense"])
    deep, escape = "[" * 100_000, json.dumps({"who": "\x1b[2J"})
    for name, params in ((str(path), ""), ("../x", ""), ("greet", deep), ("greet", escape), ("--help", "")):
        values = SimpleNamespace(mission=name, parameters=params)
        assert not server._begin(Goal(cast(ActionServer, None), [], values))


def test_runs_that_nodes_start_are_in_the_domain_of_who_starts_them() -> None:
    words = options_of_runs("turtlebot4", None, 42, "wire", None)
    assert words == ["--robot", "turtlebot4", "--simulate", "wire", "--ros2-domain", "42", "--ros2"]
    keys = RunRequest("greet", robot="turtlebot4", ros2_domain=42).robot_file().keys(ZenohKeys)
    assert keys is not None
    assert keys.domain == 42
    assert announcer_of("turtlebot4", None, 42)._domain == 42
    assert RunRequest("greet", robot="turtlebot2", ros2_domain=42).robot_file().name == "turtlebot2"


def test_params_of_a_goal_are_words_as_a_mission_has_them() -> None:
    told = _params('{"loud": true, "who": "Anna", "times": 3, "patience": "5 s", "quiet": false}')
    assert told == ["loud=true", "who=Anna", "times=3", "patience=5 s", "quiet=false"]
    assert _params("[1]") is None


def test_a_cancel_of_a_goal_whose_run_has_ended_does_not_stop_the_next(monkeypatch: pytest.MonkeyPatch) -> None:
    stopped = list[object]()
    monkeypatch.setattr(offering, "_stop", stopped.append)
    server = MissionServer(cast(Node, _Silent()), [])
    values = SimpleNamespace(mission="greet", parameters="")
    before, now = (Goal(cast(ActionServer, None), [number], values) for number in (1, 2))
    server._running, server._goal = cast(Any, "the run of now"), now
    server._cancel(before)
    assert stopped == [None]
    server._cancel(now)
    assert stopped == [None, "the run of now"]
