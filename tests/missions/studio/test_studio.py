"""The studio with a run on a virtual base: whatever becomes of studio, link or client, the base comes to rest."""

import asyncio
import signal
import socket
from collections.abc import Iterator, Mapping
from contextlib import ExitStack
from itertools import pairwise
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from missions.plugins.studio.run_feed import AsyncRunLink
from missions.plugins.studio.studio_commands import protocol_schema
from tests.missions.command import Process
from tests.missions.lone_base import LoneBase
from tests.missions.studio.running import DRIVING, REST, run_of, seconds_to_rest, simulated_run
from tests.missions.studio.serving import Client, Served, studio
from tests.waiting import wait_until


class Driver:
    """An operator at the stick."""

    def __init__(self, client: Client, run: str) -> None:
        self.client, self.run = client, run
        self.number = 0
        self.client.ask("watch", run=run, state=False)

    def take(self) -> bool:
        return bool(self.client.ask("take", run=self.run)["result"]["yours"])

    def push(self, ahead: float = 1.0) -> None:
        self.number += 1
        self.client.drive(self.run, ahead)

    def push_until_it_moves(self, base: LoneBase) -> float:
        """Drive, and return when, by the base's own clock, the last command was given."""

        def moves() -> bool:
            self.push(0.0 if self.number % 100 == 99 else 1.0)  # lets go now and then: commands may have come late
            return base.seen().top > 0.1

        wait_until(moves, pause=0.02)
        self.push()
        return base.seen().heard_at


@pytest.fixture
def scene(tmp_path: Path, served: Served) -> Iterator[tuple[Served, Process, LoneBase]]:
    with run_of(tmp_path) as (process, base):
        yield served, process, base


def driver(served: Served, process: Process, ends: ExitStack) -> Driver:
    client, run = ends.enter_context(served.client(served.operator)), str(process.process.pid)
    client.hear_of(run)
    found = Driver(client, run)
    wait_until(found.take)  # once who drove before is known to have gone
    return found


@pytest.mark.real_time
def test_base_rests_when_its_driver_is_silent_or_its_websocket_closes(
    scene: tuple[Served, Process, LoneBase],
) -> None:
    served, process, base = scene
    with ExitStack() as ends:
        since = driver(served, process, ends).push_until_it_moves(base)
        assert seconds_to_rest(base, since) < REST
    with ExitStack() as ends:
        since = driver(served, process, ends).push_until_it_moves(base)
    assert seconds_to_rest(base, since) < REST


@pytest.mark.real_time
def test_base_rests_and_the_run_continues_when_the_studio_dies(tmp_path: Path) -> None:
    with run_of(tmp_path) as (process, base):
        for number in (signal.SIGSTOP, signal.SIGKILL):
            with studio() as served, ExitStack() as ends:
                since = driver(served, process, ends).push_until_it_moves(base)
                served.process.process.send_signal(number)
                ends.callback(served.process.process.kill)
                assert seconds_to_rest(base, since) < REST, number
                assert process.process.poll() is None, number


@pytest.mark.real_time
def test_a_viewer_stops_and_an_operator_releases(served: Served, tmp_path: Path) -> None:
    schema = protocol_schema()
    with run_of(tmp_path, DRIVING) as (process, base):
        run = str(process.process.pid)
        with served.client(served.viewer) as viewer, served.client(served.operator) as operator:
            viewer.hear_of(run)
            wait_until(lambda: base.seen().moving)
            since = base.seen().heard_at
            answer = viewer.ask("stop")
            assert answer["result"] == {"stopped": {run: {"parts": ["base"], "stops": 1}}}
            assert seconds_to_rest(base, since) < REST
            told = operator.hear(lambda told: told["say"] == "runs" and any(each["stops"] for each in told["runs"]))
            jsonschema.validate(told, schema)
            assert told["runs"][0]["stopped"] == f"stopped by {viewer.welcome['name']}"
            assert viewer.ask("release", run=run, stop=1)["error"] == "not_allowed"
            assert operator.ask("resume", run=run)["error"] == "stopped"
            assert operator.ask("release", run=run, stop=1)["ok"]
            assert not base.seen().moving
            assert operator.ask("resume", run=run)["ok"]
            wait_until(lambda: base.seen().moving)
            assert operator.ask("halt", run=run)["ok"]
            operator.hear(lambda told: told["say"] == "runs" and not told["runs"])
            assert operator.ask("pause", run=run)["error"] == "no_such_run"
        log = (served.state / "missiontree" / "studio.log").read_text(encoding="utf-8")
        assert '"do": "stop"' in log
        assert served.operator not in log


def test_one_client_drives_and_hands_over_on_request(scene: tuple[Served, Process, LoneBase]) -> None:
    served, process, _ = scene
    with ExitStack() as ends:
        first = driver(served, process, ends)
        other = Driver(ends.enter_context(served.client(served.operator)), first.run)
        assert not other.take()
        first.client.send(do="watch", run=first.run)
        asked = first.client.hear(lambda told: told["say"] in ("scene", "state"))
        state = asked.get("state", asked)
        assert (state["driver"], state["asking"]) == (first.client.welcome["name"], [other.client.welcome["name"]])
        other.client.send(do="drive", run=first.run, n=1, stamp=0, ahead=1.0, left=0.0)
        assert other.client.hear(lambda told: told["say"] == "answer")["error"] == "no_wheels"
        assert first.client.ask("give", run=first.run)["ok"]
        assert other.take()


def test_killed_run_is_reported_as_over_without_a_result(served: Served, tmp_path: Path) -> None:
    with simulated_run(tmp_path) as process, served.client(served.viewer) as client:
        client.hear_of(run := str(process.process.pid))
        client.ask("watch", run=run)
        process.process.kill()
        assert client.hear(lambda told: told["say"] == "over")["result"] == ""


def test_a_mission_is_chosen_started_watched_and_looked_back_at(served: Served, tmp_path: Path) -> None:
    schema = protocol_schema()
    with served.client(served.operator) as client:
        library = client.ask("library")["result"]
        assert {"greet", "patrol"} <= {each["name"] for each in library["missions"]}
        shapes = {each["name"]: each["shape"] for each in library["missions"]}
        assert shapes["motions/forward"][0] == 0
        assert all(below <= above + 1 for shape in shapes.values() for above, below in pairwise(shape))
        assert len(library["motions"]) == 8
        form = {each["name"]: each for each in client.ask("mission", name="patrol")["result"]["params"]}
        assert form["corners"]["low"] == "2"
        assert form["side"]["units"] == ["m", "cm", "mm"]
        assert "<svg" in client.ask("world", name="living_room")["result"]["svg"]
        refused = client.ask("start", mission="greet", robot="turtlebot2")
        assert refused["error"] == "not_sure"
        assert client.ask("start", mission=str(tmp_path / "x.yaml"))["error"] == "bad_file"
        assert client.ask("start", mission="greet", params={"patience": "many"})["error"] == "cannot_start"
        began = client.ask("start", mission="greet", simulate="fast", speed=20.0)
        run = began["result"]["run"]
        client.send(do="watch", run=run, events=True)
        jsonschema.validate(client.hear(lambda told: told["say"] == "scene"), schema)
        jsonschema.validate(client.hear(lambda told: told["say"] == "events"), schema)
        over = client.hear(lambda told: told["say"] == "over")
        client.hear(lambda told: told["say"] == "runs" and not told["runs"])
        wait_until(lambda: client.ask("records")["result"]["records"][0].get("result"))
        entry = client.ask("records")["result"]["records"][0]
        assert (entry["mission"], entry["result"]) == ("greet", over["result"])
        record = piece = client.ask("record", name=entry["name"])["result"]
        lane = [*piece["lanes"]["1"]]
        while "more" in piece:  # a busy machine reads it in several
            piece = client.ask("record", name=entry["name"], start=piece["more"])["result"]
            lane += piece["lanes"].get("1", [])
        assert lane[-1][1] == over["result"]
        moment = client.ask("moment", name=entry["name"], t=record["until"] / 2)["result"]
        assert moment["changed"]["1"][0] == "running"
        assert moment["picture"]["width"] > 0
        assert moment["percept"]["event"] == "percept"
        assert all(each["kind"] == "face" for each in moment["picture"]["found"])
        assert client.ask("record", name="../studio.log")["error"] == "no_such_record"


def test_a_task_is_added_moved_and_cancelled(served: Served) -> None:
    with served.client(served.operator) as client:
        assert client.ask("add_task", mission="look_around", at="25:99")["error"] == "bad_task"
        number = client.ask("add_task", mission="look_around", simulate="fast", every="day 18:00")["result"]["task"]
        assert client.ask("move_task", task=number, priority=7)["ok"]
        tasks = {each["id"]: each for each in client.ask("tasks")["result"]["tasks"]}
        assert (tasks[number]["priority"], tasks[number]["every"]) == (7, "day 18:00")
        assert client.ask("cancel_task", task=number)["ok"]
        assert client.ask("cancel_task", task=number)["error"] == "bad_task"


def test_studio_beside_a_run_ends_with_the_run(tmp_path: Path) -> None:
    path = tmp_path / "brief.yaml"
    path.write_text("mission: brief\ntree:\n  wait: 1000 s\n", encoding="utf-8")
    process = Process("run", str(path), "--studio")
    wait_until(lambda: any("studio: http" in line for line in process.errors), 60.0)
    port = int(next(line for line in process.errors if "studio: http" in line).split(":")[3].partition("/")[0])
    assert process.end(signal.SIGTERM) == 130
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(("127.0.0.1", port))


def test_stop_does_not_wait_for_clients_that_do_not_read(served: Served, tmp_path: Path) -> None:
    """How quick it is beside eight clients, ``tests.benchmarks.pressing`` measures."""
    with simulated_run(tmp_path) as process, ExitStack() as ends:
        run = str(process.process.pid)
        for number in range(3):
            client = ends.enter_context(served.client(served.viewer))
            client.hear_of(run)
            client.send(do="watch", run=run, events=number == 0, pictures=10)
        operator = ends.enter_context(served.client(served.operator))
        operator.hear_of(run)
        for number in (1, 2, 3):
            assert operator.ask("stop")["result"]["stopped"][run]["parts"] == ["base"]
            assert operator.ask("release", run=run, stop=number)["ok"]


class SlowLink(AsyncRunLink):
    """Connection to a run whose base confirms only the second try of a stop."""

    def __init__(self) -> None:
        self.presses: list[object] = []

    async def request(self, command: Mapping[str, object], timeout: float = 0.0) -> Mapping[str, Any]:
        del timeout
        self.presses.append(command["press"])
        return {"ok": True, "result": {"missing": ["base"]} if len(self.presses) == 1 else {"parts": ["base"]}}


def test_tries_of_one_stop_have_one_press() -> None:
    link = SlowLink()
    assert asyncio.run(link.stop("me", "")) == {"parts": ["base"]}
    first, second = link.presses
    assert first == second != ""
