"""Claims and needs: what can drive one actuator twice, and what the robot does not have."""

from pathlib import Path

import pytest

from behaviours.catalogue import LEAVES
from config.diagnostics import Diagnostic, InvalidFileError, SourceText
from config.library import find_file
from missions.language.claims import TargetRobot, impossible_alternatives
from missions.language.document import check_plan
from missions.language.plan import Plan
from missions.library.drivers import load_robot
from missions.library.lookups import LOOKUPS
from missions.library.target import target_of

GREET = (Path(__file__).parents[2] / "missions" / "greet.yaml").read_text(encoding="utf-8")
WHOLE = frozenset({"base", "head", "arm", "camera", "voice"})


def check(tree: str, parts: frozenset[str] = WHOLE) -> Plan:
    text = tree if tree.startswith("#") else f"mission: m\ntree:\n{tree}"
    return check_plan(SourceText("m.yaml", text), LEAVES, LOOKUPS, robot=TargetRobot("r2", parts))


def faults(tree: str, parts: frozenset[str] = WHOLE) -> list[Diagnostic]:
    with pytest.raises(InvalidFileError) as caught:
        check(tree, parts)
    return list(caught.value.diagnostics)


def the_fault(tree: str, parts: frozenset[str] = WHOLE) -> Diagnostic:
    (fault,) = faults(tree, parts)
    return fault


@pytest.mark.parametrize("together", ["parallel", "race"])
def test_claim_conflict_is_reported_with_both_lines(together: str) -> None:
    fault = the_fault(f"  {together}:\n    - drive: 1 m\n    - say: Hi\n    - turn: 9 deg\n")
    assert fault.message == "'turn' and 'drive' (line 4) can both drive the base at the same time"
    assert (fault.mark.line, fault.mark.column, fault.mark.length) == (6, 7, 4)
    assert fault.suggestion == "put one after the other in a sequence"


def test_the_claims_of_whole_branches_count() -> None:
    fault = the_fault(
        "  race:\n"
        "    - sequence:\n        - wait: 1 s\n        - look: 9 deg\n          timeout: 2 s\n"
        "    - selector:\n        - fail\n        - say: Hi\n        - track_face\n"
    )
    assert fault.message == "'track_face' and 'look' (line 6) can both drive the head at the same time"
    assert fault.mark.line == 11


def test_recovery_may_drive_what_its_node_drives_and_both_claim_it_from_others() -> None:
    node = "    - drive: 1 m\n      retry: 2\n      recover: {turn: 9 deg}\n"
    assert check(f"  sequence:\n{node}").tree.claims == {"base"}
    fault = the_fault(f"  parallel:\n{node}    - look: 9 deg\n      retry: 2\n      recover: {{stop: }}\n")
    assert fault.message == "'stop' and 'drive' (line 4) can both drive the base at the same time"


def test_cleanup_claims_its_parts_while_its_node_runs() -> None:
    fault = the_fault("  parallel:\n    - say: Hi\n    - drive: 1 m\n      finally: {say: Done}\n")
    assert fault.message == "'say' and 'say' (line 4) can both drive the voice at the same time"


def test_recovery_and_cleanup_need_their_parts() -> None:
    found = faults(
        "  sequence:\n    - drive: 1 m\n      retry: 2\n      recover: {look: 9 deg}\n      finally: {say: Done}\n",
        frozenset({"base"}),
    )
    assert [fault.message.split(";")[0] for fault in found] == ["'look' needs a head", "'say' needs a voice"]


def test_missing_part_of_a_recovery_is_no_alternative_of_a_selector() -> None:
    tree = "  selector:\n    - drive: 1 m\n      retry: 2\n      recover: {look: 9 deg}\n    - say: Hi\n"
    assert the_fault(tree, frozenset({"base", "voice"})).message.startswith("'look' needs a head")


def test_claim_conflicts_are_reported_for_every_part_and_claimant() -> None:
    found = faults("  parallel:\n    - track_face\n    - look: 9 deg\n    - drive: 1 m\n    - find_face\n")
    assert [(fault.mark.line, fault.message) for fault in found] == [
        (5, "'look' and 'track_face' (line 4) can both drive the head at the same time"),
        (6, "'drive' and 'track_face' (line 4) can both drive the base at the same time"),
        (7, "'find_face' and 'track_face' (line 4) can both drive the head at the same time"),
    ]


@pytest.mark.parametrize("apart", ["sequence", "selector", "reactive_sequence", "reactive_selector"])
def test_leaves_that_never_run_together_may_share_a_part(apart: str) -> None:
    plan = check(f"  {apart}:\n    - drive: 1 m\n    - turn: 9 deg\n")
    assert plan.tree.claims == {"base"}


def test_conflicts_within_a_branch_of_a_branch_are_found_once() -> None:
    fault = the_fault(
        "  parallel:\n    - wait: 1 s\n    - sequence:\n        - race:\n            - say: a\n            - say: b\n"
    )
    assert (fault.mark.line, fault.message) == (8, "'say' and 'say' (line 7) can both drive the voice at the same time")


@pytest.mark.parametrize(
    ("leaf", "part", "message"),
    [
        ("gesture: hello", "arm", "'gesture' needs an arm; robot 'r2' has none (it has base, camera, head, voice)"),
        ("say: Hi", "voice", "'say' needs a voice; robot 'r2' has none (it has arm, base, camera, head)"),
        ("drive: 1 m", "base", "'drive' needs a base; robot 'r2' has none (it has arm, camera, head, voice)"),
        ("look: 9 deg", "head", "'look' needs a head; robot 'r2' has none (it has arm, base, camera, voice)"),
        ("face_seen: 1 s", "camera", "'face_seen' needs a camera; robot 'r2' has none (it has arm, base, head, voice)"),
    ],
)
def test_missing_part_is_reported_at_the_leaf(leaf: str, part: str, message: str) -> None:
    tree = f"  selector:\n    - succeed\n    - {leaf}\n      invert: true\n"
    check(tree)
    fault = the_fault(tree, WHOLE - {part})
    assert fault.message == message
    assert (fault.mark.line, fault.mark.length) == (5, len(leaf.partition(":")[0]))


def test_missing_voice_of_a_robot_without_parts_is_reported() -> None:
    fault = the_fault("  say: Hi\n", frozenset())
    assert fault.message == "'say' needs a voice; robot 'r2' has none (it has nothing)"


def test_a_face_can_be_tracked_without_a_base() -> None:
    assert check("  track_face\n", frozenset({"camera", "head"})).tree.needs == {"camera", "head"}


def test_all_missing_parts_are_reported_for_greet_on_a_bare_base() -> None:
    found = faults(GREET, frozenset({"base"}))
    assert [(fault.mark.line, fault.message.partition(";")[0]) for fault in found] == [
        (12, "'find_face' needs a camera"),
        (12, "'find_face' needs a head"),
        (15, "'track_face' needs a camera"),
        (15, "'track_face' needs a head"),
        (17, "'face_centred' needs a camera"),
        (22, "'track_face' needs a camera"),
        (24, "'nod' needs a head"),
        (25, "'say' needs a voice"),
    ]


def test_without_a_robot_only_conflicts_are_mistakes() -> None:
    text = SourceText("m.yaml", "mission: m\ntree:\n  gesture: hello\n")
    assert check_plan(text, LEAVES, LOOKUPS).tree.needs == {"arm"}


NECKED = target_of(load_robot(find_file("robots", "humanoid")))


def necked(*children: str) -> list[str]:
    text = "mission: m\ntree:\n  parallel:\n" + "".join(f"    - {child}\n" for child in children)
    try:
        check_plan(SourceText("m.yaml", text), LEAVES, LOOKUPS, robot=NECKED)
    except InvalidFileError as error:
        return [fault.message for fault in error.diagnostics]
    return []


def test_neck_joint_conflicts_with_a_leaf_that_turns_the_head() -> None:
    moved = "moves joint 'neck_pan' of the head, which 'look' (line 4) can turn at the same time"
    assert necked("look: 9 deg", "sweep: {joints: [neck_pan], between: [-9 deg, 9 deg]}") == [f"'sweep' {moved}"]
    assert necked("look: 9 deg", "move_joints: {to: {neck_pan: 9 deg}}") == [f"'move_joints' {moved}"]


def test_other_joints_do_not_conflict_with_the_head() -> None:
    assert necked("look: 9 deg", "move_joints: {to: {left_elbow: 9 deg}}") == []
    assert necked("wait: 1 s", "move_joints: {to: {neck_pan: 9 deg}}") == []


# --- optional capabilities of a base ----------------------------------------------------------------------------------

NEEDING = {
    "sounds": ["sound: error", "sound: {tone: 440 Hz}"],
    "lights": ["led: green"],
    "legs": ["stand", "sit", "play_gait: in_place"],
}
ROBOTS = {
    "turtlebot2": {"sounds", "lights"},
    "turtlebot2_arm": {"sounds", "lights"},
    "turtlebot3": set[str](),
    "turtlebot4": {"sounds", "lights"},
    "pi_car": set[str](),
    "wave_rover": set[str](),
    "humanoid": {"legs"},
}


@pytest.mark.parametrize("robot", ROBOTS)
@pytest.mark.parametrize(("capability", "leaf"), [(name, leaf) for name, leaves in NEEDING.items() for leaf in leaves])
def test_leaf_is_refused_on_a_base_without_its_capability(robot: str, capability: str, leaf: str) -> None:
    target = target_of(load_robot(find_file("robots", robot)))
    text = SourceText("m.yaml", f"mission: m\ntree:\n  sequence:\n    - {leaf}\n")
    if capability in ROBOTS[robot]:
        check_plan(text, LEAVES, LOOKUPS, robot=target)
        return
    with pytest.raises(InvalidFileError) as caught:
        check_plan(text, LEAVES, LOOKUPS, robot=target)
    (fault,) = caught.value.diagnostics
    word = leaf.partition(":")[0]
    assert fault.message == f"'{word}' needs {capability}: robot '{robot}' has no {capability}"


def test_missing_base_is_reported_instead_of_its_capability() -> None:
    assert "needs a base" in the_fault("  sound: error\n", frozenset({"head"})).message


def test_selector_child_without_capability_is_a_hint() -> None:
    target = target_of(load_robot(find_file("robots", "pi_car")))
    text = SourceText("m.yaml", "mission: m\ntree:\n  selector:\n    - sound: error\n    - wait: 1 s\n")
    plan = check_plan(text, LEAVES, LOOKUPS, robot=target)
    (hint,) = impossible_alternatives(plan.tree, target, LOOKUPS)
    assert hint.message == "'sound' cannot be done by robot 'pi_car': it has no sounds"
