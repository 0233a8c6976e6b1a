"""What the model checker concludes: time, counts, conditions, halts, endless missions, and where it gives up."""

import pytest
from py_trees.common import Status

from behaviours.leaf import RUNNING, Leaf
from drivers.clock import ManualClock
from missions.plugins.verify.explore import PROVED, REFUTED, UNDECIDED
from missions.plugins.verify.verdicts import verify
from tests.missions.testing.verify.exploring import explored, outcome, outcomes, plan_of

CAN_END = "it can end from every state"


# Time: what can be over before what


def test_the_longer_of_two_timeouts_around_one_node_never_passes() -> None:
    tree = """
selector:
  - selector:
      - pretend: running
        timeout: 5 s
      - say: the inner one
    timeout: 6 s
  - say: the outer one
"""
    assert outcome(tree, "always eventually: say") == PROVED


def test_consecutive_timeouts_add_up() -> None:
    tree = """
selector:
  - pretend: running
    timeout: 3 s
  - pretend: running
    timeout: 3 s
  - say: too late
timeout: 5 s
"""
    found = explored(tree)
    assert [finding.fault.mark.line for finding in found.verdicts[1].findings] == [9]
    assert (
        outcomes(explored(tree.replace("timeout: 5 s", "timeout: 7 s")))["each of its 7 nodes can be reached"] == PROVED
    )


def test_how_long_a_wait_takes_is_known() -> None:
    for tree in ("wait: 10 s\ntimeout: 5 s", "sequence: [{wait: 3 s}, {wait: 3 s}]\ntimeout: 5 s"):
        found = explored(tree, "can: succeed", "can: fail")
        assert outcomes(found)["can: succeed"] == REFUTED
        assert outcomes(found)["can: fail"] == PROVED
    assert outcome("wait: 5 s\ntimeout: 10 s", "can: fail") == PROVED  # where a tick comes late
    assert outcome("sequence: [{wait: 4 s}, {drive: 1 m}]\ntimeout: 5 s", "can: succeed") == PROVED
    unknown = "sequence: [{set: {a: 10 s}}, {wait: '${a}'}]\ntimeout: 5 s"
    assert outcome(unknown, "can: succeed") == PROVED


def test_unreachable_timeout_or_wait_is_found_with_its_cause() -> None:
    never = {
        "wait: 10 s\ntimeout: 5 s": "the 'timeout' of 5 s around it (line 5) is over first",
        "race:\n  - say: a\n    timeout: 9 s\ntimeout: 5 s": "the 'timeout' of 5 s around it (line 7) is over first",
        "sequence:\n  - log: a\ntimeout: 5 s": "'sequence' has always ended before",
        "sequence:\n  - wait: 3 s\n  - wait: 3 s\ntimeout: 5 s": "the 'timeout' around it (line 7) leaves it no time",
        "face_seen: 1 s\nhold: 3 s\ntimeout: 2 s": "the 'timeout' of 2 s around it (line 6) is over first",
    }
    for tree, why in never.items():
        (verdict,) = (each for each in explored(tree).verdicts if each.rule.endswith("can be over"))
        assert [finding.fault.suggestion for finding in verdict.findings] == [why], tree
    assert explored("race:\n  - drive: 1 m\n    timeout: 9 s\nretry: 2\ntimeout: 10 s").outcome == PROVED


def test_timeout_may_or_may_not_expire_while_a_leaf_runs() -> None:
    tree = "sequence: [{look: 0 deg}, {say: Hi, name: greet}]\ntimeout: 1 s"
    assert outcome(tree, "can: succeed") == PROVED
    assert outcome(tree, "can: fail") == PROVED


def test_cooldown_fails_until_it_expires() -> None:
    tree = "log: beat\ncooldown: 10 s\nrepeat: 2"
    assert outcome(tree, "can: fail") == PROVED
    assert outcome(tree, "can: succeed") == PROVED


def test_hold_needs_its_duration() -> None:
    assert outcome("face_centred: 5 deg\nhold: 2 s\ntimeout: 3 s", "can: succeed") == PROVED
    assert outcome("face_centred: 5 deg\nhold: 3 s\ntimeout: 2 s", "can: succeed") == REFUTED


def test_many_short_times_in_a_long_one_do_not_fill_the_memory() -> None:
    found = explored("sequence:\n  - pretend: running\n    timeout: 100 ms\n    retry: forever\ntimeout: 600 s")
    assert found.outcome == PROVED
    assert found.states < 100


# Counts, orders and conditions


@pytest.mark.parametrize("count", [1, 2, 3, 4, 50, 1000])
def test_repeat_with_a_large_count_is_explored(count: int) -> None:
    found = explored(f"drive: 1 m\nrepeat: {count}", "can: succeed")
    assert found.outcome == PROVED
    assert found.states < 20


@pytest.mark.parametrize("rounds", ["repeat: 50", "for_each"])
def test_node_of_the_third_of_many_rounds_is_reached(rounds: str) -> None:
    step = "sequence: [{set: {n: '${n + 1}'}}, {drive: 1 m, if: n == 3}]"
    each = f"for_each: {{in: {list(range(12))}, as: x, do: {{{step}}}}}"
    tree = f"sequence: [{{set: {{n: 0}}}}, {{{each if rounds == 'for_each' else f'{step}, {rounds}'}}}]"
    assert outcome(tree, "can: fail") == PROVED


@pytest.mark.parametrize(("members", "expected"), [(10, PROVED), (11, REFUTED)])
def test_members_of_a_list_are_known_up_to_ten(members: int, expected: str) -> None:
    loop = f"for_each: {{in: {list(range(members))}, as: x, do: {{check: x < {members}}}}}"
    tree = f"sequence: [{{selector: [{{{loop}}}, {{drive: 1 m}}]}}, {{say: Hi}}]"
    assert outcome(tree, "never: drive before say") == expected


def test_a_third_attempt_is_the_last_of_three() -> None:
    found = explored("drive: 1 m\nretry: 3", "can: fail")
    assert found.depth == 3


@pytest.mark.parametrize("kind", ["random_sequence", "random_selector"])
def test_every_order_of_a_random_composite_is_tried(kind: str) -> None:
    tree = f"{kind}: [{{look: 0 deg}}, {{say: Hi}}, {{drive: 1 m}}]"
    for first in ("look", "say", "drive"):
        for second in {"look", "say", "drive"} - {first}:
            assert outcome(tree, f"never: {first} after {second}") == (REFUTED if kind == "random_sequence" else PROVED)


def test_a_random_composite_with_many_children_proves_nothing() -> None:
    tree = "random_sequence: [look: 0 deg, say: a, drive: 1 m, log: b, wait: 1 s, stop]"
    tree = tree.replace("[", "[{").replace(", ", "}, {").replace("]", "}]").replace("{stop}", "stop")
    found = explored(tree)
    assert found.outcome == UNDECIDED
    assert "order" in found.left_out


def test_a_condition_on_the_robot_may_be_true_or_false_at_every_tick() -> None:
    found = explored("drive: 1 m\nwhile: battery.percent > 20", "can: succeed", "can: fail")
    assert found.outcome == PROVED


def test_condition_decided_by_params_has_one_outcome() -> None:
    found = explored("sequence: [{say: a}, {drive: 1 m, if: 1 > 2}]")
    (finding,) = found.verdicts[1].findings
    assert finding.fault.message == "'drive' is never reached"
    assert finding.fault.suggestion == "'if' (line 4): its condition is never true"


def test_found_values_are_unknown_and_constants_are_calculated() -> None:
    stored = "sequence: [{face_seen: 1 s, as: who}, {say: far, if: who.distance > 2 m}, {log: b, if: who.id == 1}]"
    assert explored(stored).outcome == PROVED
    counted = "sequence: [{set: {n: 1}}, {set: {n: '${n + 1}'}}, {say: two, if: n == 2}, {drive: 1 m, if: n == 3}]"
    found = explored(counted)
    assert [finding.fault.message for finding in found.verdicts[1].findings] == ["'drive' is never reached"]


def test_endless_counter_is_explored() -> None:
    tree = "sequence:\n  - set: {n: 0}\n  - set: {n: '${n + 1}'}\n    repeat: forever\n    until: face.seen"
    assert explored(tree).outcome == PROVED


def test_expression_that_cannot_be_calculated_may_fail() -> None:
    assert outcome("say: Hi\nif: base.x > 1 m", "can: fail") == PROVED
    tree = "sequence: [{log: a, if: base.x > 1 m}]\n"
    assert outcome(tree, "can: fail") == PROVED
    assert outcome(tree.replace("base.x > 1 m", "base.stopped"), "can: fail") == REFUTED


def test_silent_sensor_may_fail_the_mission() -> None:
    assert outcome("sequence: [{log: a, if: face.seen}]\n", "can: fail") == PROVED
    assert outcome("sequence: [face_seen]\non_failure: succeed\n", "can: fail") == REFUTED


# Endless missions


def test_endless_mission_is_no_fault() -> None:
    found = explored("sequence: [{drive: 1 m, on_failure: succeed}, {wait: 1 s}]\nrepeat: forever")
    assert found.outcome == PROVED
    assert found.verdicts[0].rule == "it runs until it is stopped"


def test_endless_mission_with_a_trap_is_refuted() -> None:
    found = explored("sequence: [{wait: 1 s}, {pretend: running}]\nrepeat: forever")
    assert found.verdicts[0].outcome == REFUTED
    assert found.verdicts[0].findings[0].fault.message.endswith("'pretend' goes on for ever")


# Halts


class Careful(Leaf):
    """Take a while to stop.

    Running until it succeeds.
    """

    tag = "careful"
    drives = frozenset({"base"})

    _left = 0

    def halting(self) -> bool:
        self._left -= 1
        return self._left > 0

    def terminate(self, new_status: Status) -> None:
        del new_status
        self.robot.base.stop()

    def update(self) -> Status:
        return RUNNING


@pytest.mark.parametrize("name", ["find_person", "seek"])
def test_named_mission_keeps_the_name_of_its_file(name: str) -> None:
    mission = "{mission: find_person, name: seek}"
    assert outcome(f"sequence: [{mission}, {{say: Hi}}]", f"never: say before {name}") == PROVED
    assert outcome(f"selector: [{mission}, {{say: Hi}}]", f"never: say before {name}") == REFUTED


def test_slowly_stopping_leaf_is_awaited_before_another_drives() -> None:
    tree = """
reactive_selector:
  - sequence:
      - face_seen
      - drive: 1 m
  - careful
"""
    found = explored(tree, "never: drive while careful", leaves=[Careful])
    assert found.outcome == PROVED
    assert found.states > 8


class Restless(Careful):
    """Never stop to stop."""

    tag = "restless"

    def halting(self) -> bool:
        return True


def test_leaf_that_never_rests_after_a_halt_is_found() -> None:
    tree = "selector:\n  - restless\n  - careful\n"
    found = explored(tree, leaves=[Careful, Restless])
    (finding,) = (each for verdict in found.verdicts for each in verdict.findings)
    assert finding.fault.mark.line == 5
    assert finding.fault.message.startswith("after a halt, 'restless' never comes to rest")
    assert finding.fault.suggestion == "its actuators are stopped for it after 1 s"
    assert explored("careful", leaves=[Careful]).outcome == PROVED


# Variables that are read before they are set


SETS = "every variable is set when it is read"


def test_run_that_reads_an_unset_variable_is_shown() -> None:
    tree = "parallel:\n  - find_face: {}\n    as: who\n  - sequence: [{wait: 1 s}, {say: 'It is ${who.id}'}]"
    found = explored(tree)
    (finding,) = (each for verdict in found.verdicts for each in verdict.findings)
    assert finding.fault.message == "'who' is read here, but nothing has set it"
    assert finding.run is not None
    assert len(finding.run) == 2
    assert outcomes(found)[SETS] == REFUTED


def test_guarded_or_tolerated_read_of_an_unset_variable_is_no_fault() -> None:
    flag = "{set: {ok: false}}, {sequence: [{find_face: {}, as: who}, {set: {ok: true}}], on_failure: succeed}"
    found = explored(f"sequence: [{flag}, {{say: '${{who.id}}', if: ok}}]")
    assert outcomes(found)[SETS] == PROVED
    tree = "sequence: [{find_face: {}, as: who, on_failure: succeed}, {selector: [{say: '${who.id}'}, {say: Hello}]}]"
    assert SETS not in outcomes(explored(tree))


# Properties that hold


@pytest.mark.parametrize(
    ("tree", "promise"),
    [
        ("sequence: [{drive: 1 m}, {gesture: hello}]", "never: gesture while drive"),
        ("sequence: [{drive: 1 m}, {gesture: hello}]", "never: gesture before drive"),
        ("sequence: [{drive: 1 m}, {gesture: hello}]", "never: drive after gesture"),
        ("sequence: [{drive: 1 m}, {gesture: hello}]", "never: base while arm"),
        ("race: [{track_face: {}}, {sequence: [{gesture: hello}, {say: Hi}]}]", "never: say without track_face"),
        ("sequence: [{drive: 1 m}, {wait: 1 s}]\nrepeat: forever", "always eventually: base stopped"),
        ("sequence: [{say: Hi}, {drive: 1 m}]", "always eventually: say"),
        ("parallel: [{say: Hi}, {drive: 1 m}]", "never: say after say"),
        ("sequence: [{drive: 1 m, name: go on}, {say: Hi}]", "never: say before go on"),
    ],
)
def test_true_property_is_proved(tree: str, promise: str) -> None:
    assert outcome(tree, promise) == PROVED


BREAK = "sequence: [{{{}, name: break}}, {{say: Hi}}]"


@pytest.mark.parametrize(
    ("node", "before"),
    [
        ("velocity: {speed: 0.1 m/s}, for: 3 s", PROVED),
        ("wait: 10 s, until: base.bumper", PROVED),
        ("sequence: [{nod: 1}, {drive: 1 m}], repeat: forever, until: base.bumper", PROVED),
        ("sequence: [{nod: 1}, {drive: 1 m}], repeat: forever, for: 1 min, on_failure: succeed", REFUTED),
        ("drive: 1 m, retry: 3, timeout: 1 min", PROVED),
        ("face_seen: 1 s, hold: 2 s", PROVED),
        ("drive: 1 m, finally: {log: over}", PROVED),
        ("wait_for: {face_seen: 1 s}", PROVED),
        ("drive: 1 m, on_failure: succeed", REFUTED),
        ("drive: 1 m, on_failure: succeed, for: 1 min", REFUTED),
        ("drive: 1 m, invert: true", REFUTED),
        ("drive: 1 m, on_running: succeed", REFUTED),
        ("drive: 1 m, if: base.bumper", REFUTED),
        ("selector: [{drive: 1 m, if: base.bumper}, {nod: 1, if: base.bumper}]", REFUTED),
    ],
)
def test_node_has_succeeded_when_it_is_over_with_its_modifiers(node: str, before: str) -> None:
    assert outcome(BREAK.format(node), "never: say before break") == before


def test_time_limit_outside_a_changed_result_ends_a_node() -> None:
    tree = "sequence: [{velocity: {speed: 0.1 m/s}, on_failure: succeed, for: 1 min, name: break}, {say: Hi}]"
    assert outcome(tree, "never: say after break") == REFUTED


def test_rounds_of_an_endless_repeat_count_unless_something_ends_it() -> None:
    rounds = (
        "parallel: [{{sequence: [{{nod: 1}}, {{log: a}}], {}, name: dance}}, {{sequence: [{{wait: 2 s}}, {{say: a}}]}}]"
    )
    assert outcome(rounds.format("repeat: forever"), "never: say after dance") == REFUTED
    assert outcome(rounds.format("repeat: forever"), "never: nod after dance") == REFUTED
    assert outcome(rounds.format("repeat: forever, for: 9 s"), "never: nod after dance") == PROVED
    assert outcome(rounds.format("repeat: 3"), "never: nod after dance") == PROVED
    assert outcome(rounds.format("repeat: 3"), "never: say after dance") == REFUTED


GUARDED = """
reactive_selector:
  - sequence:
      - {}
      - turn: 30 deg
    name: attack
  - wait: 2 s
    name: idle
repeat: forever
"""


@pytest.mark.parametrize("guard", ["bumped", "check: base.bumper", "wait: 1 s\n        on_running: succeed"])
def test_conditions_of_a_node_do_not_count_as_its_run(guard: str) -> None:
    tree = GUARDED.format(guard)
    assert outcome(tree, "never: idle while attack") == PROVED
    assert outcome(tree, f"never: idle while {guard.partition(':')[0]}") == REFUTED
    assert outcome(tree, "never: attack before idle") == REFUTED
    only_acts = "sequence: [{selector: [{sequence: [bumped, {turn: 30 deg}], name: attack}, {say: a}]}, {drive: 1 m}]"
    assert outcome(only_acts, "always eventually: attack") == REFUTED
    assert outcome(only_acts, "always eventually: bumped") == PROVED


def test_node_of_conditions_alone_stands_for_them() -> None:
    tree = "reactive_selector: [{sequence: [bumped, {check: base.cliff}], name: danger}, {drive: 1 m}]"
    assert outcome(tree, "never: danger while drive") == REFUTED


def test_reactive_node_never_overlaps_with_a_halted_one() -> None:
    tree = "reactive_selector:\n  - sequence: [face_seen, {say: Hi}]\n  - drive: 1 m\n"
    assert outcome(tree, "never: say while drive") == PROVED
    assert outcome(tree, "never: say after drive") == PROVED  # a drive that has succeeded ends the whole
    assert outcome(tree, "always eventually: say") == REFUTED


# Bounds


class Hasty(ManualClock):
    """A clock that is a second later each time that it is asked."""

    def now(self) -> float:
        return self.advance(1.0)


def test_exploration_beyond_the_time_limit_reports_partial_results() -> None:
    plan = plan_of("sequence: [{drive: 1 m}, {turn: 90 deg}, {say: Hi}]\nrepeat: 3", "never: say while drive")
    found = verify(plan, Hasty(), limit=12.0)
    assert found.outcome == UNDECIDED
    assert "after 12 s" in found.left_out
    assert "try --limit '120 s'" in found.left_out
    said = {verdict.rule: verdict.so_far for verdict in found.verdicts}
    assert said["never: say while drive"] == "true of all runs of up to 1 tick"
    assert said[CAN_END].startswith("true of ")
    assert verify(plan, Hasty(), limit=1e6).outcome == PROVED


def test_too_small_bound_is_undecided() -> None:
    tree = "sequence: [{drive: 1 m}, {turn: 90 deg}, {say: Hi}]\nrepeat: 3"
    found = explored(tree, "never: say while drive", "can: succeed", bound=2)
    assert found.outcome == UNDECIDED
    assert outcomes(found)[CAN_END] == UNDECIDED
    assert outcomes(found)["never: say while drive"] == UNDECIDED
    assert "try --bound 20" in found.left_out
    assert "not fully explored" in str(found)


def test_many_leaves_at_once_do_not_take_for_ever() -> None:
    many = ", ".join("{scene_uniform: 1 s, retry: 2}" for _ in range(12))
    found = explored(f"parallel: [{many}]", bound=10)
    assert found.outcome == UNDECIDED
    assert found.transitions < 400
    assert found.states <= 11


def test_a_fault_within_the_bound_is_refuted_even_where_the_rest_is_not_explored() -> None:
    found = explored("parallel: [{drive: 1 m}, {gesture: hello}]\nrepeat: 3", "never: gesture while drive", bound=4)
    assert outcomes(found)["never: gesture while drive"] == REFUTED
    assert outcomes(found)[CAN_END] == UNDECIDED


# Silent sensors


def test_silent_sensor_suspends_a_whole_reactive_composite() -> None:
    tree = "reactive_sequence: [{face_seen: 1 s, on_failure: succeed}, {say: Hi}]"
    report = str(explored(tree, "always eventually: say"))
    assert "1. the camera does not report -> " in report
    assert "reactive_sequence (line 4) suspended" in report
    assert "5 s are over" in report


def many_times(limit: str) -> str:
    """Return a tree with many orders of times, all of them with 21 s at least before ``say``."""
    stages = ((1, 1.1, 1.3), (3, 3.2, 3.7), (5, 5.4, 6.1), (12, 12.5))
    waits = [", ".join(f"{{wait: {seconds} s}}" for seconds in stage) for stage in stages]
    steps = ", ".join(f"{{random_selector: [{each}]}}" for each in waits)
    return f"sequence: [{steps}, {{say: Hi}}]\ntimeout: {limit}"


def test_run_that_only_coarser_times_allow_is_not_shown() -> None:
    report = explored(many_times("20 s"), "never: say after wait", "can: succeed")
    found = outcomes(report)
    assert found["never: say after wait"] == found["can: succeed"] == UNDECIDED
    assert "each of its 18 nodes can be reached" in [v.rule for v in report.verdicts if v.outcome == UNDECIDED]
    assert "whose times are impossible" in report.left_out


def test_possible_run_among_many_times_is_shown() -> None:
    report = explored(many_times("22 s"), "never: say after wait", "can: succeed")
    found = outcomes(report)
    assert (found["never: say after wait"], found["can: succeed"]) == (REFUTED, PROVED)
    assert not report.left_out


# Conditions that wait for a variable, and params of the caller


def test_wait_for_a_variable_that_is_set_later_goes_on() -> None:
    trees = (
        "parallel: [{sequence: [{wait: 1 s}, {set: {arrived: true}}]}, {sequence: [{wait_until: arrived}, {say: hi}]}]",
        "parallel: [{drive: 50 cm, as: gone}, {sequence: [{wait_until: gone > 10 cm}, {say: hi}]}]",
    )
    for tree in trees:
        assert explored(tree, "can: succeed").outcome == PROVED, tree


def test_wait_for_a_variable_that_never_becomes_true_goes_on_for_ever() -> None:
    tree = "parallel: [{wait_until: arrived}, {sequence: [{wait: 1 s}, {set: {arrived: false}}]}]"
    assert outcomes(explored(tree))[CAN_END] == REFUTED


def test_wait_for_a_position_may_fail() -> None:
    assert outcome("wait_until: base.x > 1 m\non_failure: succeed", "can: succeed") == PROVED
    for condition in ("base.x > 1 m", "base.x == 1 m"):  # a base may not measure its position
        tree = f"sequence: [{{selector: [{{wait_until: {condition}}}, {{drive: 1 m}}]}}, {{say: hi}}]"
        assert outcome(tree, "always eventually: drive") == REFUTED
        assert outcome(tree, "never: drive before say") == REFUTED


def test_param_without_a_value_that_is_set_again_is_known_from_the_start() -> None:
    tree = "sequence: [{set: {n: '${n + 1}'}}, {log: '${n}'}, {drive: 1 m, if: n > 2}]"
    report = verify(plan_of(tree, params="{n: {type: count}}"), ManualClock())
    assert report.outcome == PROVED


@pytest.mark.parametrize("weights", ["[1, 0]", "'${w}'"])
def test_child_of_the_weight_zero_need_not_be_reached(weights: str) -> None:
    tree = f"random_selector: [{{look: 0 deg}}, {{say: Hi, timeout: 9 s}}]\nweights: {weights}"
    report = verify(plan_of(tree, params="{w: [1, 0]}"), ManualClock())
    assert report.outcome == PROVED
    assert outcomes(report)["each of its 2 nodes can be reached"] == PROVED


@pytest.mark.parametrize(("weights", "shown"), [("[n, n + 1]", "look"), ("[n, 1]", "look, say"), ("[1, 0]", "")])
def test_trace_names_the_children_with_a_weight(weights: str, shown: str) -> None:
    tree = f"random_selector: [{{look: 0 deg}}, {{say: Hi}}]\nweights: '${{{weights}}}'"
    report = verify(plan_of(tree, "never: look before say", params="{n: {type: number}}"), ManualClock())
    (finding,) = report.verdicts[-1].findings
    choice = f"'${{{weights}}}' is above 0 for {shown}"
    assert finding.run is not None
    assert (choice in finding.run[0].choices) == bool(shown)
