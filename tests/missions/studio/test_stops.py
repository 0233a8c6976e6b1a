"""Stops that come in the way of something: of many others, of a client that reads nothing, of a run that begins."""

import asyncio
import json
import os
import socket
import sys
import time
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager
from pathlib import Path
from subprocess import Popen
from typing import Any, cast

import pytest
from starlette.websockets import WebSocketDisconnect

from drivers.clock import ManualClock
from missions.control import sockets
from missions.control.commands import BadMessage, StopCommand
from missions.control.messages import RunsMessage
from missions.plugins.studio.access import StudioAccess
from missions.plugins.studio.audit_log import AuditLog
from missions.plugins.studio.client_session import ClientSession
from missions.plugins.studio.file_reader import FileReader
from missions.plugins.studio.run_feed import AsyncRunLink
from missions.plugins.studio.run_launcher import RunLauncher
from missions.plugins.studio.studio import Studio
from missions.plugins.studio.studio_commands import StartRun, TasksQuery
from tests.missions.studio.running import found_of

PATIENCE = 60.0


@pytest.fixture
def number(monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """The number of a process that stands in for a run, and has all the time that it needs to answer."""
    monkeypatch.setattr(AsyncRunLink.request, "__defaults__", (PATIENCE,))
    with Popen(["sleep", "1000"]) as process:
        yield str(process.pid)
        process.kill()


class StandInRun:
    """A control socket of the process of this number that counts what it is asked, and answers when it is let."""

    def __init__(self, number: str) -> None:
        self.number = number
        self.asked: list[dict[str, Any]] = []
        self.answers = asyncio.Event()

    @asynccontextmanager
    async def served(self) -> AsyncIterator[None]:
        listening = sockets.listen(sockets.socket_path(self.number))
        server = await asyncio.start_unix_server(self._serve, sock=listening)
        async with server:
            yield
            server.close()
        sockets.socket_path(self.number).unlink()

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        writer.write(json.dumps({"say": "run", "run": self.number}).encode() + b"\n")
        while line := await reader.readline():
            self.asked.append(json.loads(line))
            await self.answers.wait()
            answer = {"say": "answer", "id": self.asked[-1]["id"], "ok": True, "result": {"parts": ["base"]}}
            writer.write(json.dumps(answer, separators=(",", ":")).encode() + b"\n")
        writer.close()


class Deaf:
    """A websocket whose client reads nothing."""

    def __init__(self) -> None:
        self.reached = asyncio.Event()

    async def send_text(self, text: str) -> None:
        del text
        self.reached.set()
        await asyncio.Event().wait()


def studio_of(folder: Path, launcher: RunLauncher | None = None) -> Studio:
    return Studio(AuditLog(folder / "log"), launcher or RunLauncher(record=False), cast("Any", None), StudioAccess())


def test_concurrent_stops_are_merged_into_one_more(tmp_path: Path, number: str) -> None:
    async def work() -> None:
        run, studio = StandInRun(number), studio_of(tmp_path)
        async with run.served(), studio.hub:
            await studio.hub.search()
            first = asyncio.create_task(studio.hub.stop("", "first"))
            while not run.asked:
                await asyncio.sleep(0)
            others = [asyncio.create_task(studio.hub.stop("", "others")) for _ in range(500)]
            await asyncio.sleep(0)
            run.answers.set()
            told = await asyncio.gather(first, *others)
        assert [each["by"] for each in run.asked] == ["first", "others"]
        assert all(each == {number: {"parts": ["base"]}} for each in told)

    asyncio.run(asyncio.wait_for(work(), PATIENCE))


class Leaving:
    """A websocket whose client says these lines and has gone at once."""

    def __init__(self, *lines: str) -> None:
        self._lines = [*lines]

    async def accept(self) -> None:
        pass

    async def receive(self) -> dict[str, object]:
        if not self._lines:
            return {"type": "websocket.disconnect", "code": 1006}
        return {"type": "websocket.receive", "text": self._lines.pop(0)}

    async def send_text(self, text: str) -> None:
        del text
        if not self._lines:
            raise WebSocketDisconnect


@pytest.mark.parametrize("which", ["", "one"])
def test_stop_is_sent_and_logged_although_its_client_has_left(tmp_path: Path, number: str, which: str) -> None:
    async def work() -> None:
        run, studio = StandInRun(number), studio_of(tmp_path)
        run.answers.set()
        stop = {"do": "stop", "press": "a", **({"run": number} if which else {})}
        client = Leaving('{"do": "hello", "version": "2"}', json.dumps(stop))
        async with run.served(), studio.hub:
            await studio.hub.search()
            await ClientSession(cast("Any", client), "viewer", "gone", studio).run()
            while not run.asked:
                await asyncio.sleep(0)
        assert [each["by"] for each in run.asked] == ["gone"]
        assert '"stop"' in (tmp_path / "log").read_text()

    asyncio.run(asyncio.wait_for(work(), 10.0))


def test_another_press_is_another_stop(tmp_path: Path, number: str) -> None:
    async def work() -> None:
        run, studio = StandInRun(number), studio_of(tmp_path)
        async with run.served(), studio.hub:
            await studio.hub.search()
            asked = [asyncio.create_task(studio.hub.stop("", "viewer", "a"))]
            while not run.asked:
                await asyncio.sleep(0)
            presses = ["a", "b", "a", *map(str, range(100))]
            asked += [asyncio.create_task(studio.hub.stop("", "viewer", press)) for press in presses]
            await asyncio.sleep(0)
            run.answers.set()
            await asyncio.gather(*asked)
        *first, last = [each["press"] for each in run.asked]
        assert first == ["a", "a", "b", "0"]
        assert last not in ("", *presses)  # one stop for all the others

    asyncio.run(asyncio.wait_for(work(), PATIENCE))


def test_client_that_does_not_read_does_not_delay_the_run_list(tmp_path: Path, number: str) -> None:
    async def work() -> None:
        run, studio, deaf = StandInRun(number), studio_of(tmp_path), Deaf()
        run.answers.set()
        session = ClientSession(cast("Any", deaf), "viewer", "deaf", studio)
        session.send_runs(RunsMessage(runs=[]))
        stuck = asyncio.create_task(session._send_newest_runs())
        await deaf.reached.wait()
        with studio.register(session):
            async with run.served(), studio.hub:
                await studio.hub.search()
                assert number in await studio.stop("", "viewer 2")
        stuck.cancel()

    asyncio.run(asyncio.wait_for(work(), PATIENCE))


def test_starting_run_does_not_begin_after_a_stop(tmp_path: Path) -> None:
    launcher = RunLauncher(record=False, command=(sys.executable, "-c", "import time; time.sleep(1000)"))
    studio = studio_of(tmp_path, launcher)

    async def work() -> None:
        asked_before = launcher.stops
        start = asyncio.create_task(launcher.start(StartRun(mission="greet"), asked_before))
        while not launcher.running:
            await asyncio.sleep(0.01)
        await studio.stop("", "viewer 1")
        with pytest.raises(BadMessage, match="stopped before it began"):
            await start
        with pytest.raises(BadMessage, match="stopped before it began"):
            await launcher.start(StartRun(mission="greet"), asked_before)
        while launcher.running:
            await asyncio.sleep(0.01)

    asyncio.run(asyncio.wait_for(work(), PATIENCE))


def test_slow_files_do_not_block_other_reads(monkeypatch: pytest.MonkeyPatch) -> None:
    async def work() -> None:
        hanging = [asyncio.create_task(reader._work(cast("Any", time.sleep), cast("Any", 1000.0))) for _ in range(3)]
        for each in hanging:
            with pytest.raises(BadMessage):
                await each
        monkeypatch.setattr("missions.plugins.studio.file_reader.WORK_TIMEOUT", PATIENCE)
        assert (await reader.do(TasksQuery()))["tasks"] == []

    monkeypatch.setattr("missions.plugins.studio.file_reader.WORK_TIMEOUT", 0.5)
    reader = FileReader()
    try:
        asyncio.run(asyncio.wait_for(work(), 2 * PATIENCE))
    finally:
        reader.close()


def test_viewer_flooding_the_audit_log_displaces_no_entry(tmp_path: Path) -> None:
    clock = ManualClock()
    audit = AuditLog(tmp_path / "log", clock=clock)
    audit.write("operator 1", "operator", {"do": "start"}, "ok")
    for _ in range(100_000):
        audit.write("viewer 1", "viewer", {"do": "start"}, "not_allowed")
    audit.write("viewer 2", "viewer", {"do": "stop"}, "ok")  # which what is refused does not crowd out
    clock.advance(60.0)
    audit.write("viewer 1", "viewer", {"do": "start"}, "not_allowed")
    lines = [json.loads(line) for line in audit.path.read_text().splitlines()]
    assert len(lines) == 1 + 20 + 1 + 1
    assert [lines[number]["who"] for number in (0, -2)] == ["operator 1", "viewer 2"]
    assert lines[-1]["unwritten"] == 99_980


def test_one_press_of_stop_is_logged_once(tmp_path: Path) -> None:
    studio = studio_of(tmp_path)
    for number, press in ((1, "a"), (2, "a"), (3, "b"), (3, ""), (3, "")):
        client = ClientSession(cast("Any", Deaf()), "viewer", f"viewer {number}", studio)
        studio.log_command(client, "viewer", StopCommand(press=press), "ok")
    lines = [json.loads(line) for line in (tmp_path / "log").read_text().splitlines()]
    assert [each["who"] for each in lines] == ["viewer 1", "viewer 3", "viewer 3", "viewer 3"]
    assert not any("press" in each for each in lines)


def test_socket_path_exists_only_while_the_socket_listens(monkeypatch: pytest.MonkeyPatch) -> None:
    path = sockets.socket_path(str(os.getpid()))
    there = []
    listen = socket.socket.listen

    def listening(self: socket.socket, backlog: int) -> None:
        there.append(path.exists())
        listen(self, backlog)

    monkeypatch.setattr(socket.socket, "listen", listening)
    with sockets.listen(path):
        assert (there, path.exists()) == ([False], True)
        assert [each.addresses for each in found_of(os.getpid())] == [(path,)]
    path.unlink()


def test_socket_of_a_living_process_is_not_removed() -> None:
    path = sockets.socket_path(str(os.getpid()))
    with socket.socket(socket.AF_UNIX) as bound:
        bound.bind(str(path))
        with pytest.raises(ConnectionRefusedError):
            sockets.connect(path)
        assert path.exists()
    path.unlink()
