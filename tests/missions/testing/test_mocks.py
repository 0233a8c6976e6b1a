"""Mocks, ticked by hand: they follow their scripts, claim what they stand for, and keep what they are told to."""

from dataclasses import replace

import pytest
from py_trees.common import Status

from behaviours.basics import Set, Wait
from behaviours.keyframe_playback import GestureLeaf
from behaviours.leaf import FAILURE, RUNNING, SUCCESS, Leaf
from behaviours.sight import FindFace
from config.diagnostics import Diagnostic, Mark, SourceText
from config.yaml_nodes import Scalar
from missions.language.expressions import Value
from missions.language.plan import Step
from missions.plugins.testing.mocks import MockSpec, MockSubstitution, matches_step, read_script
from missions.plugins.testing.phrases import Phrase
from missions.plugins.testing.recorders import LeafTestBench
from perception.api import Face


@pytest.fixture
def bench() -> LeafTestBench:
    return LeafTestBench()


def spec(target: str, text: str, result: dict[str, object] | None = None) -> MockSpec:
    faults: list[Diagnostic] = []
    script = read_script(Phrase(SourceText("a", text), Scalar(Mark(), text, text), faults))
    assert not faults
    return MockSpec(target, tuple(replace(turn, result=result) for turn in script))


def step(leaf: type[Leaf], name: str = "") -> Step:
    return Step(leaf.tag, name or leaf.tag, Mark(), SourceText("a", ""), leaf=leaf)


def cast_for(cast: MockSubstitution, for_step: Step, leaf: Leaf) -> Leaf:
    """Return what stands in the place of a leaf."""
    found = cast(for_step, leaf)
    assert found is not None
    return found


def mocked(
    bench: LeafTestBench, text: str, leaf: type[Leaf] = GestureLeaf, result: dict[str, object] | None = None
) -> Leaf:
    stand_in = cast_for(MockSubstitution([spec(leaf.tag, text, result)]), step(leaf), leaf(leaf.tag))
    assert type(stand_in) is not leaf
    return bench.put(stand_in)


def outcomes(bench: LeafTestBench, leaf: Leaf, ticks: int, *, after: float = 0.1) -> list[Status]:
    return [bench.tick(leaf, after=after) for _ in range(ticks)]


def test_mock_uses_one_turn_per_start_and_repeats_the_last(bench: LeafTestBench) -> None:
    leaf = mocked(bench, 'fails twice because "stuck", then succeeds')
    assert outcomes(bench, leaf, 2) == [FAILURE, FAILURE]
    assert leaf.reason == "stuck"
    assert outcomes(bench, leaf, 3) == [SUCCESS] * 3


def test_mock_runs_for_the_given_ticks_or_seconds(bench: LeafTestBench) -> None:
    assert outcomes(bench, mocked(bench, "succeeds after 2 ticks"), 3) == [RUNNING, RUNNING, SUCCESS]
    assert outcomes(bench, mocked(bench, "runs for 300 ms, then fails"), 4) == [RUNNING, RUNNING, RUNNING, FAILURE]


def test_halted_turn_is_over(bench: LeafTestBench) -> None:
    leaf = mocked(bench, "runs once, then succeeds")
    assert outcomes(bench, leaf, 50) == [RUNNING] * 50
    assert bench.halt(leaf)
    assert outcomes(bench, leaf, 1) == [SUCCESS]


def test_leaves_of_one_mock_share_its_script(bench: LeafTestBench) -> None:
    cast = MockSubstitution([spec("gesture", "fails, then succeeds")])
    first, second = (bench.put(cast_for(cast, step(GestureLeaf), GestureLeaf("gesture"))) for _ in range(2))
    assert (bench.tick(first), bench.tick(second)) == (FAILURE, SUCCESS)


def test_mock_may_replace_one_leaf_by_name(bench: LeafTestBench) -> None:
    cast = MockSubstitution([spec("wave", "fails")])
    assert bench.tick(bench.put(cast_for(cast, step(GestureLeaf, "wave"), GestureLeaf("wave")))) is FAILURE
    other = GestureLeaf("bow")
    assert cast(step(GestureLeaf, "bow"), other) is other


def test_mock_claims_the_part_of_its_leaf_and_moves_nothing(bench: LeafTestBench) -> None:
    leaf = mocked(bench, "runs")
    assert leaf.claims == {"arm"}
    bench.tick(leaf)
    assert leaf.is_acting
    bench.halt(leaf)
    assert bench.arm.commands == []


def test_mock_of_find_face_stores_a_face(bench: LeafTestBench) -> None:
    leaf = mocked(bench, "succeeds", FindFace, {"id": 7, "yaw": 0.2})
    leaf.output_variable = "person"
    bench.tick(leaf)
    face = bench.run.variables["person"]
    assert isinstance(face, Face)
    assert (face.id, face.yaw, face.stamp) == (7, 0.2, bench.clock.now())


def test_mock_stores_its_given_result(bench: LeafTestBench) -> None:
    leaf = mocked(bench, "fails, then succeeds", Wait, {"count": 3})
    leaf.output_variable = "seen"
    bench.tick(leaf)
    assert "seen" not in bench.run.variables
    bench.tick(leaf)
    assert bench.run.variables["seen"] == {"count": 3}


def test_failing_mocked_mission_returns_its_results(bench: LeafTestBench) -> None:
    for keep_as, kept in ((None, {"gone": 2.0}), ("way", {"way": {"gone": 2.0}})):
        mission = Step("mission", "go", Mark(), SourceText("a", ""), (step(Wait),), text="go", output_variable=keep_as,
                       returns={"gone": Value(1.0)})  # fmt: skip
        stand_in = MockSubstitution([spec("go", "fails", {"gone": 2.0, "left": 3.0})])(mission, None)
        assert stand_in is not None
        leaf = bench.put(stand_in)
        leaf.scope.clear()
        assert bench.tick(leaf) is FAILURE
        assert leaf.scope == kept


def test_the_arguments_of_a_mocked_leaf_are_still_computed(bench: LeafTestBench) -> None:
    def unknown() -> object:
        raise LookupError("'x' is not set")

    leaf = mocked(bench, "succeeds", Wait)
    leaf.computed = {"duration": unknown}
    assert bench.tick(leaf) is FAILURE
    assert leaf.reason == "wait: duration: 'x' is not set"
    assert mocked(bench, "succeeds", Set).open_ended


def test_patterns_match_leaves_and_missions_and_names_match_composites() -> None:
    mission = Step("mission", "look for them", Mark(), SourceText("a", ""), text="find_person")
    named, plain = (Step("sequence", name, Mark(), SourceText("a", "")) for name in ("greet them", "sequence"))
    timed = Step("timeout", "greet them", Mark(), SourceText("a", ""), (named,))
    stands = {
        "find_*": [step(FindFace), mission],
        "look*": [mission],
        "find_person": [mission],
        "look for them": [mission],
        "mission": [],
        "greet them": [named],
        "greet*": [],
        "sequence": [],
        "*": [step(FindFace), mission],
    }
    every = [step(FindFace), mission, named, plain, timed]
    assert {target: [each for each in every if matches_step(target, each)] for target in stands} == stands


def test_closest_match_replaces_a_step_whatever_the_order(bench: LeafTestBench) -> None:
    named, plain = step(GestureLeaf, "wave"), step(GestureLeaf)
    for specs in ([spec("*", "runs"), spec("gesture", "fails"), spec("wave", "succeeds")],
                  [spec("wave", "succeeds"), spec("gesture", "fails"), spec("*", "runs")]):  # fmt: skip
        cast = MockSubstitution(specs)
        wave = bench.put(cast_for(cast, named, GestureLeaf("wave")))
        other = bench.put(cast_for(cast, plain, GestureLeaf("gesture")))
        wait = bench.put(cast_for(cast, step(Wait), Wait("wait")))
        assert [bench.tick(leaf) for leaf in (wave, other, wait)] == [SUCCESS, FAILURE, RUNNING]
