"""Whatever ends a run, the robot is at rest and its ports are free."""

import json
import signal
from pathlib import Path

import pytest

from drivers.clock import SystemClock
from drivers.kobuki.virtual import VirtualKobuki
from drivers.transport.ports import open_port
from drivers.virtual.terminal import PseudoTerminal
from missions.request import RunRequest
from missions.runner import Runner
from tests.missions.command import Process
from tests.waiting import wait_until

FAR = "mission: far\ntree:\n  drive: 20 m\n"
ROBOT = "robot: tester\nbase: {driver: kobuki, port: PORT}\n"


class Driving:
    """A `mission run` process that drives a virtual Kobuki of ours."""

    def __init__(self, folder: Path, *, mission: str = FAR) -> None:
        self.kobuki = VirtualKobuki()
        self.terminal = PseudoTerminal("kobuki", self.kobuki, SystemClock())
        self.terminal.open()
        (folder / "far.yaml").write_text(mission)
        (folder / "robot.yaml").write_text(ROBOT.replace("PORT", self.terminal.path))
        self.process = Process("run", "far.yaml", "--robot", "robot.yaml", "--json", folder=folder)
        wait_until(lambda: self.speed > 0.1)

    @property
    def speed(self) -> float:
        """How fast the virtual base moves, in m/s."""
        return self.terminal.call_paused(lambda: abs(self.kobuki.wheels.velocity.linear))

    def close(self) -> None:
        self.terminal.close()


@pytest.mark.real_time
@pytest.mark.parametrize(("number", "word"), [(signal.SIGTERM, "SIGTERM"), (signal.SIGINT, "Ctrl-C")])
def test_a_signal_in_mid_drive_leaves_the_base_stopped_and_the_port_free(
    number: int, word: str, tmp_path: Path
) -> None:
    driving = Driving(tmp_path)
    try:
        assert driving.process.end(number) == 130
        summary = json.loads(driving.process.lines[-1])
        assert (summary["result"], summary["reason"]) == ("interrupted", word)
        # The driver's last words were zero: the base does not have to wait for its own time-out.
        wait_until(lambda: driving.speed == 0.0, seconds=0.4)
        open_port("test", driving.terminal.path, 115_200).close()
    finally:
        driving.close()


@pytest.mark.real_time
def test_a_killed_process_leaves_the_base_at_rest_within_a_moment(tmp_path: Path) -> None:
    driving = Driving(tmp_path)
    try:
        driving.process.end(signal.SIGKILL)
        wait_until(lambda: driving.speed == 0.0, seconds=2.0)
    finally:
        driving.close()


@pytest.mark.real_time
def test_failed_mission_stops_the_base_mid_drive(tmp_path: Path) -> None:
    driving = Driving(tmp_path, mission="mission: far\ntree:\n  drive: 20 m\n  timeout: 1 s\n")
    try:
        assert driving.process.end() == 1
        summary = json.loads(driving.process.lines[-1])
        assert "timed out after 1 s" in summary["reason"]
        wait_until(lambda: driving.speed == 0.0, seconds=0.4)
    finally:
        driving.close()


@pytest.mark.real_time
def test_replugged_base_drives_on_in_the_same_run(tmp_path: Path) -> None:
    driving = Driving(tmp_path)
    try:
        driving.terminal.unplug()
        wait_until(lambda: driving.speed == 0.0, pause=0.01)  # away for a second, it would decide anew
        driving.terminal.replug()
        wait_until(lambda: driving.speed > 0.1)
        assert driving.process.end(signal.SIGTERM) == 130
    finally:
        driving.close()


def test_a_run_leaves_no_signal_handler_behind(tmp_path: Path) -> None:
    (tmp_path / "short.yaml").write_text("mission: short\ntree: succeed\n")
    before = signal.getsignal(signal.SIGTERM)
    assert Runner(RunRequest(str(tmp_path / "short.yaml"))).run().result == "success"
    assert signal.getsignal(signal.SIGTERM) is before
