"""The port of a studio: the next free one where the usual one is taken, and who has one that was asked for."""

import socket
import subprocess
import sys
from contextlib import closing

import pytest

from missions.plugins.studio import command as studio
from tests.missions.command import PATIENCE, Process, command


def free_port() -> int:
    with closing(socket.create_server(("127.0.0.1", 0))) as found:
        return int(found.getsockname()[1])


def test_second_studio_uses_the_next_free_port(monkeypatch: pytest.MonkeyPatch) -> None:
    usual = free_port()
    monkeypatch.setattr(studio, "DEFAULT_PORT", usual)
    with closing(studio._listen("127.0.0.1", None)) as first, closing(studio._listen("127.0.0.1", None)) as second:
        assert first.getsockname()[1] == usual
        assert usual < second.getsockname()[1] < usual + studio.MAX_PORTS_TRIED


def test_requested_port_in_use_is_refused_with_the_process(capsys: pytest.CaptureFixture[str]) -> None:
    first = Process("studio", "--port", "0")
    try:
        line = first.wait_for_line(lambda line: line.startswith("to view"))
        port = int(line.rpartition("/?")[0].rpartition(":")[2])
        refused = command(capsys, "studio", "--port", str(port))
    finally:
        first.process.terminate()
        first.end()
    assert refused.code == 2
    assert f"port {port}: in use by " in refused.err
    assert f"(process {first.process.pid})" in refused.err
    assert "try: mission studio --port 0  (any free port)" in refused.err


def test_next_port_is_tried_only_if_the_port_is_in_use(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    # An address for documentation (RFC 5737), which no computer has.
    assert "port 8642: Cannot assign" in command(capsys, "studio", "--host", "192.0.2.1").err
    taken = free_port()
    monkeypatch.setattr(studio, "DEFAULT_PORT", taken)
    monkeypatch.setattr(studio, "MAX_PORTS_TRIED", 1)
    with closing(socket.create_server(("127.0.0.1", taken))):
        refused = command(capsys, "studio")
    assert f"port {taken}: in use" in refused.err


def test_a_studio_with_too_few_descriptors_is_refused_and_does_not_listen_in_vain() -> None:
    few = f"ulimit -n {studio.MIN_DESCRIPTORS - 1}; exec {sys.executable} -m missions studio --port 0"
    refused = subprocess.run(["sh", "-c", few], capture_output=True, text=True, timeout=PATIENCE, check=False)
    assert (refused.returncode, refused.stdout) == (2, "")
    assert "open files are limited to 127; the studio needs at least 128\n  try: ulimit -n 1024" in refused.stderr
