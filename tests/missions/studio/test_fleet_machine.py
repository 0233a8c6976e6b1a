"""The robot of this machine for its fleet: a stop that failed is tried again, and a search that failed is no peace."""

import errno
import logging
import os
from collections.abc import Callable, Mapping
from dataclasses import replace

import pytest

from missions.control.abstract_sockets import AbstractName
from missions.control.processes import identity_of
from missions.control.run_search import FoundProcess, SearchResult, StopWarning
from missions.plugins.fleet import local_robot
from missions.plugins.fleet.local_robot import LocalRobot


class ThreadAtOnce:
    """Does its work as it starts: the shortest race."""

    def __init__(self, target: Callable[..., None], args: tuple[object, ...] = (), **_: object) -> None:
        self._target, self._args = target, args

    def start(self) -> None:
        self._target(*self._args)

    def join(self, timeout: float | None = None) -> None:
        del timeout


class NoThread(ThreadAtOnce):
    """The system allows no more threads."""

    def start(self) -> None:
        raise RuntimeError("can't start new thread")


def run() -> FoundProcess:
    """Return a run of this process that has no socket."""
    identity = identity_of(os.getpid())
    assert identity is not None
    return FoundProcess("1", abstract_name=AbstractName(os.geteuid(), "1", identity, "run"))


def searched(*results: SearchResult) -> Callable[..., SearchResult]:
    """Return a search that has these results, and then the last one again and again."""
    left = list(results)
    return lambda **_: left.pop(0) if len(left) > 1 else left[0]


@pytest.mark.parametrize("thread", [ThreadAtOnce, NoThread])
@pytest.mark.parametrize("failure", [lambda: {"trouble": "it hangs"}, lambda: 1 // 0], ids=["trouble", "fault"])
def test_a_failed_stop_of_a_new_run_is_tried_again(
    thread: type, failure: Callable[[], Mapping[str, object]], monkeypatch: pytest.MonkeyPatch
) -> None:
    tries: list[str] = []

    def stop(found: FoundProcess, by: str) -> Mapping[str, object]:
        tries.append(f"{found.run} {by}")
        return failure() if len(tries) < 3 else {"parts": ["base"]}

    robot = LocalRobot()
    monkeypatch.setattr(local_robot, "search_runs", searched(SearchResult(), SearchResult([run()])))
    monkeypatch.setattr(local_robot, "send_to_all", lambda *_, **__: {})
    monkeypatch.setattr(local_robot, "stop_one", stop)
    monkeypatch.setattr(local_robot, "Thread", ThreadAtOnce)
    assert robot.stop("Ada") == (True, "stopped; nothing runs")
    monkeypatch.setattr(local_robot, "Thread", thread)
    for _ in range(6):
        try:
            robot._update()
        except ZeroDivisionError:
            continue
    assert tries == ["1 fleet: Ada"] * 3


def test_interrupted_stop_is_tried_again(monkeypatch: pytest.MonkeyPatch) -> None:
    robot, tries = LocalRobot(), list[str]()

    def break_off(*_: object, **__: object) -> Mapping[object, tuple[bool, str]]:
        raise MemoryError

    def stop(found: FoundProcess, _: str) -> Mapping[str, object]:
        tries.append(found.run)
        return {"parts": []}

    def start(thread: ThreadAtOnce) -> None:
        with pytest.raises(MemoryError):
            thread._target()

    monkeypatch.setattr(local_robot, "search_runs", searched(SearchResult([run()])))
    monkeypatch.setattr(local_robot, "send_to_all", break_off)
    monkeypatch.setattr(local_robot, "Thread", type("Broken", (ThreadAtOnce,), {"start": start}))
    assert robot.stop("Ada")[0] is False
    monkeypatch.setattr(local_robot, "Thread", ThreadAtOnce)
    monkeypatch.setattr(local_robot, "stop_one", stop)
    robot._update()
    assert tries == ["1"]


def test_failed_search_is_logged_once_and_counts_as_a_run(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    robot = LocalRobot()
    doubt = SearchResult([], [StopWarning(f"/folder cannot be read: {os.strerror(errno.EIO)}")])
    monkeypatch.setattr(local_robot, "search_runs", searched(doubt, doubt, SearchResult()))
    with caplog.at_level(logging.WARNING):
        for _ in range(2):
            robot._update()
            assert (robot.read_telemetry().runs, robot.read_telemetry().mission) == (True, "")
    assert [each.getMessage() for each in caplog.records] == [f"a run may have been missed: {doubt.warnings[0].reason}"]
    robot._update()
    assert robot.read_telemetry().runs is False


def test_unreachable_run_counts_and_a_killed_one_does_not(monkeypatch: pytest.MonkeyPatch) -> None:
    robot, living = LocalRobot(), run()
    assert living.abstract_name is not None
    killed = replace(
        living, abstract_name=replace(living.abstract_name, identity=replace(living.abstract_name.identity, start=1))
    )
    monkeypatch.setattr(local_robot, "search_runs", searched(SearchResult([living]), SearchResult([killed])))
    robot._update()
    assert robot.read_telemetry().runs is True
    robot._update()
    assert robot.read_telemetry().runs is False
