"""BehaviorTree.CPP itself, in a process of its own, to compare our trees with."""

import json
import subprocess
import sys
from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

CLIENT = Path(__file__).with_name("other_programs") / "behaviortree_cpp_client.py"
TIMEOUT = 240
"""Seconds within which the process must answer."""

needs_behaviortree_cpp = pytest.mark.skipif(
    find_spec("behaviortreepy") is None, reason="behaviortreepy is not installed: `make test` installs it"
)


def ask_behaviortree_cpp(requests: Sequence[Mapping[str, Any]]) -> list[Any]:
    """Send trees to BehaviorTree.CPP, and return its answer to each; see the client for both."""
    done = subprocess.run(
        [sys.executable, str(CLIENT)],
        input=json.dumps(requests),
        capture_output=True,
        text=True,
        timeout=TIMEOUT,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    found: list[Any] = json.loads(done.stdout)
    return found
