"""Processes that play cases or storms end with whoever started them, also where that is killed."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.waiting import wait_until

PLAYS = """
import time
from missions.plugins.testing.worker_pool import run_parallel
print("started", flush=True)
list(run_parallel(time.sleep, [600.0, 600.0], float, jobs=2))
"""


def workers(parent: int) -> set[int]:
    """Return the processes that this one has started to work for it."""
    found = Path(f"/proc/{parent}/task/{parent}/children").read_text("utf-8").split()
    return {int(each) for each in found if b"spawn_main" in Path(f"/proc/{each}/cmdline").read_bytes()}


def alive(process: int) -> bool:
    try:
        return Path(f"/proc/{process}/stat").read_text("utf-8").rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="only Linux lists the children of a process")
def test_workers_end_when_their_parent_is_killed() -> None:
    with subprocess.Popen([sys.executable, "-c", PLAYS], stdout=subprocess.PIPE) as plays:
        assert plays.stdout is not None
        assert plays.stdout.readline() == b"started\n"
        wait_until(lambda: len(workers(plays.pid)) == 2)
        started = workers(plays.pid)
        os.kill(plays.pid, signal.SIGKILL)
        plays.wait()
        wait_until(lambda: not any(map(alive, started)))
