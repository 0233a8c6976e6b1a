"""Servo buses by chance: nothing is written to a servo that was not identified; a healthy bus needs few questions."""

from collections.abc import Callable
from pathlib import Path

import pytest

from drivers.servos.bus import ServoBus
from drivers.servos.declared import DynamixelKeys
from drivers.servos.driver import DynamixelJoints
from drivers.servos.make import joint_specs as specs
from drivers.sim.timeline import Timeline
from missions.library.drivers import load_robot
from tests.drivers.cranked import PERIOD, by_hand
from tests.drivers.lines import DirectLine
from tests.missions.command import Outcome, command
from tests.missions.servo_buses import ENOUGH, FAULTS, RATE, Case, Oracle, Table, by_joint, command_for
from tests.tries import tries

FIRST = 5000
"""The first seed; those below were for tuning."""

Run = Callable[[str], Outcome]


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Run:
    monkeypatch.chdir(tmp_path)
    return lambda line: command(capsys, "servo", *line.split(), "--robot", "bus.yaml")


def faulty(seed: int, run: Run, patch: pytest.MonkeyPatch) -> list[str]:
    """Try a faulty bus with one command, then with the driver; return what went wrong."""
    fault = FAULTS[seed % len(FAULTS)]
    case = Case(seed, fault)
    table = Table(case, patch)
    line = command_for(case)
    if not case.driven and fault not in ("wrong mode", "mute") and by_joint(line):
        table.oracle.forbidden.add(case.victim)
    outcome = run(line)
    wrong = [f"{each} ({line})" for each in table.oracle.wrong]
    if table.clock.now() > ENOUGH:
        wrong.append(f"{line} took {table.clock.now():.0f} s")
    doubted = fault in ("twins", "clone") and f"{case.told}" in line
    if doubted and outcome.code == 0:
        wrong.append(f"{line} succeeded")
    if outcome.code == 70:
        wrong.append(f"{line}: {outcome.err}")
    return [f"seed {seed}, {fault}: {each}" for each in wrong]


def driven(seed: int) -> list[str]:
    """Start the driver on a faulty bus and move all of it; return what went wrong."""
    fault = FAULTS[seed % len(FAULTS)]
    case = Case(seed, fault)
    Path("bus.yaml").write_text(case.file)
    timeline = Timeline()
    oracle = Oracle(case.chain)
    oracle.forbidden |= set() if case.driven else {case.victim}
    line = DirectLine(oracle, timeline.clock)
    timeline.call_every(PERIOD, line.poll)
    bus = ServoBus("/dev/servos", timeline.clock, baud=RATE, name="arm", dial=line.dial)
    arm = load_robot(Path("bus.yaml")).keys(DynamixelKeys)
    assert arm is not None
    joints = DynamixelJoints(bus, specs(arm), timeline.clock, loop=by_hand(timeline))
    joints.open()
    timeline.run_until(timeline.clock.now() + 3.0)
    name, health = f"j{case.told}", joints.health()
    if health.online:
        joints.move(dict.fromkeys(joints.limits, 0.2))
    timeline.run_until(timeline.clock.now() + 1.0)
    joints.close()
    wrong = list(oracle.wrong)
    if not case.driven and (name not in health.detail or not health.hint):
        wrong.append(f"{name} is not told of: {health.detail}, {health.hint}")
    return [f"seed {seed}, {fault}, driver: {each}" for each in wrong]


def healthy(seed: int, run: Run, patch: pytest.MonkeyPatch) -> list[str]:
    """Set a healthy bus up; return what went wrong, and the questions that were too many."""
    case = Case(seed)
    table = Table(case, patch)
    stiff = case.chance.random() < 0.5
    for servo in case.chain.servos:
        servo.set("torque_enable", int(stiff))
    wrong = []
    lines = [
        (f"set {case.told} id 77", 1 + stiff),  # stiff: somebody holds it
        (f"set 77 id {case.told}", 1),
        ("set all temperature_limit 60", 1 + (stiff and len(case.chain.servos) > 1)),
        ("set all temperature_limit 60", 0),
        ("torque off", 1),
        ("calibrate --seconds 1", 1),
        ("torque on", 0),
    ]
    for line, expected in lines:
        before = table.questions
        outcome = run(line)
        if outcome.code != 0:
            wrong.append(f"{line}: {outcome.code}: {outcome.err}")
        if table.questions - before != expected:
            wrong.append(f"{line}: {table.questions - before} questions, not {expected}")
    wrong += table.oracle.wrong
    return [f"seed {seed}, {case.kind}: {each}" for each in wrong]


@pytest.mark.parametrize("seed", range(FIRST, FIRST + tries(33, most=200)))
def test_unidentified_servo_is_never_written(seed: int, run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    assert faulty(seed, run, monkeypatch) == []
    assert driven(seed) == []


@pytest.mark.parametrize("seed", range(FIRST, FIRST + tries(8, most=100)))
def test_a_healthy_bus_is_set_up_without_a_question_too_many(
    seed: int, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert healthy(seed, run, monkeypatch) == []
