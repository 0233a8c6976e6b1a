"""Runs in simulated time with known truth at full speed: they start nothing, and end as others do."""

import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import partial
from io import StringIO
from math import inf
from pathlib import Path
from typing import Any

import pytest
from py_trees.common import Status

from behaviours.leaf import Leaf
from drivers.errors import BadRequest, NotConnected
from missions.assembly.assembled_robot import AssembledRobot
from missions.cli.running import run
from missions.executive.executive import Result
from missions.language.plan import Step
from missions.request import RunRequest
from missions.runner import Runner

WORDS = ("run", "patrol", "--robot", "turtlebot2_arm", "--simulate", "fast", "--eyes", "truth")


def started(folder: Path) -> "subprocess.Popen[str]":
    own = {"XDG_RUNTIME_DIR": str(folder), "XDG_CONFIG_HOME": str(folder)}
    return subprocess.Popen(
        [sys.executable, "-m", "missions", *WORDS],
        env={**os.environ, **own},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_signals_end_a_batch_run(tmp_path: Path, number: int) -> None:
    with started(tmp_path) as run:
        assert run.stdout is not None
        first = [run.stdout.readline() for _ in range(2)]  # it ticks
        run.send_signal(number)
        out, error = run.communicate()
    assert (run.returncode, first[0]) == (130, "mission patrol on turtlebot2_arm\n"), error
    assert "interrupted" in out.splitlines()[-1]


def test_a_closed_output_ends_a_batch_run(tmp_path: Path) -> None:
    with started(tmp_path) as run:
        assert run.stdout is not None
        run.stdout.readline()
        run.stdout.close()
        assert run.wait() == 130


@pytest.mark.parametrize("eyes", ["truth", "pixels"])
def test_a_signal_after_the_last_tick_starts_no_watchdog(eyes: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    @contextmanager
    def ending(_: object) -> Iterator[None]:
        yield
        signal.raise_signal(signal.SIGINT)  # the robot is closed, the signals are still ours

    monkeypatch.setattr("missions.runner.capture_log", ending)
    request = RunRequest("look_around", robot="turtlebot2_arm", simulate="fast", eyes=eyes)
    ended: list[Result] = []
    assert Runner(request, give_up=ended.append).run().result == "success"
    assert "watchdog" not in [thread.name for thread in threading.enumerate()]  # it would end the process, 2 s later
    assert not ended


def test_hardware_without_a_control_socket_is_not_opened(monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[str] = []
    monkeypatch.setattr(AssembledRobot, "open", lambda robot: opened.append(robot.name))
    for request in (RunRequest("wander", robot="turtlebot2"), RunRequest("greet", robot="turtlebot2_arm")):
        with pytest.raises(BadRequest, match="`mission stop` cannot reach this run"):
            Runner(request).run()
    assert not opened


def test_plugin_cannot_suppress_the_error_that_ends_a_run(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(_: object) -> None:
        raise NotConnected("base: gone")

    monkeypatch.setattr(AssembledRobot, "open", fail)
    request = RunRequest("look_around", robot="turtlebot2_arm", simulate="fast", eyes="truth")
    contexts = [lambda _: suppress(Exception)]
    with pytest.raises(NotConnected, match="base: gone"):
        run(request, StringIO(), lambda _: None, contexts=contexts)


@pytest.mark.parametrize("observed", ["on_tick", "on_view", "on_frame"])
@pytest.mark.parametrize("eyes", ["truth", "pixels"])
def test_raising_observer_does_not_change_the_result(observed: str, eyes: Any) -> None:
    results = []
    none: dict[str, Any] = {}
    for observers in (none, {observed: lambda *_: 1 // 0}):
        runner = Runner(RunRequest("greet", robot="turtlebot2_arm", simulate="fast", eyes=eyes))
        runner.observe(**observers)
        results.append(runner.run())
    assert results[0] == results[1]


class Spy(Leaf):
    """Succeeds, and notes the threads that there are then."""

    seen: tuple[str, ...] = ()

    def update(self) -> Status:
        Spy.seen = tuple(thread.name for thread in threading.enumerate())
        return Status.SUCCESS


def put_spies(step: Step, leaf: Leaf | None) -> Leaf | None:
    return None if leaf is None else Spy(step.name)


@pytest.mark.parametrize(
    ("leaf", "watched"), [("behaviours", False), ("behaviours.driving.motion", False), ("my_leaves", True)]
)
def test_watchdog_runs_only_for_foreign_leaves(monkeypatch: pytest.MonkeyPatch, leaf: str, watched: bool) -> None:
    monkeypatch.setattr(Spy, "__module__", leaf)
    request = RunRequest("look_around", robot="turtlebot2_arm", simulate="fast", eyes="truth")
    Runner(request, substitute=put_spies).run()
    assert ("watchdog" in Spy.seen) == watched


@pytest.mark.parametrize(("module", "watched"), [("missions.cli.live", False), ("my_plugin", True)])
@pytest.mark.parametrize("way", ["listener", "partial", "observer"])
def test_watchdog_runs_for_foreign_listeners(
    module: str, watched: bool, way: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    sockets: list[bool] = []  # by which a signal is heard while a listener is stuck in C

    def listen(*_: object) -> None:
        sockets.append(runner._signals.socket_descriptor is not None)

    monkeypatch.setattr(Spy, "__module__", "behaviours")
    listen.__module__ = module
    request = RunRequest("look_around", robot="turtlebot2_arm", simulate="fast", eyes="truth")
    runner = Runner(request, substitute=put_spies)
    if way == "observer":
        runner.observe(listen)
    else:  # as a plug-in does it, once the runner is there
        runner.stream.listeners.append(partial(listen) if way == "partial" else listen)
    runner.run()
    assert ("watchdog" in Spy.seen) == watched
    assert any(sockets) == watched


@pytest.mark.parametrize(
    ("request_", "batch"),
    [
        (RunRequest("greet", simulate="fast", eyes="truth"), True),
        (RunRequest("greet", simulate="fast", eyes="truth", speed=1000.0), False),
        (RunRequest("greet", simulate="fast"), False),
        (RunRequest("greet", simulate="wire", eyes="truth"), False),
        (RunRequest("greet", robot="turtlebot2", eyes="truth", speed=inf), False),
    ],
)
def test_whatever_moves_or_can_be_watched_is_no_batch_run(request_: RunRequest, batch: bool) -> None:
    assert request_.is_batch is batch
