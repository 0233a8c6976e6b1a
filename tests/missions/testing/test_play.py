"""Cases are played on twins: what is given happens, what must never be is noticed, and all runs of one case agree."""

from pathlib import Path

import pytest

from behaviours.driving.motion import DriveLeaf
from missions.executive.events import CommandSent, Ticked
from missions.plugins.testing.case_history import CaseHistory
from missions.plugins.testing.case_runner import IN_PROCESS_LIMITS, CaseRunner
from missions.plugins.testing.case_verdict import play
from missions.plugins.testing.recorders import LeafTestBench
from tests.missions.testing.playing import BLINKS, DRIVES, LOOKS, SPEAKS, TRIES, WAITS, WAVES, cases, played, seen


@pytest.mark.parametrize(
    ("mission", "body"),
    [
        (DRIVES, "expect: {result: success, base: stopped, faults: [], pose: {near: [40 cm, 0 m], within: 2 cm}}"),
        (DRIVES, "given: [base bumped], expect: {result: failure, reason: bumped into something}"),
        (DRIVES, "given: [base bumped at 1 s], expect: {result: failure, after: 1 s, within: 1.2 s}"),
        (DRIVES, "given: [base bumped when base moves for 100 ms], expect: {result: failure, reason: bumped}"),
        (DRIVES, "given: [base cliff left when base moves], expect: {reason: a cliff ahead}"),
        (DRIVES, "given: [base lifted from 1 s to 2 s], expect: {reason: a wheel has dropped}"),
        (DRIVES, "given: [base unplugged at 1 s for 900 ms], expect: {result: success, after: 2 s}"),
        (DRIVES, "given: [base unplugged at 1 s for 2 s], expect: {result: failure, reason: began before it was back}"),
        (TRIES, "given: [base unplugged at 1 s for 2 s], expect: {result: success, order: [drive fails, base moves]}"),
        (TRIES, "given: [base unplugged at 1 s for 6 s], expect: {result: failure, reason: it was away for 6 s}"),
        (DRIVES, "given: [base unplugged], expect: {result: error, reason: unplugged, never_ran: drive}"),
        (DRIVES, "given: [{drive: succeeds after 2 s}], expect: {after: 2 s, pose: {near: [0 m, 0 m], within: 1 mm}}"),
        (DRIVES, "given: [base cliff when base moves, base unplugged when base moves for 1 s], expect: {after: 1 s}"),
        (
            LOOKS,
            "given: [head unplugged at 100 ms for 1 s], expect: {result: failure, reason: began before}",
        ),
        (SPEAKS, 'expect: {said: [One, Two], order: [say "One", say succeeds, say "Two"]}'),
        (SPEAKS, 'given: [voice unplugged when say "One" for 3 s], expect: {said: [One, Two], after: 3 s}'),
        (WAVES, "given: [arm overloaded elbow at 1500 ms], expect: {result: failure, reason: elbow, faults: [elbow]}"),
        (WAVES, "given: [arm unplugged at 1 s for 900 ms], expect: {order: [arm disconnects, arm reconnects]}"),
        (WAVES, "given: [arm unplugged at 1 s for 2 s], expect: {result: failure, reason: began before it was back}"),
        (BLINKS, "expect: {result: success}"),
        (BLINKS, "given: [camera covered], expect: {result: failure, reason: no face in view}"),
        (BLINKS, "given: [camera covered for 1 s], expect: {result: success}"),
        (BLINKS, "given: [camera unplugged at 1 s], expect: {result: failure, faults: [camera]}"),
        (BLINKS, "eyes: pixels, given: [camera frozen], expect: {result: failure, reason: no face in view}"),
    ],
)
def test_given_events_happen_and_expectations_pass(mission: str, body: str, tmp_path: Path) -> None:
    verdict = played(tmp_path, mission, body)
    assert verdict.passed, [*seen(verdict), verdict.error, *verdict.last_events]


def test_a_battery_can_be_low(tmp_path: Path) -> None:
    mission = "mission: m\ntree: {sequence: [{wait: 1 s}, {fail: empty, if: battery.percent < 20}, stop]}\n"
    assert played(tmp_path, mission, "expect: {result: success}").passed
    assert played(tmp_path, mission, "given: [base battery at 10 %], expect: {reason: empty}").passed


def test_verdict_shows_the_line_and_the_last_events(tmp_path: Path) -> None:
    verdict = played(tmp_path, SPEAKS, "expect: {said: Three}")
    assert not verdict.passed
    (miss,) = verdict.misses
    assert str(miss).splitlines()[1].endswith("- {case: case 1, expect: {said: Three}}")
    assert seen(verdict) == ['it never said "Three"; it said "One", "Two"']
    assert len(verdict.last_events) <= 10
    assert verdict.last_events[-1].endswith("m ends: success")
    assert any('says "Two"' in line for line in verdict.last_events)


@pytest.mark.parametrize(
    ("expect", "told"),
    [
        ("result: running", []),
        ("result: running, ran: {wait: 1}, after: 5 s, within: 5.1 s, never_ran: say, base: stopped", []),
        ("result: success", ["the result was running: still running after 5 s of simulated time"]),
        ("result: interrupted", ["the result was running: still running after 5 s of simulated time"]),
        ("ran: wait", ["still running after 5 s of simulated time"]),
    ],
)
def test_run_without_an_end_is_ended_by_the_timeout_of_the_case(expect: str, told: list[str], tmp_path: Path) -> None:
    mission = "mission: m\ntree: {sequence: [{wait: 1 s}, {say: Hello}]}\n"
    verdict = played(tmp_path, mission, f"given: [{{wait: runs}}], timeout: 5 s, expect: {{{expect}}}")
    assert seen(verdict) == told
    assert verdict.result == "running"
    assert verdict.seconds == pytest.approx(5.0, abs=0.1)


def test_run_that_ends_is_not_running(tmp_path: Path) -> None:
    verdict = played(tmp_path, WAITS, "timeout: 5 s, expect: {result: running}")
    assert seen(verdict) == ["the result was success"]
    verdict = played(tmp_path, WAITS, "timeout: 1.5 s, expect: {ran: wait}")  # over while the robot comes to rest
    assert seen(verdict) == []


def test_base_that_drives_forever_is_stopped_at_the_timeout(tmp_path: Path) -> None:
    mission = "mission: m\ntree: {drive: 10 cm, repeat: forever}\n"
    expect = "{result: running, order: [base moves, drive succeeds, drive halts], base: stopped, faults: []}"
    verdict = played(tmp_path, mission, f"timeout: 4 s, expect: {expect}")
    assert seen(verdict) == []


GO = """
from py_trees.common import Status
from behaviours.leaf import Leaf
from drivers.api import Velocity

class Go(Leaf):
    "Drive, and leave the stop to the executive."

    tag = "go"
    needs = drives = frozenset({"base"})

    def update(self) -> Status:
        self.robot.base.drive(Velocity(0.1, 0.0))
        return self.wait("going")
"""


def test_stop_of_a_leaf_without_terminate_is_an_event(tmp_path: Path) -> None:
    (tmp_path / "behaviours").mkdir()
    (tmp_path / "behaviours" / "go.py").write_text(GO, encoding="utf-8")
    mission = "mission: m\ntree: {go: , for: 2 s}\n"
    (case,) = cases(tmp_path, mission, "expect: {result: success, base: stopped, pose: {near: [20 cm, 0 m]}}")
    runner = CaseRunner(case, IN_PROCESS_LIMITS)
    runner.run()
    sent = [event.values for event in runner.history.events if isinstance(event, CommandSent) and event.to == "base"]
    assert sent == [{"linear": 0.1, "angular": 0.0}, {"linear": 0.0, "angular": 0.0}]
    assert not seen(play(case, limits=IN_PROCESS_LIMITS))


def test_case_is_reproducible_and_depends_on_its_seed(tmp_path: Path) -> None:
    mission = "mission: m\ntree: {random_sequence: [{say: A}, {say: B}, {say: C}, {say: D}]}\n"
    told = []
    for case in cases(tmp_path, mission, *(f"seed: {seed}, expect: {{result: success}}" for seed in (1, 1, 2))):
        stage = CaseRunner(case, IN_PROCESS_LIMITS)
        stage.run()
        told.append([event.as_dict() for event in stage.history.events])
    assert told[0] == told[1]
    assert told[0] != told[2]


def test_mission_fault_fails_a_case_and_an_internal_error_is_reported(tmp_path: Path) -> None:
    (case,) = cases(tmp_path, WAITS, "expect: {result: success}")
    Path(case.mission).unlink()
    verdict = play(case, limits=IN_PROCESS_LIMITS)
    assert not verdict.passed
    assert "Traceback" in verdict.error
    Path(case.mission).write_text("mission: m\ntree: nonsense\n", encoding="utf-8")
    assert seen(play(case, limits=IN_PROCESS_LIMITS)) == ["unknown behaviour 'nonsense'"]


def test_verdict_has_the_statuses_of_every_node(tmp_path: Path) -> None:
    mission = "mission: m\ntree:\n  selector:\n    - wait: 1 s\n      timeout: 500 ms\n    - say: Late\n    - fail\n"
    verdict = played(tmp_path, mission, "expect: {result: success}")
    told = {(node.key, node.kind, node.line): (dict(node.statuses), node.reasons) for node in verdict.nodes}
    assert told == {
        ("1", "selector", 3): ({"running": 1, "success": 1}, ()),
        ("1.1", "timeout", 5): ({"running": 1, "failure": 1}, ("wait timed out after 0.5 s",)),
        ("1.1.1", "wait", 4): ({"running": 1, "idle": 1}, ()),
        ("1.2", "say", 6): ({"running": 1, "success": 1}, ()),
        ("1.3", "fail", 7): ({}, ()),
    }
    assert {Path(node.file).name for node in verdict.nodes} == {"m.yaml"}


ROOMS = """\
mission: m
params: {rooms: [kitchen, hall]}
tree:
  sequence:
    - for_each:
        in: rooms
        as: room
        do:
          parallel: [{drive: 20 cm}, {say: "${room}"}, {wait: 1 s}]
          success_count: 2
          failure_count: all
          name: there
      name: round
    - reactive_switch: {on: base.bumper, cases: {true: {fail: bumped}}, default: {wait: 2 s}}
    - wait: 9 s
      on_running: succeed
"""


@pytest.mark.parametrize(
    "body",
    [
        "given: [{drive: fails}], expect: {result: success, ran: {round: 1, there: 2, say: 2, drive: 2}, within: 6 s}",
        "given: [{drive: fails}, {say: fails}], expect: {result: failure, reason: 'for_each kitchen: 2 of 3'}",
        'given: [{round: fails because "no way"}], expect: {result: failure, reason: no way, never_said: kitchen}',
        "given: [{drive: succeeds}, base bumped when wait starts for 3 s], expect: {result: failure, reason: bumped}",
        "params: {rooms: [cellar]}, expect: {result: success, said: [cellar]}",
        "params: {rooms: []}, expect: {result: success, said: [], ran: {round: 1}}",
    ],
)
def test_loops_counts_and_switches_are_tried_like_any_node(body: str, tmp_path: Path) -> None:
    assert seen(played(tmp_path, ROOMS, body)) == []


SKIPS = """\
mission: m
params: {polite: false}
tree:
  selector:
    - sequence:
        - say: One
          if: polite
        - sequence: [{say: Two, if: polite}, {say: Three, if: polite}]
          name: pair
      name: greeting
    - say: Four
      if: not polite
    - drive: 10 cm
"""


@pytest.mark.parametrize(
    ("body", "told"),
    [
        ("expect: {said: Four, ran: {say: 1, greeting: 0}, never_ran: [greeting, pair, drive]}", []),
        ("params: {polite: true}, expect: {said: [One, Two, Three], succeeded: [greeting, pair]}", []),
        ("params: {polite: true}, given: [{pair: fails}], expect: {said: One, failed: pair, succeeded: drive}", []),
        ("given: [{pair: succeeds}], expect: {said: [], ran: pair, never_ran: drive}", []),
        ("given: [{say: succeeds}], expect: {ran: {say: 1, pair: 0}}", []),
        ("expect: {succeeded: pair}", ["'pair' never ran"]),
        ("expect: {order: [greeting starts]}", ["it never happened"]),
    ],
)
def test_skipped_node_has_not_run(body: str, told: list[str], tmp_path: Path) -> None:
    assert seen(played(tmp_path, SKIPS, body)) == told


CONDITIONS = """mission: m
tree:
  sequence:
    - check: battery.percent > 120
    - wait_until: base.x > 2 m
    - wait_for: {face_seen: 1 s}
      name: wait for a face
    - wait: 1 h
      for: 2 s
"""


@pytest.mark.parametrize(
    "body",
    [
        "expect: {result: failure, reason: battery.percent is 100, failed: check}",
        "timeout: 3 s, given: [{check: succeeds}], expect: {result: running, ran: wait_until}",
        (
            "given: [{check: succeeds}, {wait_until: succeeds after 1 s}, {face_seen: 'fails twice, then succeeds'}], "
            "expect: {result: success, after: 3 s, ran: {face_seen: 3}, order: [wait starts, wait halts]}"
        ),
        "given: [{'*': succeeds}, {wait for a face: fails}], expect: {result: failure, never_ran: face_seen}",
    ],
)
def test_conditions_are_mocked_like_any_node(body: str, tmp_path: Path) -> None:
    assert seen(played(tmp_path, CONDITIONS, body)) == []


def test_two_leaves_that_drive_one_part_are_reported() -> None:
    bench = LeafTestBench()
    root = bench.put(DriveLeaf("root"), distance=1.0)
    other = bench.put(DriveLeaf("other"), distance=1.0)
    history = CaseHistory()
    history.attach(root)
    history._leaves.append(other)
    bench.tick(root)
    history(Ticked(1.0, 1, "running"))
    assert history.claim_conflict == "", "the other has not begun"
    bench.tick(other)
    history(Ticked(2.0, 2, "running"))
    assert history.claim_conflict == "at 2.00 s root and other both drive the base"


def test_lost_events_prevent_a_pass(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(CaseHistory, "_on_tick", lambda *_: 1 / 0)
    verdict = played(tmp_path, WAITS, "expect: {result: success}")
    assert "some events were lost: CaseHistory: division by zero" in verdict.error


def test_node_starts_before_its_children(tmp_path: Path) -> None:
    mission = "mission: m\ntree: {sequence: [{say: One}], name: talk}\n"
    order = '[talk starts, say starts, say "One", say succeeds, talk succeeds]'
    assert played(tmp_path, mission, f"expect: {{order: {order}}}").passed
    assert not played(tmp_path, mission, "expect: {order: [say starts, talk starts]}").passed


def test_failed_case_names_the_mock_above_nodes_and_mocks(tmp_path: Path) -> None:
    (tmp_path / "inner.yaml").write_text("mission: inner\ntree: {sequence: [{say: A, name: greet}, {nod: 1}]}\n")
    mission = "mission: m\ntree:\n  sequence: [{mission: inner}, {log: done}]\n"
    expect = "expect: {ran: [greet, log], succeeded: say}"
    told = [
        "'greet' never ran: 'inner' is mocked by '*'",
        "'say' never ran: 'inner' is mocked by '*'",
        "the mock of 'nod' is not used: 'inner' is mocked by '*'",
    ]
    assert sorted(seen(played(tmp_path, mission, f"given: [{{'*': succeeds, nod: fails}}], {expect}"))) == told
    assert seen(played(tmp_path, mission, "given: [{'*': succeeds, nod: fails}], expect: {ran: log}")) == []
    assert seen(played(tmp_path, mission, f"given: [nod: succeeds], {expect}")) == []


def test_mock_of_stubs_replaces_all_stubs_without_a_mock_of_their_own(tmp_path: Path) -> None:
    (tmp_path / "behaviours").mkdir()
    leaf = "class {0}(Leaf):\n    tag = '{1}'\n    stub = 'write it'\n"
    stubs = "from behaviours.leaf import Leaf\n\n\n" + leaf.format("Grasp", "grasp") + leaf.format("Turn", "place_it")
    (tmp_path / "behaviours" / "own.py").write_text(stubs)
    mission = "mission: m\ntree:\n  selector: [grasp, {sequence: [{say: Hi}, place_it]}]\n"
    expect = "expect: {result: success, said: Hi, failed: grasp, succeeded: place_it}"
    assert seen(played(tmp_path, mission, f"given: [{{stubs: succeeds, grasp: fails}}], {expect}")) == []
