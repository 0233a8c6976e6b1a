"""A run that is stuck in C, where nothing of Python runs any more, is ended once it was told to end."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.real_time
ROOT = Path(__file__).parents[2]

RUN = """
import re, sys, time
from missions.executive.signals import Lifeline
from missions.executive.signals import SignalHandler
with SignalHandler(lambda word: None) as signals, Lifeline(signals, timeout=0.5) as line:
    print("ready", flush=True)
    if sys.argv[1] == "stuck":
        re.match("(a+)+$", "a" * 60 + "b")
    while signals.first_signal() is None:
        line.beat()
        time.sleep(0.01)
    for _ in range(150):
        line.beat()
        time.sleep(0.01)
"""


def ended(how: str) -> int:
    """Run it, tell it to end, and return its exit code."""
    run = subprocess.Popen([sys.executable, "-c", RUN, how], cwd=ROOT, stdout=subprocess.PIPE)
    with run:
        assert run.stdout is not None
        assert run.stdout.readline() == b"ready\n"
        os.kill(run.pid, signal.SIGTERM)
        return run.wait(30.0)


def test_process_stuck_in_c_is_killed_after_a_signal() -> None:
    assert ended("stuck") == -signal.SIGKILL


def test_responsive_process_is_not_killed() -> None:
    assert ended("alive") == 0
