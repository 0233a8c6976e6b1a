"""A ``finally`` that tries to drive, in real time on a virtual base: what the wire carries after each kind of end."""

import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from missions.executive.executive import HALT_TIMEOUT
from tests.missions.command import command
from tests.missions.test_cleanup_endings import write_files
from tests.missions.test_ending import Driving
from tests.waiting import wait_until

MISSION = """mission: far
tree:
  drive: 20 m
  timeout: LIMIT
  finally:
    sequence:
      - log: begin
      - CLEANUP
"""
MOVING = "{sequence: [{liar: , timeout: 300 ms, on_failure: succeed}, {notify: cleaned}]}"


class Witness:
    """A mission that drives a virtual base; ``commands`` are the speeds that the wire has carried."""

    def __init__(self, folder: Path, limit: str, mission: str, cleanup: str) -> None:
        write_files(folder)
        self.commands: list[float] = []
        self.driving = Driving(folder, mission=mission.replace("LIMIT", limit).replace("CLEANUP", cleanup))
        self.pid = str(self.driving.process.process.pid)
        body = self.driving.kobuki.body
        carry_out = body.command

        def record(linear: float, angular: float, now: float) -> None:
            self.commands.append(max(abs(linear), abs(angular)))
            carry_out(linear, angular, now)

        self.driving.terminal.call_paused(lambda: setattr(body, "command", record))

    @property
    def motions_after_stop(self) -> list[float]:
        """Commands to move that followed the first command to stop."""
        stop = next((place for place, speed in enumerate(self.commands) if speed == 0.0), len(self.commands))
        return [speed for speed in self.commands[stop:] if speed > 0.0]


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Callable[..., Witness]]:
    found: list[Witness] = []

    def make(limit: str, mission: str = MISSION, cleanup: str = MOVING) -> Witness:
        found.append(Witness(tmp_path, limit, mission, cleanup))
        return found[0]

    yield make
    for witness in found:
        witness.driving.close()


def end_by_signal(number: int) -> Callable[[Witness, pytest.CaptureFixture[str]], int]:
    return lambda witness, _: witness.driving.process.end(number)


def end_by_command(witness: Witness, capsys: pytest.CaptureFixture[str]) -> int:
    assert "is being ended" in command(capsys, "stop", "--end", witness.pid).out
    return witness.driving.process.end()


def end_after_stop(witness: Witness, capsys: pytest.CaptureFixture[str]) -> int:
    assert "stopped (base" in command(capsys, "stop", witness.pid).out
    wait_until(lambda: witness.driving.speed == 0.0)
    return witness.driving.process.end(signal.SIGTERM)


def end_by_failure(witness: Witness, capsys: pytest.CaptureFixture[str]) -> int:
    del capsys
    return witness.driving.process.end()


WAYS = {
    "Ctrl-C": ("60 s", end_by_signal(signal.SIGINT), 130),
    "SIGTERM": ("60 s", end_by_signal(signal.SIGTERM), 130),
    "mission stop --end": ("60 s", end_by_command, 130),
    "SIGTERM after mission stop": ("60 s", end_after_stop, 130),
    "failure": ("2 s", end_by_failure, 1),
}


@pytest.mark.real_time
@pytest.mark.parametrize("way", WAYS)
def test_wire_carries_no_motion_after_the_end_of_a_node_with_a_cleanup(
    way: str, start: Callable[[str], Witness], capsys: pytest.CaptureFixture[str]
) -> None:
    limit, end, code = WAYS[way]
    witness = start(limit)
    assert end(witness, capsys) == code
    said = "".join(witness.driving.process.errors)
    assert "kept still: a behaviour in 'finally' must not move anything" in said
    assert "cleaned" in said
    assert "moved" not in said
    assert witness.motions_after_stop == []
    wait_until(lambda: witness.driving.speed == 0.0, seconds=0.4)


THREAD = """mission: far
tree:
  sequence:
    - threader:
      for: 4 s
      finally: {wait: 1 s}
    - wait: 1 s
  timeout: LIMIT
"""


@pytest.mark.real_time
@pytest.mark.parametrize("way", ["end of the leaf", "SIGTERM"])
def test_thread_of_a_leaf_moves_nothing_after_the_end_of_the_leaf(way: str, start: Callable[..., Witness]) -> None:
    witness = start("60 s", THREAD)
    wait_until(lambda: any(witness.commands))
    code = witness.driving.process.end(*([signal.SIGTERM] if way == "SIGTERM" else []))
    assert code == (130 if way == "SIGTERM" else 0)
    assert witness.motions_after_stop == []
    wait_until(lambda: witness.driving.speed == 0.0, seconds=0.4)


@pytest.mark.real_time
def test_killed_run_starts_no_cleanup(start: Callable[[str], Witness]) -> None:
    witness = start("60 s")
    witness.driving.process.end(signal.SIGKILL)
    wait_until(lambda: witness.driving.speed == 0.0, seconds=2.0)
    assert "refused" not in "".join(witness.driving.process.errors)


ENDLESS = f"{MISSION}  halt_limit: 10 s\n"
CLEANUPS = {
    "waits": "wait: 1 h",
    "repeats": "{log: again, repeat: forever}",
    "nested": "{wait: 1 h, finally: {wait: 1 h, finally: {wait: 1 h}, halt_limit: 10 s}, halt_limit: 10 s}",
    "tries to move": "{liar: , on_failure: succeed}",
}


@pytest.mark.real_time
@pytest.mark.parametrize(
    ("way", "cleanup"), [*(("SIGTERM", each) for each in CLEANUPS), ("mission stop --end", "waits")]
)
def test_end_with_an_endless_cleanup_is_over_after_the_halt_timeout(
    way: str, cleanup: str, start: Callable[..., Witness], capsys: pytest.CaptureFixture[str]
) -> None:
    witness = start("60 s", ENDLESS, CLEANUPS[cleanup])
    _, end, code = WAYS[way]
    began = time.monotonic()
    assert end(witness, capsys) == code
    assert time.monotonic() - began < HALT_TIMEOUT + 3.0  # with the end of the process
    assert "begin" in "".join(witness.driving.process.errors)
    assert witness.motions_after_stop == []
    wait_until(lambda: witness.driving.speed == 0.0, seconds=0.4)


@pytest.mark.real_time
@pytest.mark.parametrize("way", ["SIGTERM", "mission stop --end"])
def test_end_during_an_endless_cleanup_is_over_after_the_halt_timeout(
    way: str, start: Callable[..., Witness], capsys: pytest.CaptureFixture[str]
) -> None:
    witness = start("1 s", ENDLESS, CLEANUPS["waits"])
    wait_until(lambda: "begin" in "".join(witness.driving.process.errors), seconds=10.0)
    _, end, code = WAYS[way]
    began = time.monotonic()
    assert end(witness, capsys) == code
    assert time.monotonic() - began < HALT_TIMEOUT + 3.0
    assert witness.motions_after_stop == []
    wait_until(lambda: witness.driving.speed == 0.0, seconds=0.4)
