"""Programs that hold a port: who they are, and how they are ended."""

import socket
from contextlib import closing
from pathlib import Path

from drivers.programs import program_of, tcp_holders
from tests.cases import each

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
def test_a_program_is_named_as_it_was_typed(words: tuple[str, ...], tmp_path: Path) -> None:
    root = tmp_path / str(list(COMMANDS).index(words))
    folder = root / "proc" / "7"
    folder.mkdir(parents=True)
    if words:
        (folder / "cmdline").write_text("\0".join(words) + "\0", encoding="utf-8")
        (folder / "comm").write_text(f"{Path(words[0]).name[:15]}\n", encoding="utf-8")
    found = program_of(7, root)
    name, ends = COMMANDS[words]
    assert (str(found), found.end_command) == (f"{name} (process 7)", ends)


def test_nobody_else_holds_a_port_of_this_process_or_one_that_is_free() -> None:
    with closing(socket.create_server(("127.0.0.1", 0))) as found:
        port = found.getsockname()[1]
        assert tcp_holders(port) == []
    assert tcp_holders(port) == []
