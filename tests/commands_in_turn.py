"""Commands run one after the other in one process, which may lack modules: here, or in Python for browsers."""

import json
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

CODE = """
import io, json, sys
from contextlib import redirect_stderr, redirect_stdout

attempts, started = [], []

class Ban:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in forbidden:
            attempts.append(name)
            raise ImportError(f"{name} is forbidden in this test")

def note(event, details):
    if event in ("socket.__new__", "subprocess.Popen", "os.fork", "os.posix_spawn", "os.exec"):
        started.append(event)

sys.meta_path.insert(0, Ban())
sys.addaudithook(note)
import threading
start = threading.Thread.start
threading.Thread.start = lambda self: (started.append(f"thread {self.name}"), start(self))[1]
from missions.__main__ import main
for words in commands:
    attempts.clear()
    started.clear()
    sys.argv = ["mission", *words]
    said = io.StringIO()
    try:
        with redirect_stdout(said), redirect_stderr(said):
            code = main() or 0
    except SystemExit as end:
        code = end.code or 0
    print(json.dumps([code, attempts, started, said.getvalue()[-4000:]]))
"""


class Ran(NamedTuple):
    """The end of a command."""

    code: int
    attempts: list[str]
    """Forbidden modules that it tried to import."""
    started: list[str]
    """Threads, processes and sockets."""
    said: str


def code_of(commands: Sequence[Sequence[str]], forbidden: Sequence[str] = ()) -> str:
    """Return the Python code that runs ``commands``, and prints a line about each."""
    return f"commands, forbidden = {list(map(list, commands))!r}, {list(forbidden)!r}\n{CODE}"


def parsed(out: str) -> list[Ran]:
    """Return what that code has printed."""
    return [Ran(*json.loads(line)) for line in out.splitlines()]


def run_here(folder: Path, commands: Sequence[Sequence[str]], forbidden: Sequence[str] = ()) -> list[Ran]:
    """Run ``commands`` in a process that cannot import the ``forbidden`` packages; ``folder`` is for its files."""
    for name in ("run", "config"):
        (folder / name).mkdir(mode=0o700)
    own = {"XDG_RUNTIME_DIR": str(folder / "run"), "XDG_CONFIG_HOME": str(folder / "config")}
    words = [sys.executable, "-c", code_of(commands, forbidden)]
    done = subprocess.run(words, env={**os.environ, **own}, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return parsed(done.stdout)
