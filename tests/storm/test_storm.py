"""The storm: a seed stands for all that happens, what must hold does, and what breaks is made small and told."""

import json
import signal
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from random import Random

import pytest
from py_trees.common import Status

from behaviours.haltable_node import HaltableNode
from behaviours.head import LookLeaf
from behaviours.leaf import Leaf
from behaviours.mirror import Mirror as Led
from drivers.api import Velocity, ignore
from drivers.base.arbitrated import ArbitratedBase
from drivers.base.range_guard import RangeGuard
from drivers.errors import DeviceFault
from drivers.servos.twin import JointsTwin
from missions.executive.executive import Executive
from missions.executive.proxied_robot import StaleCommandGuard
from tests import planted
from tests.storm import invariants
from tests.storm.__main__ import command
from tests.storm.others import OTHERS, others_of
from tests.storm.play import Outcome, play, play_seed, played_twice
from tests.storm.shrink import as_test, shrunk
from tests.storm.trees import Trees
from tests.storm.weather import Weather, draw, faults_of
from tests.storm.witness import Witness

SEEDS = range(1, 21)
"""A breath of it: `make storm` has the rest."""

DRIVES = 'mission: drives\ntree: {"drive": {"distance": "1 m", "speed": "0.2 m/s"}}\n'
FAULTS = ("run stalled at 1 s for 0.2 s", "base bumped left at 2 s for 0.5 s", "run paused at 1.5 s for 0.2 s")


def weather(*faults: str, mission: str = DRIVES) -> Weather:
    return Weather(7, mission, "turtlebot2", "empty", 12.0, faults)


@pytest.fixture
def no_bumps(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let it be a promise that nothing ever bumps."""

    def look(seen: Witness) -> Iterator[str]:
        if any(each.state == "bumped" for each in seen.struck):
            yield "it bumped"

    monkeypatch.setitem(invariants.INVARIANTS, "no_bumps", ("nothing bumps", look))


def test_invariants_hold_in_a_short_storm() -> None:
    broken = {seed: outcome.broken for seed in SEEDS if (outcome := play_seed(seed)).broken}
    assert broken == {}


def test_seed_determines_the_storm() -> None:
    assert draw(12) == draw(12)
    assert draw(12) != draw(13)


def test_missions_use_all_arms_and_heads() -> None:
    joints = {arm: {"elbow": (-9.0, 9.0), "wrist": (0.0, 9.0)} for arm in ("arm", "right_arm")}
    others = {"mast": "head", "right_arm": "arm"}
    text = "".join(Trees(Random(seed), {"arm", *others}, joints, others).mission() for seed in range(50))  # noqa: S311
    assert all(words in text for words in ('"leader_arm": "right_arm"', '"on": "mast"', '"on": "right_arm"'))
    assert '{"look": {"pan"' in text
    assert '"find_face"' not in text  # that is for the head with the camera


def test_faults_of_a_second_arm_are_drawn_by_name() -> None:
    assert faults_of("right_arm", "arm", "so101") == [
        "right_arm unplugged",
        "right_arm overloaded JOINT",
        "right_arm turned JOINT to ANGLE",
    ]
    assert {name for seed in range(50) for name in others_of("turtlebot2_arm", Random(seed))} == {*OTHERS}  # noqa: S311


def test_the_same_storm_happens_again_to_the_byte() -> None:
    stormy = weather(*FAULTS)
    assert play(stormy).digest == play(stormy).digest
    assert played_twice(stormy).broken == {}


def test_applied_faults_are_counted() -> None:
    assert play(weather(*FAULTS)).struck == {"run stalled": 1, "base bumped": 1, "run paused": 1}


def test_stalled_loop_ticks_late() -> None:
    even, late = play(weather()), play(weather("run stalled at 2 s for 1 s"))
    assert even.result == late.result == "success"
    assert late.seconds > even.seconds + 0.6


def test_stopped_run_continues_when_released() -> None:
    even, late = play(weather()), play(weather("run stopped at 2 s for 3 s"))
    assert late.broken == {}
    assert late.result == "success"
    assert late.seconds > even.seconds + 2.5


def test_hanging_voice_delays_the_mission() -> None:
    says = 'mission: says\ntree: {"say": "Hello"}\n'
    assert play(weather(mission=says)).result == "success"
    assert play(weather("voice hanging from 0.1 s", mission=says)).result == "interrupted"


TURNS = (
    'mission: turns\ntree: {"sequence": ['
    '{"look": {"pan": "75 deg"}, "timeout": "0.5 s", "on_failure": "succeed"}, {"wait": "3 s"}]}\n'
)
LEAVES_IT = 'mission: leaves\ntree: {"rogue_arm": {"way": "leaves", "goal": "fast", "after": 3}}\n'
NEVER_STOPS = (
    'mission: never\ntree: {"sequence": [{"rogue_head": {"way": "never stops", "goal": "fast", "after": 3}, '
    '"timeout": "0.5 s", "on_failure": "succeed"}, {"wait": "4 s"}]}\n'
)
LED = (
    'mission: led\ntree: {"sequence": [{"mirror": {"leader_arm": "arm", "on": "right_arm", "leader": "elbow", '
    '"follower": "elbow", "offset": "50 deg"}, "timeout": "0.5 s", "on_failure": "succeed"}, {"wait": "4 s"}]}\n'
)
AWAY = 'mission: away\ntree: {"move_joints": {"to": {"elbow": "50 deg"}, "on": "right_arm", "patience": "20 s"}}\n'
PAUSED = ("run paused at 1 s for 7 s", "base battery at 3 % at 1.2 s")


def never_stopped(leaf: Leaf) -> bool:
    """Halt a leaf, and wait for it for ever."""
    leaf.halting()
    return False


def gone_on(executive: Executive) -> Status:
    """Go on with the mission that must end."""
    return executive.root.execute_tick()


def unlimited(_: object, going: Velocity, *_told: object, **_more: object) -> tuple[Velocity, str]:
    """Limit nothing, whatever the range finder sees."""
    return going, ""


INTO_ANNA = replace(weather(mission="mission: storm\ntree:\n  drive: 4 m\n"), world="obstacles", seconds=20.0)


def slow(mission: str) -> Weather:
    return replace(weather(mission=mission), robot="turtlebot2_arm", limbs=0.1)


def on_others(mission: str, part: str = "", faults: tuple[str, ...] = ()) -> Weather:
    """Let a part under a name of its own do it, on a robot with a second arm and a second head."""
    told = mission.replace('"after": 3', f'"after": 3, "on": "{part}"') if part else mission
    return replace(slow(told), others=("mast", "right_arm"), faults=faults)


@pytest.mark.parametrize(
    ("owner", "name", "fault", "shows", "promise"),
    [
        (ArbitratedBase, "latch", ignore, weather("run stopped at 1 s for 1 s"), "latched"),
        (RangeGuard, "limit", unlimited, INTO_ANNA, "no_touch"),
        (Executive, "_guard_paused", ignore, weather(*PAUSED), "battery"),
        (Executive, "_halt_for_alarm", gone_on, weather("base battery at 3 % at 0.1 s"), "battery"),
        (StaleCommandGuard, "__call__", ignore, weather("base unplugged at 1 s for 2 s"), "anew"),
        (HaltableNode, "_has_stopped", never_stopped, slow(NEVER_STOPS), "halted"),
        (HaltableNode, "_stop_safely", ignore, slow(NEVER_STOPS), "claimed_motion"),
        (LookLeaf, "terminate", ignore, slow(TURNS), "claimed_motion"),
        (JointsTwin, "rest", ignore, slow(LEAVES_IT), "at_rest"),
        (JointsTwin, "rest", ignore, on_others(LEAVES_IT, "right_arm"), "at_rest"),
        (HaltableNode, "_has_stopped", never_stopped, on_others(NEVER_STOPS, "mast"), "halted"),
        (HaltableNode, "_stop_safely", ignore, on_others(NEVER_STOPS, "mast"), "claimed_motion"),
        (Led, "terminate", ignore, on_others(LED), "claimed_motion"),
        (
            StaleCommandGuard,
            "__call__",
            ignore,
            on_others(AWAY, faults=("right_arm unplugged at 1 s for 2 s",)),
            "anew",
        ),
    ],
)
def test_a_promise_is_held_and_is_seen_to_be_broken_where_the_code_has_a_fault(
    owner: type, name: str, fault: object, shows: Weather, promise: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert play(shows).broken == {}
    monkeypatch.setattr(owner, name, fault)
    assert promise in play(shows).broken


def test_head_stopped_at_its_first_tick_does_not_turn_back() -> None:
    turns = TURNS.replace('"sequence"', '"repeat": "forever", "sequence"').replace("3 s", "2.11 s")
    assert play(replace(slow(turns), rate=10, seconds=6.0, stop_at=3, stop_for=3.0, hangs=2.0)).broken == {}


def test_joint_beyond_its_limits_returns_to_the_nearest_tick_within() -> None:
    hot = 'mission: hot\ntree: {"joint_hot": {}, "retry": "forever"}\n'
    turned = weather("arm turned right_ankle_roll to -50 deg at 0.5 s", mission=hot)
    assert play(replace(turned, robot="humanoid", limbs=0.2, seconds=2.0)).broken == {}


def test_refused_command_leaves_an_earlier_motion_running() -> None:
    left, refused = (
        {"way": way, "goal": goal, "after": 3} for way, goal in (("leaves", "fast"), ("never stops", "nan"))
    )
    steps = [{"rogue_arm": left}, {"rogue_arm": refused, "on_failure": "succeed"}, {"wait": "3 s"}]
    assert play(slow(f"mission: left\ntree: {json.dumps({'sequence': steps})}\n")).broken == {}


def test_leaf_failing_otherwise_leaves_nothing_moving(monkeypatch: pytest.MonkeyPatch) -> None:
    move = JointsTwin.move

    def complains(arm: JointsTwin, goals: Mapping[str, float], **given: Mapping[str, float] | None) -> object:
        accepted = move(arm, goals, **given)
        if 0.2 in goals.values():
            raise DeviceFault("arm: a servo is too warm")
        return accepted

    left, failed = (
        {"rogue_arm": {"way": way, "goal": goal, "after": 3}}
        for way, goal in (("leaves", "fast"), ("never stops", "mild"))
    )
    tree = {"sequence": [left, {**failed, "on_failure": "succeed"}, {"wait": "3 s"}]}
    monkeypatch.setattr(JointsTwin, "move", complains)
    assert "claimed_motion" in play(slow(f"mission: failed\ntree: {json.dumps(tree)}\n")).broken


def test_planted_faults_match_the_code() -> None:
    gone = [each.name for each in planted.FAULTS if each.old not in (planted.ROOT / each.file).read_text("utf-8")]
    assert gone == []


@pytest.mark.usefixtures("no_bumps")
def test_broken_storm_shrinks_to_the_causing_fault() -> None:
    outcome = play(weather(*FAULTS))
    assert outcome.broken == {"no_bumps": "it bumped"}
    small = shrunk(outcome)
    assert small.weather.faults == ("base bumped left at 2 s for 0.5 s",)
    assert small.broken == outcome.broken


@pytest.mark.usefixtures("no_bumps")
def test_broken_storm_becomes_a_failing_test() -> None:
    text = as_test(play(weather(*FAULTS)))
    told: dict[str, object] = {}
    exec(compile(text, "test_storm_7.py", "exec"), told)  # noqa: S102 - of our own writing
    test = told["test_what_seed_7_of_the_storm_has_found"]
    assert callable(test)
    with pytest.raises(AssertionError):
        test()
    del invariants.INVARIANTS["no_bumps"]
    test()


def storm(*arguments: str) -> int:
    """Run ``python -m tests.storm`` with these arguments in this process; return its exit code."""
    code: int = command.main(list(arguments), standalone_mode=False)
    return code


def test_replay_prints_the_schedule(capsys: pytest.CaptureFixture[str]) -> None:
    assert storm("--seed", "2") == 0
    out = capsys.readouterr().out
    assert all(words in out for words in draw(2).faults)


def test_table_lists_faults_and_invariants(capsys: pytest.CaptureFixture[str]) -> None:
    assert storm("--seeds", "3", "--jobs", "1") == 0
    out = capsys.readouterr().out
    assert out.startswith("3 seeds, ")
    assert "held  at_rest: the base is at rest 0.7 s after the end" in out


@pytest.mark.usefixtures("no_bumps")
def test_broken_seed_is_reported_with_a_command(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr("tests.storm.play.draw", lambda _: weather(*FAULTS))
    assert storm("--seeds", "1", "--first", "7", "--jobs", "1") == 1
    out = capsys.readouterr().out
    assert "seed 7 breaks no_bumps: it bumped\n  try: python -m tests.storm --seed 7 --shrink" in out
    written = tmp_path / "test_storm_7.py"
    assert storm("--seed", "7", "--shrink", "--output", str(written)) == 1
    assert "base bumped left at 2 s" in written.read_text()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_interrupted_storm_prints_its_results(
    number: signal.Signals, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def played(*_: object) -> Iterator[Outcome]:
        yield play_seed(2)
        signal.raise_signal(number)

    monkeypatch.setattr("tests.storm.__main__.play_all", played)
    assert storm("--seeds", "20000") == 130
    assert capsys.readouterr().out.startswith("1 seeds, ")
