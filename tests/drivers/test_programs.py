"""Programs that hold a port: who they are, and how they are ended."""

import errno
import os
import socket
import subprocess
import sys
import termios
from contextlib import closing
from pathlib import Path

import pytest

from drivers.errors import NotConnected
from drivers.transport import ports
from drivers.transport.programs import Program, device_holders, read_program, tcp_holders
from tests.cases import each
from tests.waiting import wait_until

COMMANDS = {
    ("/usr/bin/python3", "-m", "missions", "run", "greet"): ("mission run greet", "mission stop --end 7"),
    ("/opt/venv/bin/python", "/opt/venv/bin/mission", "run", "my dance.yaml"): (
        "mission run my dance.yaml", "mission stop --end 7",
    ),
    ("python3", "-m", "missions", "studio"): ("mission studio", "kill 7"),
    ("python3", "-m", "missions", "servo", "home"): ("mission servo home", "mission stop --end 7"),
    ("python3", "-m", "missions"): ("mission", "kill 7"),
    ("python3", "/home/me/arm.py", "missions"): ("python3 arm.py", ""),
    ("/usr/sbin/ModemManager",): ("ModemManager", ""),
    (): ("a program", ""),
}  # fmt: skip


@each("words", list(COMMANDS))
def test_program_is_named_as_typed(words: tuple[str, ...], tmp_path: Path) -> None:
    root = tmp_path / str(list(COMMANDS).index(words))
    folder = root / "proc" / "7"
    folder.mkdir(parents=True)
    if words:
        (folder / "cmdline").write_text("\0".join(words) + "\0", encoding="utf-8")
        (folder / "comm").write_text(f"{Path(words[0]).name[:15]}\n", encoding="utf-8")
    found = read_program(7, root)
    name, ends = COMMANDS[words]
    assert (str(found), found.end_command) == (f"{name} (process 7)", ends)


def test_own_or_free_tcp_port_has_no_other_holders() -> None:
    with closing(socket.create_server(("127.0.0.1", 0))) as found:
        port = found.getsockname()[1]
        assert tcp_holders(port) == []
    assert tcp_holders(port) == []


def test_device_holders_are_the_other_processes_with_it_open() -> None:
    master, slave = os.openpty()
    try:
        port = os.ttyname(slave)
        assert device_holders(port) == []
        with subprocess.Popen([sys.executable, "-c", "input()"], stdin=slave) as child:
            try:
                wait_until(lambda: [each.pid for each in device_holders(port)] == [child.pid])
            finally:
                child.kill()
        assert device_holders(port) == []
        assert device_holders(f"{port}0000") == []
    finally:
        os.close(master)
        os.close(slave)


def test_port_held_by_a_run_names_the_run_and_its_stop_command(monkeypatch: pytest.MonkeyPatch) -> None:
    held = [Program(4711, "mission run greet"), Program(9, "ModemManager")]
    monkeypatch.setattr(ports, "device_holders", lambda _: held)
    error = ports.make_port_error("base", "/dev/ttyUSB0", OSError(errno.EBUSY, "busy"))
    assert str(error).startswith(
        "base: /dev/ttyUSB0: in use by mission run greet (process 4711), ModemManager (process 9)"
    )
    assert error.hint == "mission stop --end 4711"
    monkeypatch.setattr(ports, "device_holders", lambda _: held[1:])
    assert "fuser -v" in ports.make_port_error("base", "/dev/ttyUSB0", OSError(errno.EAGAIN, "busy")).hint


READER = "import os, sys; number = os.open(sys.argv[1], os.O_RDWR | os.O_NOCTTY); print('open', flush=True); input()"


def test_port_read_by_another_program_is_not_opened() -> None:
    master, slave = os.openpty()
    port = os.ttyname(slave)
    try:
        command = [sys.executable, "-c", READER, port]
        with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as reader:
            assert reader.stdout is not None
            assert reader.stdout.readline() == "open\n"
            settings = termios.tcgetattr(slave)
            with pytest.raises(NotConnected, match=rf"in use by .*process {reader.pid}\)") as caught:
                ports.open_port("base", port, 115200)
            assert termios.tcgetattr(slave) == settings  # the reader goes on at its own baud rate
            assert "fuser -v" in caught.value.hint
        ports.open_port("base", port, 115200).close()
    finally:
        os.close(master)
        os.close(slave)


OTHER_END = """import os, tty
master, slave = os.openpty(); tty.setraw(slave); print(os.ttyname(slave), flush=True); input()"""


def test_the_program_at_the_other_end_of_a_pseudo_terminal_does_not_count() -> None:
    command = [sys.executable, "-c", OTHER_END]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as device:
        assert device.stdout is not None
        port = device.stdout.readline().strip()
        assert device_holders(port) == []
        ports.open_port("base", port, 115200).close()
