"""Folders that hang, as a home on a network disk that has gone: they delay no stop, neither who asks nor who hears."""

import io
import os
import selectors
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from threading import Event
from typing import Any

import pytest

from drivers.clock import SystemClock
from missions.control import run_folders as slow_folders
from missions.control import sockets
from missions.control.command_broadcast import send_to_all
from missions.control.control import CHECK_INTERVAL, Endpoint
from missions.control.messages import RunMessage
from missions.control.notes import was_stopped_since, write_stamp
from missions.control.processes import identity_of
from missions.control.run_folders import FolderTimeoutError, call_all_with_timeout, call_with_timeout, run_folders
from missions.control.run_search import search_runs
from missions.control.sockets import RunConnection
from tests.missions.studio.running import DRIVING, REST, run_of, seconds_to_rest
from tests.waiting import wait_until

CALLS = ("stat", "lstat", "open", "listdir", "scandir", "mkdir", "unlink", "replace", "rename", "chmod", "readlink")
"""The calls of ``os`` that hang on a folder that does."""

STOP = [{"do": "stop"}]


@contextmanager
def hanging(*folders: Path) -> Iterator[None]:
    """Let each call of this process on one of these folders, or on what is in it, hang until this is over."""
    over = Event()
    roots = tuple(str(folder) for folder in folders)

    def hang(call: Callable[..., Any], path: Any, *more: Any, **named: Any) -> Any:
        if isinstance(path, str | os.PathLike) and os.fspath(path).startswith(roots):
            over.wait()
        return call(path, *more, **named)

    with pytest.MonkeyPatch.context() as patch:
        for name in CALLS:
            patch.setattr(os, name, partial(hang, getattr(os, name)))
        patch.setattr(io, "open", partial(hang, io.open))
        try:
            yield
        finally:
            over.set()
            for thread in [*slow_folders._hung_threads.values()]:
                thread.join(10.0)


def roots() -> list[Path]:
    """Return all folders in which runs of this user can be."""
    return [place.folder for place in run_folders()]


@pytest.mark.real_time
def test_a_stop_reaches_a_run_at_once_though_every_folder_hangs(tmp_path: Path) -> None:
    with run_of(tmp_path, DRIVING) as (process, base):
        wait_until(lambda: base.seen().top > 0.15)
        asked = base.seen().heard_at
        with hanging(*roots()):
            said = send_to_all(STOP, "test")
            assert seconds_to_rest(base, asked) < REST
        words = "\n".join(words for _, words in said.values())
        assert f"{process.process.pid}: driving on turtlebot2: stopped (base)" in words
        assert "does not respond (network disk disconnected?)" in words  # what is in there could move on
        assert process.process.poll() is None


def test_run_is_tried_by_its_socket_file_before_any_signal(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    tried = []
    connect = RunConnection.open

    def by_file_alone(where: sockets.Address) -> RunConnection:
        tried.append(where)
        if isinstance(where, str):
            raise TimeoutError("it does not answer by name")
        return connect(where)

    with run_of(tmp_path, DRIVING) as (process, base):
        wait_until(lambda: base.seen().top > 0.15)
        monkeypatch.setattr(RunConnection, "open", by_file_alone)
        ((good, words),) = send_to_all(STOP, "test").values()
        assert (good, words) == (True, f"{process.process.pid}: driving on turtlebot2: stopped (base)")
        assert {type(where) for where in tried} == {str, type(tmp_path)}
        assert process.process.poll() is None


def test_failed_request_is_tried_over_another_address(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ask = RunConnection.request
    failed: list[object] = []

    def lost_once(self: RunConnection, command: Any, **more: Any) -> Any:
        if not failed:
            failed.append(command)
            raise TimeoutError("it does not answer")
        return ask(self, command, **more)

    monkeypatch.setattr(RunConnection, "request", lost_once)
    with run_of(tmp_path, DRIVING) as (process, _):
        ((good, words),) = send_to_all(STOP, "test").values()
        assert (good, words) == (True, f"{process.process.pid}: driving on turtlebot2: stopped (base)")


@pytest.mark.real_time
def test_run_keeps_its_sockets_while_folders_hang() -> None:
    selector = selectors.DefaultSelector()
    mine = RunMessage(run=str(os.getpid()), pid=os.getpid(), mission="m", robot="r", simulated="", began=0.0)
    endpoint = Endpoint(selector, mine)
    endpoint.run_due_checks(0.0)
    before = endpoint.listeners
    with hanging(*roots(), Path.home()):
        clock = SystemClock()
        for turn in range(1, 20):
            endpoint.run_due_checks(turn * CHECK_INTERVAL)
        assert clock.now() < 2.0  # 19 looks: only the first one waits, once for each folder
        assert (endpoint.listeners, endpoint.trouble) == (before, "")
    endpoint.run_due_checks(20 * CHECK_INTERVAL)
    assert (endpoint.listeners, endpoint.trouble) == (before, "")
    endpoint.close()
    selector.close()


def test_hanging_folder_makes_stop_uncertain_and_others_are_searched() -> None:
    first, *_ = roots()
    process = identity_of(os.getpid())
    assert process is not None
    with hanging(first):
        write_stamp()
        assert was_stopped_since(process)
        (doubt,) = search_runs().warnings
        assert doubt.reason == f"{first} cannot be read: {first} does not respond (network disk disconnected?)"
    for place in run_folders():
        (place.folder / "newest.stop").unlink(missing_ok=True)


def test_hung_folder_gets_one_call_and_is_used_again_afterwards(tmp_path: Path) -> None:
    over, calls = Event(), []

    def work() -> str:
        calls.append(1)
        over.wait()
        return "done"

    for _ in range(5):
        with pytest.raises(FolderTimeoutError):
            call_with_timeout(tmp_path, work, 0.0)
    assert len(calls) == 1
    over.set()
    slow_folders._hung_threads[tmp_path].join()
    assert call_with_timeout(tmp_path, work) == "done"


def test_each_folder_has_its_own_result_or_error(tmp_path: Path) -> None:
    there, gone = tmp_path, tmp_path / "gone"
    found = call_all_with_timeout({there: partial(os.listdir, there), gone: partial(os.listdir, gone)})
    assert found[there] == []
    assert isinstance(found[gone], FileNotFoundError)
    with pytest.raises(FileNotFoundError):
        call_with_timeout(gone, partial(os.listdir, gone))
    with pytest.raises(ZeroDivisionError):
        call_with_timeout(there, lambda: 1 // 0)
