"""The process of a view and the thread that talks with it, without any run; and where there can be no view."""

import json
import os
import pty
import select
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from io import StringIO
from threading import Thread

import pytest

from missions.plugins.view.terminal import view_error
from missions.plugins.view.viewer import Viewer
from tests.missions.views.live.messages import Message, first, news, part
from tests.missions.views.live.test_feed import Fed
from tests.waiting import wait_until


@contextmanager
def shown(*messages: Message, **surroundings: str) -> Iterator[tuple[socket.socket, "subprocess.Popen[bytes]", int]]:
    """Show messages by a view of its own; yield the run's end, its process, and the terminal to read from."""
    master, slave = pty.openpty()
    ours, theirs = socket.socketpair()
    with ours, theirs:
        process = subprocess.Popen(
            [sys.executable, "-m", "missions.plugins.view", str(theirs.fileno())],
            stdin=slave,
            stdout=slave,
            stderr=slave,
            pass_fds=[theirs.fileno()],
            env={**os.environ, "TERM": "xterm", "COLUMNS": "80", "LINES": "24", **surroundings},
        )
        theirs.close()
        try:
            ours.sendall(b"".join(json.dumps(message).encode() + b"\n" for message in messages))
            yield ours, process, master
        finally:
            process.kill()
            process.wait()
            os.close(slave)
            os.close(master)


class Text:
    """What is written to a terminal."""

    def __init__(self, master: int) -> None:
        self._master = master
        self._bytes = b""

    def read(self) -> str:
        while select.select([self._master], [], [], 0.0)[0]:
            self._bytes += os.read(self._master, 1 << 16)
        return self._bytes.decode("utf-8", "replace")


def test_view_without_unicode_is_ascii_and_ends_with_its_run() -> None:
    changed = {"1": ["running", "ünseen", 0.0]}
    surroundings = {"PYTHONIOENCODING": "ascii", "PYTHONUTF8": "0"}
    with shown(first(), news(changed=changed, parts=[part("OK")]), **surroundings) as (ours, process, master):
        text = Text(master)
        wait_until(lambda: "+ OK" in text.read(), 90.0)
        assert "> sequence" in text.read()
        assert "?nseen" in text.read()
        os.write(master, b" ")
        assert select.select([ours], [], [], 90.0)[0]
        assert json.loads(ours.recv(100)) == {"do": "pause"}
        ours.close()
        wait_until(lambda: (text.read(), process.poll() is not None)[1], 90.0)
        assert process.returncode == 0
        assert text.read().isascii()


def test_view_that_does_not_read_does_not_block_and_gets_whole_messages() -> None:
    fed = Fed()
    viewer = Viewer(fed.feed, {"long": "x" * 2_000_000})
    ours, theirs = socket.socketpair()
    ours.setblocking(False)
    thread = Thread(target=viewer._exchange_messages, args=(ours,))
    with ours, theirs:
        thread.start()
        for _ in range(1000):
            fed.executive.tick()
        theirs.sendall(b'{"do": "pause"}\nnonsense\n[]\n{"do": "pau')
        wait_until(lambda: fed.feed.take_changes()["paused"])
        theirs.sendall(b'se"}\n')
        heard = theirs.makefile("rb")
        assert len(json.loads(heard.readline())["long"]) == 2_000_000
        assert json.loads(heard.readline())["tick"] == 1000
        heard.close()
        theirs.shutdown(socket.SHUT_RDWR)
        thread.join(90.0)
        assert not thread.is_alive()


def test_unopened_view_can_be_closed() -> None:
    viewer = Viewer(Fed().feed, {})
    viewer.close()
    viewer.close()
    assert not viewer.is_showing


def test_view_needs_a_capable_terminal_and_its_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    assert "--view needs a terminal\n  try: " in view_error(StringIO())
    master, slave = pty.openpty()
    with os.fdopen(slave, "w") as out, os.fdopen(os.dup(slave)) as keys:
        monkeypatch.setattr(sys, "stdin", keys)
        monkeypatch.setenv("TERM", "xterm")
        assert view_error(out) == ""
        monkeypatch.setenv("TERM", "dumb")
        assert "TERM" in view_error(out)
        monkeypatch.setattr("missions.plugins.view.terminal.find_spec", lambda _: None)
        assert "pip install 'missiontree[view]'" in view_error(out)
    os.close(master)


def test_output_during_the_view_is_held_until_its_end() -> None:
    master, slave = pty.openpty()
    text = Text(master)
    program = (
        "import os; from missions.plugins.view.terminal import hold_output\n"
        "with hold_output():\n"
        "    print('from python')\n"
        "    os.system('echo from elsewhere')\n"
        "    os.write(int(os.environ['BESIDE']), b'.')\n"
        "print('after')"
    )
    beside = os.dup(slave)
    process = subprocess.Popen(
        [sys.executable, "-c", program],
        stdout=slave,
        stderr=slave,
        pass_fds=[beside],
        env={**os.environ, "BESIDE": str(beside)},
    )
    assert process.wait(90.0) == 0
    assert text.read().splitlines() == [".from python", "from elsewhere", "after"]
    for number in (beside, slave, master):
        os.close(number)


def test_the_process_of_a_view_loads_nothing_of_a_robot() -> None:
    heavy = "{'cv2', 'py_trees', 'serial', 'numpy', 'behaviours', 'perception'}"
    loaded = "{name.partition('.')[0] for name in sys.modules}"
    program = f"import sys, missions.plugins.view.__main__; print({heavy} & {loaded})"
    ran = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert ran.stdout == "set()\n"


def test_ctrl_c_while_a_view_loads_is_the_run_s_to_hear(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("missions.plugins.view.viewer.EXIT_TIMEOUT", 90.0)
    master, slave = pty.openpty()
    viewer = Viewer(Fed().feed, dict(first()), keys=slave, screen=slave)
    viewer.open()
    process = viewer._process
    assert process is not None
    text = Text(master)
    while "sequence" not in text.read():
        os.kill(process.pid, signal.SIGINT)
        assert process.poll() is None
        select.select([master], [], [], 0.02)
    viewer.close()
    assert viewer.exit_cause == ""
    assert "Traceback" not in text.read()
    os.close(slave)
    os.close(master)
