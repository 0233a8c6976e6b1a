"""What every test gets: a check that it leaves no thread, port or file open. Its clock comes from our own plugin."""

import gc
import os
import signal
import threading
from collections import Counter, defaultdict
from collections.abc import Generator, Iterator
from itertools import count
from pathlib import Path

import pytest
from hypothesis import settings

from missions.control.run_folders import SYSTEM_ROOT
from tests.browser import Browser, chromium

# Machines are shared: how long an example takes says nothing. `make test` tries the same examples everywhere;
# `make fuzz` looks for new ones, and each failure that it finds becomes an `@example`.
settings.register_profile("ours", deadline=None, derandomize=True, max_examples=50)
settings.register_profile("fuzz", deadline=None, max_examples=1000, print_blob=True)
settings.load_profile("ours")

OPEN = "/proc/self/fd"
GRACE = 3.0
"""Seconds that a thread has to end after its test."""


def pytest_configure() -> None:
    """Take Ctrl-C also where a shell runs the tests in the background, which has all of them ignore it."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Search nothing of what is collected for rubbish, now or later: it is ten thousand tests, and all of it lasts."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Begin with those that are marked ``long``, and give those that are marked ``real_time`` two more tries.

    A shared machine now and then stops for longer than a servo waits for its reply. A test that fails for a reason of
    its own fails three times; with `-p no:rerunfailures` each is tried once. A test is marked if something in it has a
    deadline of its own, such as a servo's reply. One that only waits for a thread or a program is not.
    """
    items.sort(key=lambda item: item.get_closest_marker("long") is None)
    for item in items if config.pluginmanager.hasplugin("rerunfailures") else ():
        if item.get_closest_marker("real_time"):
            item.add_marker(pytest.mark.flaky(reruns=2, reruns_delay=1))


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Say which tests were skipped and why; where a program is missing, the reason says how to have it."""
    skipped = defaultdict[str, Counter[str]](Counter)
    for report in terminalreporter.stats.get("skipped", ()):
        reason = report.longrepr[2] if isinstance(report.longrepr, tuple) else str(report.longrepr)
        skipped[reason.removeprefix("Skipped: ")][report.nodeid.partition("::")[0]] += 1
    for reason, files in sorted(skipped.items()):
        which = ", ".join(f"{count} of {file}" for file, count in sorted(files.items()))
        terminalreporter.write_line(f"skipped: {which}: {reason}", yellow=True)


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    """One browser for all tests of pages; each opens its own page in it, in place of the last one."""
    with Browser(chromium()) as found:
        yield found


@pytest.fixture(scope="session")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder that all workers of this session share; see ``tests.shared``."""
    base = tmp_path_factory.getbasetemp()
    return base.parent if base.name.startswith(("worker", "popen-gw")) else base


@pytest.fixture(scope="session")
def homes(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Iterator[Path]]:
    """Folders of this process, each to be used once; the first is the home of what several tests share."""
    base = tmp_path_factory.mktemp("home")
    found = (base / str(number) for number in count())
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("MISSION_RECORD", "no")  # nothing of the runs of tests, unless they ask for it
        patch.setenv("XDG_RUNTIME_DIR", str(base / "runtime"))  # a shared studio finds the runs of each test there
        patch.setenv(SYSTEM_ROOT, str(base / "system"))  # and no stop reaches what else runs on this computer
        _live_in(next(found), patch)
        yield found


@pytest.fixture(autouse=True)
def a_home_of_its_own(homes: Iterator[Path]) -> Iterator[None]:
    """Keep a test away from the user's own people, models, tasks and defaults, and from those of other tests."""
    with pytest.MonkeyPatch.context() as patch:
        _live_in(next(homes), patch)
        yield


def _live_in(home: Path, patch: pytest.MonkeyPatch) -> None:
    for kind in ("CONFIG", "DATA", "STATE"):
        patch.setenv(f"XDG_{kind}_HOME", str(home / kind.lower()))


@pytest.fixture(autouse=True)
def nothing_left_behind() -> Iterator[None]:
    """Fail a test that leaves a thread running, or a port or file open."""
    threads, files = set(threading.enumerate()), _open_files()
    yield
    for thread in set(threading.enumerate()) - threads:
        thread.join(GRACE)
    left = [f"thread '{thread.name}'" for thread in set(threading.enumerate()) - threads if thread.is_alive()]
    left += [f"file {name}" for number, name in _open_files().items() if files.get(number) != name]
    if left:
        pytest.fail(f"left behind: {', '.join(sorted(left))}")


def _open_files() -> dict[int, str]:
    """Return the files and terminals that this process has open, by number; pipes and the like are not counted."""
    found = {}
    for number in os.listdir(OPEN) if os.path.isdir(OPEN) else ():  # noqa: PTH112, PTH208 - twice a test: Path takes long
        try:
            name = os.readlink(f"{OPEN}/{number}")  # noqa: PTH115
        except OSError:
            continue
        kept = "/mpl-data/fonts/" in name  # Matplotlib keeps the fonts open that it has drawn with
        if name.startswith("/") and not kept and not name.startswith(("/proc/", "/dev/null", "/dev/urandom")):
            found[int(number)] = name
    return found
