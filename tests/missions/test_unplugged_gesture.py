"""An arm that is unplugged in mid-gesture is waited for; what could not be brought to rest is named at the end."""

import json
import signal
from collections.abc import Iterator
from math import radians
from pathlib import Path

import pytest

from drivers.virtual.patient_clock import PatientClock
from tests.missions.command import Process, events_of
from tests.missions.servo_bench import Three, three
from tests.waiting import wait_until

pytestmark = pytest.mark.real_time

SLOW = """\
gesture: slow
summary: Lift the elbow, slowly.
keyframes:
  - {at: 0.2 s, elbow: 5 deg}
  - {at: 3 s, elbow: 50 deg}
"""

MISSION = "mission: lift\ntree:\n  gesture: {gesture: slow.yaml}\n"


class Lifting:
    """A `mission run` process that lifts the elbow of virtual servos of ours."""

    def __init__(self, robot: Three, mission: str) -> None:
        self.robot = robot
        Path("slow.yaml").write_text(SLOW)
        Path("lift.yaml").write_text(mission)
        short = "driver: dynamixel\n  away: {decide_after: 20 s, latch_after: 30 s}"  # for how slow machines are
        Path("three.yaml").write_text(Path("three.yaml").read_text().replace("driver: dynamixel", short))
        self.process = Process("run", "lift.yaml", "--robot", "three.yaml", "--json", "--events", "events.jsonl",
                               folder=Path.cwd())  # fmt: skip

    @property
    def angle(self) -> float:
        """How far the elbow is lifted, in radians."""
        return self.robot.terminal.call_paused(lambda: radians(10) - self.robot.elbow.angle)

    def wait_for(self, degrees: float) -> None:
        wait_until(lambda: self.angle > radians(degrees))

    def faults(self) -> list[tuple[str, str]]:
        """What was told of the arm so far: kind and words."""
        lines = Path("events.jsonl").read_text().splitlines()
        whole = [line for line in lines if line.endswith("}")]
        return [(each["status"], each["detail"]) for each in events_of(whole) if each["event"] == "fault"]

    def left(self) -> str:
        """What was printed of joints that could not be relaxed: rest is asked for twice, and told in the same words."""
        lines = [line for line in self.process.errors if "could not be relaxed: " in line]
        (names,) = {line.partition("could not be relaxed: ")[2].strip() for line in lines}
        return names

    def result(self, number: int | None = None) -> tuple[int, dict[str, str]]:
        """Wait for its end; return its exit code and its last line."""
        code = self.process.end(number)
        return code, json.loads(self.process.lines[-1])


@pytest.fixture
def robot(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Three]:
    monkeypatch.chdir(tmp_path)
    with three(Path("three.yaml"), PatientClock()) as found:
        yield found


def test_gesture_continues_after_the_arm_is_replugged(robot: Three) -> None:
    lifting = Lifting(robot, MISSION)
    lifting.wait_for(15)
    robot.terminal.unplug()
    wait_until(lambda: "offline" in [kind for kind, _ in lifting.faults()])
    here = lifting.angle
    assert lifting.process.process.poll() is None
    robot.terminal.replug()
    code, last = lifting.result()
    assert (code, last["result"]) == (0, "success"), last
    assert here < radians(50)
    assert lifting.angle == pytest.approx(radians(50), abs=0.07)
    kinds = [kind for kind, _ in lifting.faults()]
    assert kinds.index("offline") < len(kinds) - 1 - kinds[::-1].index("online")


def test_gesture_of_an_unplugged_arm_times_out(robot: Three) -> None:
    lifting = Lifting(robot, MISSION + "  timeout: 3 s\n")
    lifting.wait_for(10)
    robot.terminal.unplug()
    code, last = lifting.result()
    assert (code, last["result"]) == (1, "failure")
    assert "timed out after 3 s" in last["reason"]
    assert "arm" in last["reason"]


@pytest.mark.parametrize("mission", [MISSION, MISSION + "  timeout: 3 s\n"], ids=["interrupted", "timed out"])
def test_unrelaxed_servos_are_printed_at_the_end(robot: Three, mission: str) -> None:
    lifting = Lifting(robot, mission)
    lifting.wait_for(10)
    robot.terminal.unplug()
    lifting.result(None if "timeout" in mission else signal.SIGINT)
    assert lifting.left() == "waist (servo 1), elbow (servo 2), wrist (servo 3)"
    assert any("try: switch their power off by hand" in line for line in lifting.process.errors)


def test_only_the_lost_servo_is_left_unrelaxed(robot: Three) -> None:
    lifting = Lifting(robot, MISSION)
    lifting.wait_for(10)
    robot.terminal.call_paused(lambda: setattr(robot.waist, "present", False))
    wait_until(lambda: any("waist (servo 1) no longer answers" in words for _, words in lifting.faults()))
    code, _ = lifting.result(signal.SIGINT)
    assert code == 130
    assert lifting.left() == "waist (servo 1)"
    assert robot.elbow.limp
