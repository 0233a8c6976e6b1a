"""The search for what moves: what cannot be looked at is a doubt, and no other process is taken for a run."""

import asyncio
import errno
import json
import os
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from threading import Thread
from typing import Self

import pytest

from missions.cli.root import mission
from missions.control import abstract_sockets, command_broadcast, run_folders, sockets
from missions.control.abstract_sockets import AbstractName
from missions.control.commands import WatchCommand
from missions.control.notes import RunNotes
from missions.control.processes import identity_of
from missions.control.run_search import MANUAL_STOP_HINT, FoundProcess, SearchResult, search_runs
from missions.plugins.studio import run_hub
from missions.plugins.studio.run_feed import FeedClient
from missions.plugins.studio.run_hub import UNKNOWN_RUN, RunHub
from tests.missions.command import PATIENCE, command
from tests.missions.studio.running import simulated_run
from tests.waiting import wait_until

ERRORS = (errno.EACCES, errno.EMFILE, errno.ENFILE, errno.EIO, errno.ESTALE, errno.ELOOP)


@contextmanager
def sleeper(program: str = "import sys; sys.stdin.read()") -> Iterator[subprocess.Popen[str]]:
    """A process that ends with this; its first line of output says that it has begun, if it has one."""
    words = [sys.executable, "-c", program]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        try:
            yield process
        finally:
            process.kill()


NOTED = """
import sys
from missions.control.notes import RunNotes
notes = RunNotes({run}, "driving", "turtlebot2", "", is_run=True)
notes.write(["/nowhere/4711.sock"])
print("noted", flush=True)
sys.stdin.read()
"""


@contextmanager
def noted_run() -> Iterator[subprocess.Popen[str]]:
    """A process with the note of a run, which nobody reaches at its socket."""
    with sleeper(NOTED.format(run="str(__import__('os').getpid())")) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "noted\n"
        yield process


def note_of(process: int) -> Path:
    return sockets.socket_folder() / f"{process}.note"


# --- what cannot be looked at -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("number", ERRORS)
def test_unreadable_folder_makes_stop_uncertain(
    number: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    sockets.socket_folder()

    def refuse(folder: Path) -> list[str]:
        raise OSError(number, os.strerror(number), str(folder))

    monkeypatch.setattr(os, "listdir", refuse)
    for words in (["stop"], ["stop", "--list"], ["stop", "--release"], ["stop", "greet"]):
        told = command(capsys, *words)
        assert told.code == 1
        assert "no mission is running" not in told.out
        assert os.strerror(number) in told.out + told.err
    assert "perhaps not stopped: " in command(capsys, "stop").out
    found = asyncio.run(RunHub(lambda: None).stop("", "a test"))
    assert "perhaps not stopped" in str(found[UNKNOWN_RUN]["trouble"])  # type: ignore[index]


def test_unreadable_socket_list_makes_stop_uncertain(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    monkeypatch.setattr(abstract_sockets, "SOCKET_LIST", tmp_path / "missing")
    told = command(capsys, "stop")
    assert (told.code, "missing cannot be read" in told.out) == (1, True)


def test_folder_of_another_user_is_ignored(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    folder = tmp_path / "missiontree/runs"
    folder.mkdir(parents=True)
    (folder / "1.note").write_text("of another user", encoding="utf-8")
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    monkeypatch.setattr(os, "geteuid", lambda: os.getuid() + 12345)
    monkeypatch.setattr(abstract_sockets, "listed_names", list)
    assert command(capsys, "stop").out == "no mission is running\n"


@pytest.mark.parametrize(("kind", "doubts"), [("run", 1), ("command", 1), ("run-simulated", 0)])
def test_real_robot_of_another_user_makes_stop_uncertain(
    kind: str, doubts: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    identity = identity_of(os.getpid())
    assert identity is not None
    monkeypatch.setattr(abstract_sockets, "listed_names", lambda: [AbstractName(2, "4711", identity, kind)])
    monkeypatch.setattr(os, "geteuid", lambda: 1)
    told = command(capsys, "stop")
    assert told.code == doubts
    assert ("sudo mission stop" in told.out) == bool(doubts)


# --- whom a note means ------------------------------------------------------------------------------------------------


def test_a_process_with_a_note_and_without_a_socket_is_ended_by_sigterm(capsys: pytest.CaptureFixture[str]) -> None:
    with noted_run() as process:
        told = command(capsys, "stop")
        assert process.wait(PATIENCE) == -15
    assert told.code == 0
    assert told.out.startswith(
        f"{process.pid}: driving on turtlebot2: hangs (No such file or directory); ended by SIGTERM"
    )
    assert command(capsys, "stop").out == "no mission is running\n"


def test_process_with_a_reused_pid_is_not_ended(capsys: pytest.CaptureFixture[str]) -> None:
    with noted_run() as run:
        about = json.loads(note_of(run.pid).read_text(encoding="utf-8"))
    with sleeper() as process:
        pid, start, boot, namespace = about["process"]
        for number, (since, when) in enumerate([(start, boot), (1, boot), (start, "an earlier start")]):
            about |= {"process": [process.pid, since, when, namespace], "run": str(process.pid)}
            note_of(process.pid + number).write_text(json.dumps(about) + "\n", encoding="utf-8")
        told = command(capsys, "stop")
        assert process.poll() is None
    assert (told.code, told.out) == (0, "no mission is running\n")
    assert list(sockets.socket_folder().glob("*.note")) == []
    assert pid == run.pid


def test_note_of_another_computer_is_left_unchanged(capsys: pytest.CaptureFixture[str]) -> None:
    with noted_run() as run:
        about = json.loads(note_of(run.pid).read_text(encoding="utf-8"))
    about["computer"] = "another"
    about["process"][2] = "the boot of another computer"
    note_of(run.pid).write_text(json.dumps(about) + "\n", encoding="utf-8")
    assert command(capsys, "stop").out == "no mission is running\n"
    assert note_of(run.pid).exists()


@pytest.mark.parametrize(
    "text", ["", "{", "[]", '{"name": 1}', "null", "[" * 50_000, '{"a":' * 10_000, '{"process": [1e999, 1, "", 1]}']
)
def test_invalid_note_makes_stop_uncertain_while_its_process_lives(
    text: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with sleeper() as process:
        note_of(process.pid).write_text(text, encoding="utf-8")
        told = command(capsys, "stop")
        assert (told.code, "cannot be understood" in told.out) == (1, True)
        assert process.poll() is None
    process.wait()
    assert command(capsys, "stop").code == 0
    assert not note_of(process.pid).exists()


def test_run_in_another_pid_namespace_makes_stop_uncertain(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    write, own = json.dumps, identity_of(os.getpid())
    assert own is not None
    with monkeypatch.context() as patch:
        patch.setattr("missions.control.notes.json.dumps", lambda told: write({**told, "process": [1, 2, own.boot, 3]}))
        notes = RunNotes("1", "driving", "turtlebot2", "", is_run=True)
        notes.write()
    told = command(capsys, "stop")
    notes.close()
    assert told.code == 1
    assert "is in another container, or on another computer: perhaps not stopped" in told.out


def test_a_pipe_in_the_place_of_a_note_is_not_waited_for(capsys: pytest.CaptureFixture[str]) -> None:
    os.mkfifo(note_of(1))
    told = command(capsys, "stop")
    note_of(1).unlink()
    assert (told.code, "is not a regular file" in told.out) == (1, True)


def in_another_container(patch: pytest.MonkeyPatch) -> None:
    """See runs as from outside of their container, with the same home: other host name, other network namespace."""
    system, _, *others = os.uname()
    patch.setattr(os, "uname", lambda: os.uname_result((system, "outside", *others)))
    patch.setattr(abstract_sockets, "listed_names", list)


def refuse_notes(patch: pytest.MonkeyPatch) -> None:
    """See runs as from outside of a container that has a number of its own for the boot: their notes do not count."""
    in_another_container(patch)
    patch.setattr("missions.control.run_search.read_note", lambda _: None)


@pytest.mark.parametrize("see", [in_another_container, refuse_notes])
def test_run_in_a_container_with_shared_home_is_latched_and_not_ended(
    see: Callable[[pytest.MonkeyPatch], None],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    async def stop() -> Mapping[str, object]:
        one = RunHub(lambda: None)
        await one.search()
        told = await one.stop("", "a test")
        await asyncio.gather(*(link.close() for link in one._links.values()))
        return told

    with simulated_run(tmp_path) as run:
        see(monkeypatch)
        stopped = command(capsys, "stop")
        assert (stopped.code, stopped.out.count("\n"), "stopped (" in stopped.out) == (0, 1, True)
        assert list(asyncio.run(stop())) == [str(run.process.pid)]
        assert run.process.poll() is None
        assert "SIGTERM" not in stopped.out


def test_namesakes_socket_file_is_not_used_for_another_run(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    with sleeper() as process, Answering(lambda _: {"result": {"parts": ["base"], "stops": 1}}) as namesake:
        here = identity_of(process.pid)
        assert here is not None
        name = AbstractName(os.geteuid(), "1", replace(here, pid=1, namespace=1), "run", local_identity=here)
        monkeypatch.setattr(abstract_sockets, "names_in_memory", lambda: [name])
        said = command_broadcast.send_to_all([{"do": "stop"}], "a test")
        assert process.wait(PATIENCE) == -15
    assert [told["do"] for told in namesake.asked] == ["stop"]
    assert len(said) == 2


def test_kill_hint_has_the_pid_outside_the_container(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(command_broadcast, "RUN_END_TIMEOUT", 0.05)
    with sleeper("import signal; signal.signal(15, signal.SIG_IGN); print(flush=True); input()") as process:
        assert process.stdout is not None
        process.stdout.readline()
        here = identity_of(process.pid)
        assert here is not None
        inside = replace(here, pid=7, namespace=1)
        found = FoundProcess("7", abstract_name=AbstractName(os.geteuid(), "7", inside, "run", local_identity=here))
        monkeypatch.setattr(command_broadcast, "search_runs", lambda: SearchResult([found]))
        trouble = str(command_broadcast.stop_one(found, "a test")["trouble"])
        assert f"kill -9 {process.pid}" in trouble
    unseen = FoundProcess("7", abstract_name=AbstractName(os.geteuid(), "7", inside, "run"))
    trouble = str(command_broadcast.stop_one(unseen, "a test")["trouble"])
    assert ("kill -9" in trouble, MANUAL_STOP_HINT in trouble) == (False, True)


# --- what a run answers -----------------------------------------------------------------------------------------------


class Answering:
    """A control socket that answers each line by ``answer``, or not at all for None. Its file is in ``folder``."""

    def __init__(
        self, answer: Callable[[Mapping[str, object]], Mapping[str, object] | None], folder: Path | None = None
    ) -> None:
        self.asked: list[Mapping[str, object]] = []
        self._answer = answer
        self.path = (sockets.socket_folder() if folder is None else folder) / "1.sock"
        self._listening = sockets.listen(self.path)
        self._ends: list[socket.socket] = []
        self._threads = [Thread(target=self._serve)]
        self._threads[0].start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._listening.shutdown(socket.SHUT_RDWR)
        for end in self._ends:
            with suppress(OSError):  # it has hung up
                end.shutdown(socket.SHUT_RDWR)
        for thread in self._threads:
            thread.join()
        for end in (self._listening, *self._ends):
            end.close()
        self.path.unlink(missing_ok=True)

    def _serve(self) -> None:
        while True:
            try:
                connection, _ = self._listening.accept()
            except OSError:
                return
            self._ends.append(connection)
            self._threads.append(Thread(target=self._talk, args=(connection,)))
            self._threads[-1].start()

    def _talk(self, connection: socket.socket) -> None:
        with suppress(OSError), connection.makefile("rb") as lines:
            about = {"say": "run", "run": "1", "mission": "driving", "robot": "r", "simulated": "", "began": id(self)}
            connection.sendall(json.dumps(about, separators=(",", ":")).encode() + b"\n")
            for line in lines:
                self.asked.append(command := json.loads(line))
                if command["do"] == "watch":
                    connection.sendall(b'{"say":"scene","run":"1","state":{"stops":1}}\n')
                if (told := self._answer(command)) is not None:
                    answer = {"say": "answer", "id": command.get("id"), "ok": True, **told}
                    connection.sendall(json.dumps(answer, separators=(",", ":")).encode() + b"\n")


@contextmanager
def namesakes() -> Iterator[tuple[Answering, Answering]]:
    """Two runs of one name, as of two containers: the base of the second one is not stopped."""
    first, second = (place.prepare() for place in run_folders.run_folders()[:2])
    with (
        Answering(lambda _: {"result": {"parts": ["head"], "stops": 1}}, first) as one,
        Answering(lambda _: {"result": {"parts": ["head"], "missing": ["base"], "stops": 1}}, second) as other,
    ):
        yield one, other


@pytest.mark.parametrize("linked", [False, True], ids=["searched", "linked"])
def test_uncertain_stop_of_one_of_two_namesakes_is_kept(linked: bool) -> None:
    async def stop() -> list[Mapping[str, object]]:
        one = RunHub(lambda: None)
        if linked:
            await one.search()
            assert {str(each["run"]) for each in one.runs()} == {"1", "1@2"}
        told = await one.stop("", "a test")
        await asyncio.gather(*(link.close() for link in one._links.values()))
        return [dict(each) for each in told.values() if isinstance(each, Mapping)]

    with namesakes() as both:
        told = asyncio.run(stop())
        assert all(len(each.asked) > 0 for each in both)
    assert sorted("perhaps not stopped: base" in str(each.get("trouble", "")) for each in told) == [False, True]


def test_run_with_two_sockets_is_listed_once() -> None:
    """A search finds a run by each of its sockets while its note is not written."""

    async def look() -> list[Mapping[str, object]]:
        one = RunHub(lambda: None)
        for _ in range(2):
            await one.search()
        found = one.runs()
        await asyncio.gather(*(link.close() for link in one._links.values()))
        return found

    first, second = (place.prepare() for place in run_folders.run_folders()[:2])
    with Answering(lambda _: {"result": {"stops": 1}}, first) as run:
        (second / "1.sock").hardlink_to(run.path)
        runs = asyncio.run(look())
        (second / "1.sock").unlink()
    assert [each["run"] for each in runs] == ["1"]


def test_unreachable_namesakes_are_both_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run_hub, "may_be_alive", lambda _: True)
    for place in run_folders.run_folders()[:2]:
        with socket.socket(socket.AF_UNIX) as left:
            left.bind(str(place.prepare() / "1.sock"))

    async def look() -> list[Mapping[str, object]]:
        one = RunHub(lambda: None)
        await one.search()
        return one.runs()

    found = asyncio.run(look())
    for place in run_folders.run_folders()[:2]:
        (place.folder / "1.sock").unlink(missing_ok=True)
    assert [each["run"] for each in found] == ["1", "1@2"]


@pytest.mark.parametrize("line", [b"[]", b"null", b"[" * 50_000, b"{"])
def test_invalid_socket_reply_hides_no_other_run(line: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run_hub, "may_be_alive", lambda _: True)
    first, second = (place.prepare() for place in run_folders.run_folders()[:2])

    async def look() -> list[Mapping[str, object]]:
        async def speak(_: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            writer.write(line + b"\n")
            writer.close()

        one = RunHub(lambda: None)
        async with await asyncio.start_unix_server(speak, second / "2.sock"):
            await one.search()
        found = one.runs()
        await asyncio.gather(*(link.close() for link in one._links.values()))
        return found

    with Answering(lambda _: {"result": {"stops": 1}}, first):
        found = asyncio.run(look())
    (second / "2.sock").unlink(missing_ok=True)
    assert {str(each["run"]): "trouble" in each for each in found} == {"1": False, "2": True}


def test_commands_reach_the_selected_one_of_two_namesakes() -> None:
    async def work() -> None:
        one = RunHub(lambda: None)
        await one.search()
        for name in ("1", "1@2"):
            link = await one.connect(name, lambda line: asyncio.sleep(0))  # noqa: ARG005 - as of a callback
            assert link.where == one._links[name].where
            await link.request({"do": "pause"})
            await link.close()
            hearer = FeedClient(one.feed_of(name))
            await one.feed_of(name).watch(hearer, WatchCommand(run=name))
            assert json.loads(hearer.next_line() or b"{}")["run"] == name
            await one.feed_of(name).close()
        await asyncio.gather(*(link.close() for link in one._links.values()))

    with namesakes() as both:
        asyncio.run(work())
        assert [[told["do"] for told in each.asked] for each in both] == [["pause", "watch"]] * 2


def test_part_that_did_not_confirm_the_stop_is_reported(capsys: pytest.CaptureFixture[str]) -> None:
    with Answering(lambda _: {"result": {"parts": ["head"], "missing": ["base"], "stops": 1}}) as run:
        told = command(capsys, "stop")
    assert told.code == 1
    assert "perhaps not stopped: base (stopped: head)\n  try: mission stop --end" in told.out
    assert len({each["press"] for each in run.asked}) == 1  # asked again, it is the same stop
    assert len(run.asked) == command_broadcast.STOP_TRIES


def test_unanswered_release_is_reported_and_ends_no_run(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sockets, "REPLY_TIMEOUT", 0.1)
    with Answering(lambda _: None):
        told = command(capsys, "stop", "--release")
    assert told.code == 1
    assert "1: a run: hangs" in told.out


def test_unknown_run_name_is_reported_beside_a_known_one(capsys: pytest.CaptureFixture[str]) -> None:
    with Answering(lambda _: {"result": {"parts": ["base"], "stops": 1}}):
        told = command(capsys, "stop", "driving", "typo", "1")
    assert told.out == "1: driving on r: stopped (base)\n".replace("1:", f"{os.getpid()}:")
    assert (told.code, told.err) == (1, "no run typo: `mission stop --list` lists the runs\n")


def test_stop_without_threads_runs_sequentially(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def refuse(thread: Thread) -> None:
        raise RuntimeError(f"can't start new thread {thread.name}")

    with Answering(lambda _: {"result": {"parts": ["base"], "stops": 1}}):
        monkeypatch.setattr(command_broadcast, "Thread", type("NoThread", (Thread,), {"start": refuse}))
        assert "stopped (base)" in command(capsys, "stop").out


def test_exit_code_reports_an_uncertain_stop_without_output(monkeypatch: pytest.MonkeyPatch) -> None:
    def gone(*_: object, **__: object) -> None:
        raise BrokenPipeError

    os.mkfifo(note_of(1))
    monkeypatch.setattr("click.echo", gone)
    try:
        assert mission.main(["stop"], standalone_mode=False) == 1
    finally:
        note_of(1).unlink()
        monkeypatch.undo()


def test_connection_made_during_a_stop_is_stopped(monkeypatch: pytest.MonkeyPatch) -> None:
    def searched(*, thorough: bool = True) -> SearchResult:
        found = search_runs(thorough=thorough)
        if thorough:  # that of a stop
            asyncio.run_coroutine_threadsafe(looked_at.search(), loop[0]).result(PATIENCE)
        return found

    async def stop() -> Mapping[str, object]:
        loop.append(asyncio.get_running_loop())
        told = await looked_at.stop("", "a test")
        assert len(looked_at._links) == 1
        for link in list(looked_at._links.values()):
            await link.close()
        return told

    loop: list[asyncio.AbstractEventLoop] = []
    looked_at = RunHub(lambda: None)
    monkeypatch.setattr(run_hub, "search_runs", searched)
    with Answering(lambda _: {"result": {"parts": ["base"], "stops": 1}}):
        assert asyncio.run(stop()) == {"1": {"parts": ["base"], "stops": 1}}


def test_studio_that_cannot_search_reports_the_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*, thorough: bool) -> SearchResult:
        raise RuntimeError(f"no threads are left, {thorough}")

    changes: list[object] = []

    async def work() -> None:
        looked_at = RunHub(lambda: changes.append(looked_at.runs()))
        async with looked_at:
            while not changes:
                await asyncio.sleep(0)

    monkeypatch.setattr(run_hub, "search_runs", refuse)
    asyncio.run(asyncio.wait_for(work(), PATIENCE))
    why = "the studio cannot search for runs: RuntimeError: no threads are left, False"
    assert changes[0] == [{"run": UNKNOWN_RUN, "trouble": why}]


def test_commands_are_found_without_any_folder_or_list(monkeypatch: pytest.MonkeyPatch) -> None:
    program = (
        "import sys\nfrom missions.control.holders import announce_command\nwith announce_command('teleop', 'r'):\n"
    )
    with sleeper(f"{program}    print(flush=True)\n    sys.stdin.read()\n") as process:
        assert process.stdout is not None
        process.stdout.readline()
        note_of(process.pid).unlink()
        for note in Path(os.environ["XDG_STATE_HOME"]).rglob("*.note"):
            note.unlink()
        for note in Path(os.environ[run_folders.SYSTEM_ROOT]).rglob("*.note"):
            note.unlink()
        monkeypatch.setattr(abstract_sockets, "listed_names", list)  # as in another network namespace
        assert command_broadcast.send_to_all([{"do": "stop"}], "a test") != {}
        wait_until(lambda: process.poll() is not None)
