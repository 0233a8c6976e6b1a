"""Programs of ours in processes of their own."""

import sys
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from subprocess import DEVNULL, PIPE, Popen
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.api import DeviceStatus, ignore
from drivers.clock import SystemClock
from drivers.errors import NoReply, NotConnected
from drivers.transport.worker_process import MessageParser, WorkerProcess, pack_message
from tests.waiting import wait_until

ECHO = """
import json, sys
for line in sys.stdin.buffer:
    message = json.loads(line)
    body = sys.stdin.buffer.read(message.get("bytes", 0))
    if "die" in message:
        sys.exit(message["die"])
    sys.stdout.buffer.write(json.dumps({**message, "heard": True}).encode() + b"\\n" + body)
    sys.stdout.buffer.flush()
"""

messages = st.lists(
    st.tuples(st.dictionaries(st.sampled_from("abc"), st.integers() | st.text()), st.binary(max_size=50)), max_size=8
)


@given(messages, st.lists(st.integers(1, 30), min_size=1))
def test_messages_round_trip_for_any_chunking(sent: list[tuple[dict[str, Any], bytes]], cuts: list[int]) -> None:
    data, unframer = b"".join(pack_message(head, body) for head, body in sent), MessageParser()
    got: list[tuple[dict[str, Any], bytes]] = []
    while data:
        cut = cuts[len(got) % len(cuts)]
        got += list(unframer.feed(data[:cut]))
        data = data[cut:]
    assert [({key: head[key] for key in head if key != "bytes"}, body) for head, body in got] == sent


@pytest.mark.parametrize(
    "nonsense", [b"hello\n", b"[1]\n", b'"x"\n', b'{"bytes":-5}\n', b'{"bytes":null}\n', b'{"bytes":"5"}\n']
)
def test_malformed_message_is_refused(nonsense: bytes) -> None:
    with pytest.raises(ValueError, match=r"."):
        list(MessageParser().feed(nonsense))


class Ear:
    """A talker that keeps what it is told."""

    def __init__(self) -> None:
        self.starts = 0
        self.got: list[tuple[Mapping[str, Any], bytes]] = []
        self.losses: list[str] = []
        self.at_start: Callable[[], object] = ignore

    def on_started(self) -> None:
        self.starts += 1
        self.at_start()

    def on_message(self, message: Mapping[str, Any], body: bytes) -> None:
        self.got.append((message, body))

    def on_exit(self, reason: str) -> None:
        self.losses.append(reason)


class Bench:
    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.ear = Ear()
        self.notices: list[DeviceStatus] = []
        self.workers: list[WorkerProcess] = []

    def run(self, program: str, *arguments: str) -> WorkerProcess:
        path = self.folder / "program.py"
        path.write_text(program)
        worker = WorkerProcess(
            "voice", path, SystemClock(), arguments=arguments, hint="try this", report=self.notices.append
        )
        self.workers.append(worker)
        worker.open(self.ear)
        return worker


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    bench = Bench(tmp_path)
    yield bench
    for worker in bench.workers:
        worker.close()


def test_worker_answers_with_bodies_larger_than_a_pipe(bench: Bench) -> None:
    worker = bench.run(ECHO)
    wait_until(lambda: bench.ear.starts)
    body = bytes(range(256)) * 2000
    worker.send({"a": 1})
    worker.send({"a": 2}, body)
    wait_until(lambda: len(bench.ear.got) == 2)
    (first, nothing), (second, echoed) = bench.ear.got
    assert (first["a"], first["heard"], nothing) == (1, True, b"")
    assert (second["a"], echoed == body) == (2, True)
    assert worker.health().online


def test_dead_worker_is_reported_with_its_last_line_and_restarted(bench: Bench) -> None:
    worker = bench.run(ECHO)
    wait_until(lambda: bench.ear.starts)
    worker.send({"die": "out of paper"})
    wait_until(lambda: bench.ear.starts == 2)
    (notice,) = bench.notices
    assert (notice.device, notice.kind, notice.hint) == ("voice", "fault", "try this")
    assert notice.message == "voice: program: ended with 1: out of paper" == bench.ear.losses[0]
    worker.send({"a": 3})
    wait_until(lambda: bench.ear.got)
    assert worker.health().counters["starts"] == 2


def test_worker_with_malformed_output_is_killed(bench: Bench) -> None:
    bench.run("print('hello', flush=True); import sys; sys.stdin.read()")
    wait_until(lambda: bench.ear.losses)
    assert "ended with -9" in bench.ear.losses[0]


@pytest.mark.parametrize("nonsense", ['{"bytes": null}', "[" * 100_000])
def test_worker_restarts_after_malformed_output(bench: Bench, nonsense: str) -> None:
    bench.run(f"print({nonsense!r}, flush=True); import sys; sys.stdin.read()")
    wait_until(lambda: bench.ear.starts >= 2)
    assert "ended with -9" in bench.ear.losses[0]


def test_last_line_of_the_worker_errors_is_reported(bench: Bench) -> None:
    bench.run(
        "raise SystemExit('pcm.c:2666: unknown\\npcm.c:2667: odd\\n' + 'é' * 50 + ' no card ' + '!' * 150 + '\\n\\n')"
    )
    wait_until(lambda: bench.ear.losses)
    assert bench.ear.losses[0] == "voice: program: ended with 1: " + "é" * 41 + " no card " + "!" * 150


def test_worker_error_is_reported_although_unread_before_its_end(bench: Bench) -> None:
    def outlived() -> None:
        process = bench.workers[0]._process
        assert process is not None
        process.wait()

    bench.ear.at_start = outlived
    bench.run("raise SystemExit('hm\\n' * 10_000 + 'no card')")
    wait_until(lambda: bench.ear.losses)
    assert bench.ear.losses[0] == "voice: program: ended with 1: no card"


def test_killed_worker_is_offline_at_once_and_restarted(bench: Bench) -> None:
    worker = bench.run(ECHO)
    wait_until(lambda: bench.ear.starts)
    worker.kill()
    wait_until(lambda: bench.ear.losses)
    with pytest.raises(NotConnected, match="ended with -9") as raised:
        worker.send({"a": 1})
    assert raised.value.hint == "try this"
    wait_until(lambda: bench.ear.starts == 2)


def test_unresponsive_worker_is_killed(bench: Bench) -> None:
    worker = bench.run("import threading; threading.Event().wait()")
    wait_until(lambda: bench.ear.starts)
    with pytest.raises(NoReply, match=r"accepted no data for 0\.05 s"):
        worker.send({"a": 1}, bytes(1_000_000), timeout=0.05)
    wait_until(lambda: bench.ear.losses)


def test_worker_that_cannot_start_gives_the_reason(bench: Bench) -> None:
    worker = bench.run("raise SystemExit('no model')")
    wait_until(lambda: bench.ear.losses)
    health = worker.health()
    assert (health.online, health.detail, health.hint) == (False, "voice: program: ended with 1: no model", "try this")
    wait_until(lambda: len(bench.ear.losses) == 2)
    assert len(bench.notices) == 1


def test_exceptions_in_the_listener_are_harmless(bench: Bench) -> None:
    class Clumsy(Ear):
        def on_message(self, message: Mapping[str, Any], body: bytes) -> None:
            super().on_message(message, body)
            raise RuntimeError("oh")

    bench.ear = Clumsy()
    worker = bench.run(ECHO)
    wait_until(lambda: bench.ear.starts)
    for number in range(3):
        worker.send({"a": number})
    wait_until(lambda: len(bench.ear.got) == 3)
    assert bench.ear.losses == []


def test_worker_can_be_closed_in_any_state_and_reopened(bench: Bench) -> None:
    worker = WorkerProcess("voice", bench.folder / "none.py", SystemClock())
    worker.close()
    worker.kill()
    with pytest.raises(NotConnected, match="not started yet"):
        worker.send({})
    again = bench.run(ECHO)
    again.close()
    again.close()
    assert not again.health().online
    again.open(bench.ear)
    again.open(bench.ear)
    wait_until(lambda: again.health().online)
    assert bench.notices == []


def test_worker_ends_when_its_input_closes(tmp_path: Path) -> None:
    program = tmp_path / "echo.py"
    program.write_text(ECHO)
    with Popen([sys.executable, "-I", str(program)], stdin=PIPE, stdout=DEVNULL) as process:
        assert process.stdin is not None
        process.stdin.close()
        assert process.wait(20) == 0
