"""The workers of ``make test``: each test runs once, and a failure, a crash and a second try are reported."""

import os

import pytest

pytest_plugins = ["pytester"]

TESTS = """
import os, signal
import pytest

@pytest.fixture(scope="session")
def torn_down():
    yield
    open(f"torn_down.{os.getpid()}", "w").close()

@pytest.mark.parametrize("number", range(40))
def test_number(number, torn_down, tmp_path):
    print("said", number)
    (tmp_path / "file").write_text("")
    if number == 7:
        os.kill(os.getpid(), signal.SIGKILL)
    assert number != 9

@pytest.mark.real_time
def test_deadline(torn_down):
    if not os.path.exists("tried"):
        open("tried", "w").close()
        pytest.fail("too late")
"""
CONFTEST = """
import pytest

def pytest_collection_modifyitems(items):
    items[-1].add_marker(pytest.mark.flaky(reruns=1))
"""
WORDS = ("-p", "no:xdist", "-p", "tests.workers", "--workers", "3")


@pytest.fixture(autouse=True)
def project(pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", os.getcwd())  # noqa: PTH109
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "1")
    pytester.makeconftest(CONFTEST)
    pytester.makeini("[pytest]\nmarkers = real_time: x\n")
    pytester.makepyfile(TESTS)


def test_each_test_runs_once_and_a_crash_fails_one_alone(pytester: pytest.Pytester) -> None:
    result = pytester.runpytest_subprocess(*WORDS)
    outcomes = result.parseoutcomes()
    assert (outcomes["passed"], outcomes["failed"], outcomes["rerun"]) == (39, 2, 1)
    result.stdout.fnmatch_lines_random(["*said 9", "worker* came to an end: exit code -9"])
    assert len(list(pytester.path.glob("torn_down.*"))) == 4  # three workers, one of them killed, and one for deadlines


def test_workers_stop_at_the_first_failure_with_maxfail(pytester: pytest.Pytester) -> None:
    result = pytester.runpytest_subprocess(*WORDS, "-x", "-k", "8 or 9")
    result.stdout.fnmatch_lines(["*stopping after 1 failures*"])
