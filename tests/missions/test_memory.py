"""Commands that run out of memory: said so with the next step, whichever error it came as."""

import errno
import resource
import subprocess
import sys
from collections.abc import Callable

import pytest

from drivers.errors import BadRequest
from missions.cli import root
from missions.cli.root import USAGE, run_guarded

LIMIT = 64 << 20


@pytest.fixture
def limited(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(resource, "getrlimit", lambda _: (LIMIT, LIMIT))


def raised(error: BaseException, cause: BaseException | None = None) -> Callable[[], object]:
    def work() -> object:
        raise error from cause

    return work


SHORT = [
    (MemoryError(), None, "no memory is left"),
    (OSError(errno.ENOMEM, "Cannot allocate memory"), None, "Cannot allocate memory"),
    (OSError(errno.ENOMEM, "Cannot allocate memory", "greet.yaml"), None, "Cannot allocate memory"),
    (ImportError("cv2.so: failed to map segment from shared object"), None, "failed to map segment"),
    (
        ImportError("read this\n\nOriginal error was: a.so: failed to map segment from shared object\n"),
        None,
        "a.so: fail",
    ),
    (BadRequest("camera: pip install missiontree[camera]"), ImportError("x: failed to map segment"), "failed to map"),
    (RuntimeError("can't start new thread"), None, "can't start new thread"),
    (ValueError("OpenCV: (-4:Insufficient memory) Failed to allocate 6220800 bytes"), None, "Insufficient memory"),
    (KeyError("x"), MemoryError("Unable to allocate 7.45 GiB for an array"), "Unable to allocate 7.45 GiB"),
]


@pytest.mark.usefixtures("limited")
@pytest.mark.parametrize(("error", "cause", "what"), SHORT)
def test_out_of_memory_errors_are_reported_as_such(
    error: BaseException, cause: BaseException | None, what: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run_guarded(raised(error, cause)) == USAGE
    told = capsys.readouterr().err
    assert told.startswith("mission: out of memory: ")
    assert what in told.splitlines()[0]
    assert told.splitlines()[1:] == ["  try: ulimit -v unlimited; ulimit -d unlimited  (in this shell; now 65536 kB)"]


class Mute(Exception):
    def __str__(self) -> str:
        raise ValueError


@pytest.mark.parametrize("error", [KeyError("memory"), ImportError("No module named 'x'"), OSError(2, "none"), Mute()])
def test_other_errors_are_not_out_of_memory_errors(error: Exception) -> None:
    assert root.memory_error(error) == ""


def test_without_a_limit_a_lack_of_threads_is_none_of_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(resource, "getrlimit", lambda _: (resource.RLIM_INFINITY,) * 2)
    assert root.memory_error(RuntimeError("can't start new thread")) == ""
    assert root.memory_advice(root.memory_limit()).startswith("free -m")


@pytest.mark.parametrize("megabytes", [60, 120, 250, 400, 600])  # with less, Python itself logs tracebacks
def test_run_under_ulimit_reports_memory_without_a_traceback(megabytes: int) -> None:
    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_AS, (megabytes << 20, megabytes << 20))

    run = [sys.executable, "-m", "missions", "run", "greet", "--simulate", "fast", "--seed", "1"]
    ended = subprocess.run(run, capture_output=True, text=True, check=False, preexec_fn=limit)
    assert "memory" in ended.stderr.splitlines()[0]
    assert "try: ulimit -v unlimited" in ended.stderr
    assert "Traceback" not in ended.stderr
    assert "fault of MissionTree" not in ended.stderr
