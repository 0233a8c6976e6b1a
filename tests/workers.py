"""pytest plug-in: run the tests in worker processes that are forked once the tests are collected.

``python -m pytest -p no:xdist -p tests.workers --workers 8`` collects in one process, so that a worker costs neither
imports nor memory of its own for them, and there can be as many workers as the waiting of tests allows. Each worker
has its own part of the tests, in their order; a worker that has finished takes half of the longest part that is left.
Tests marked ``real_time`` come at last, with fewer workers (``--real-time-workers``), so that their deadlines hold.
"""

import atexit
import os
import signal
from collections import deque
from collections.abc import Sequence
from contextlib import suppress
from itertools import count
from multiprocessing import Pipe
from multiprocessing.connection import Connection, wait
from pathlib import Path
from threading import Event
from types import SimpleNamespace
from typing import Any, NoReturn

import cv2
import pytest
from _pytest.capture import CaptureManager
from _pytest.tmpdir import TempPathFactory

from drivers.clock import SystemClock

END_TIMEOUT = 10.0
"""Seconds that an interrupted worker has to tear down what its tests have set up."""

THREADS = Path("/proc/self/task")


def pytest_addoption(parser: pytest.Parser) -> None:
    group = parser.getgroup("workers")
    group.addoption("--workers", type=int, default=0, metavar="N", help="Run tests in N forked processes.")
    group.addoption("--real-time-workers", type=int, default=2, metavar="N", help="As many for those in real time.")


def pytest_configure(config: pytest.Config) -> None:
    if config.getoption("workers"):
        cv2.setNumThreads(1)  # a thread of OpenCV does not live on in a forked process, which would wait for it


@pytest.hookimpl(tryfirst=True)
def pytest_runtestloop(session: pytest.Session) -> object:
    config = session.config
    if not config.getoption("workers") or config.option.collectonly or session.testsfailed:
        return None
    if THREADS.exists() and len(list(THREADS.iterdir())) > 1:
        raise pytest.UsageError("a thread was started while tests were collected: set OPENBLAS_NUM_THREADS=1")
    config._tmp_path_factory.getbasetemp()  # type: ignore[attr-defined]  # the same for all workers
    passes = (False, config.getoption("workers")), (True, config.getoption("real_time_workers"))
    for real_time, workers in passes:
        numbers = [
            number
            for number, item in enumerate(session.items)
            if (item.get_closest_marker("real_time") is not None) == real_time
        ]
        Crew(session, numbers, min(workers, len(numbers))).run()
    return True


class Worker:
    """A worker process, as its parent sees it. ``todo`` are the numbers of tests that it has not been sent.

    It is sent one test ahead, as pytest tears down at the end of a test only what the next one does not need. It
    ``ends`` once it has been sent that there is none.
    """

    names = count()

    def __init__(self, crew: "Crew", todo: Sequence[int]) -> None:
        self.todo, self.sent, self.ends = deque(todo), deque[int](), False
        self.name = f"worker{next(self.names)}"
        # As reports of pytest-xdist have it: then pytest writes no path before each letter, and says who has failed.
        self.node = SimpleNamespace(gateway=SimpleNamespace(id=self.name), _workerinfocache=f"[{self.name}]")
        self.line, theirs = Pipe()
        self.pid = os.fork()
        if self.pid == 0:
            for line in [self.line, *(each.line for each in crew.workers)]:
                line.close()
            work(crew.session, theirs, self.name)
        theirs.close()
        self.feed()
        if not self.ends:
            self.feed()

    def feed(self) -> None:
        """Send the next test, or None if there is none for now."""
        with suppress(BrokenPipeError):
            if self.todo:
                self.sent.append(self.todo[0])
                self.line.send(self.todo.popleft())
            else:
                self.ends = True
                self.line.send(None)


class Crew:
    """Workers that share the tests of these ``numbers``."""

    def __init__(self, session: pytest.Session, numbers: Sequence[int], size: int) -> None:
        self.session = session
        self.workers: list[Worker] = []
        self._left = set(numbers)
        long = [each for each in numbers if session.items[each].get_closest_marker("long")]
        others = [each for each in numbers if not session.items[each].get_closest_marker("long")]
        share = -(-len(others) // max(size, 1))
        self._shares = [[*long[nth::size], *others[nth * share : (nth + 1) * share]] for nth in range(size)]

    def run(self) -> None:
        """Run all of them. Raises Failed as soon as there are as many failures as ``--maxfail`` allows."""
        try:
            for share in self._shares:
                self.workers.append(Worker(self, share))
            while self.workers:
                for line in wait([each.line for each in self.workers]):
                    self._hear(next(each for each in self.workers if each.line is line))
                if self.session.shouldfail:
                    raise self.session.Failed(self.session.shouldfail)
            if self._left:
                raise RuntimeError(f"{len(self._left)} tests were not run")
        finally:
            self._end()

    def _hear(self, worker: Worker) -> None:
        config = self.session.config
        try:
            report = worker.line.recv()
        except (EOFError, ConnectionResetError):
            self._lost(worker)
            return
        if report is not None:
            found = config.hook.pytest_report_from_serializable(config=config, data=report)
            self._report(found, worker)
            return
        number = worker.sent.popleft()
        self._left.remove(number)
        item = self.session.items[number]
        config.hook.pytest_runtest_logfinish(nodeid=item.nodeid, location=item.location)
        if not worker.ends:
            if not worker.todo:
                self._steal(worker)
            worker.feed()

    def _report(self, report: pytest.TestReport, worker: Worker) -> None:
        report.node = worker.node  # type: ignore[attr-defined]
        self.session.config.hook.pytest_runtest_logreport(report=report)

    def _steal(self, worker: Worker) -> None:
        longest = max(self.workers, key=lambda it: len(it.todo))
        half = (len(longest.todo) + 1) // 2
        taken = [longest.todo.pop() for _ in range(half)]
        worker.todo.extend(reversed(taken))

    def _lost(self, worker: Worker) -> None:
        """Forget a worker that has ended; if it was in the midst of a test, that has failed, and another goes on."""
        _, status = os.waitpid(worker.pid, 0)
        worker.line.close()
        self.workers.remove(worker)
        if not worker.sent:
            return
        number, *others = worker.sent
        self._left.remove(number)
        item = self.session.items[number]
        why = f"{worker.name} came to an end: exit code {os.waitstatus_to_exitcode(status)}"
        report = pytest.TestReport(item.nodeid, item.location, {}, "failed", why, "call")
        self._report(report, worker)
        if others or worker.todo:
            self.workers.append(Worker(self, [*others, *worker.todo]))

    def _end(self) -> None:
        for each in self.workers:
            each.line.close()
            os.kill(each.pid, signal.SIGINT)
        clock, pause = SystemClock(), Event()
        while self.workers:
            for each in list(self.workers):
                if os.waitpid(each.pid, os.WNOHANG)[0]:
                    self.workers.remove(each)
                elif clock.now() > END_TIMEOUT:
                    os.kill(each.pid, signal.SIGKILL)
            pause.wait(0.05)


class Reporter:
    """Sends the reports of a worker to its parent."""

    def __init__(self, config: pytest.Config, line: Connection) -> None:
        self._config, self._line = config, line

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        data: dict[str, Any] | None = self._config.hook.pytest_report_to_serializable(
            config=self._config, report=report
        )
        self._line.send(data)


def work(session: pytest.Session, line: Connection, name: str) -> NoReturn:
    """Be a worker: run each test whose number comes, until there is none."""
    config, code = session.config, 1
    try:
        _settle(config, name)
        config.pluginmanager.unregister(name="terminalreporter")
        config.pluginmanager.register(Reporter(config, line))
        number = line.recv()
        while number is not None:
            following = line.recv()
            nextitem = None if following is None else session.items[following]
            config.hook.pytest_runtest_protocol(item=session.items[number], nextitem=nextitem)
            line.send(None)
            number = following
        code = 0
    except (KeyboardInterrupt, EOFError, BrokenPipeError):
        session._setupstate.teardown_exact(None)
    finally:
        atexit._run_exitfuncs()
        os._exit(code)


def _settle(config: pytest.Config, name: str) -> None:
    """Give a worker files of its own: for what is captured, and its part of the folder of temporary ones."""
    capture = config.pluginmanager.getplugin("capturemanager")
    assert isinstance(capture, CaptureManager)
    capture.stop_global_capturing()
    capture.start_global_capturing()
    capture.suspend_global_capture()
    factory: TempPathFactory = config._tmp_path_factory  # type: ignore[attr-defined]
    factory._basetemp = factory.getbasetemp() / name
    factory._basetemp.mkdir()
