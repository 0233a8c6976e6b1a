"""The leaves that need no robot."""

import logging

import pytest
from hypothesis import given
from hypothesis import strategies as st

from behaviours.basics import Fail, Log, Pretend, Set, Succeed, Wait
from behaviours.leaf import FAILURE, RUNNING, SUCCESS
from missions.plugins.testing.recorders import LeafTestBench


def test_wait_runs_until_the_time_is_over() -> None:
    bench = LeafTestBench()
    leaf = bench.put(Wait("wait"), duration=1.0)
    assert [bench.tick(leaf, after=0.25) for _ in range(5)] == [RUNNING, RUNNING, RUNNING, RUNNING, SUCCESS]


def test_wait_for_no_time_succeeds_at_once() -> None:
    bench = LeafTestBench()
    assert bench.tick(bench.put(Wait("wait"), duration=0.0)) is SUCCESS


@pytest.mark.parametrize("ended", ["succeeded", "was halted"])
def test_a_second_wait_takes_as_long_as_the_first(ended: str) -> None:
    bench = LeafTestBench()
    leaf = bench.put(Wait("wait"), duration=1.0)
    bench.tick(leaf)
    if ended == "succeeded":
        assert bench.tick(leaf, after=1.0) is SUCCESS
    else:
        assert bench.halt(leaf)
    assert bench.tick(leaf, after=50.0) is RUNNING
    assert bench.tick(leaf, after=0.9) is RUNNING
    assert bench.tick(leaf, after=0.1) is SUCCESS


def test_log_writes_its_line(caplog: pytest.LogCaptureFixture) -> None:
    bench = LeafTestBench()
    leaf = bench.put(Log("log"), text="50 % full")
    with caplog.at_level(logging.INFO, logger="missiontree"):
        assert bench.tick(leaf) is SUCCESS
    assert [record.message for record in caplog.records] == ["50 % full"]
    assert leaf.reason == "50 % full"


def test_set_keeps_the_values_of_the_moment() -> None:
    bench = LeafTestBench()
    bench.run.variables.update(count=1, name="ada")
    leaf = bench.put(Set("set"), computed={"at": bench.clock.now, "name": lambda: "bob"})
    assert bench.tick(leaf, after=1.0) is SUCCESS
    assert bench.run.variables == {"count": 1, "at": 101.0, "name": "bob"}
    assert bench.tick(leaf, after=1.0) is SUCCESS
    assert bench.run.variables == {"count": 1, "at": 102.0, "name": "bob"}


def test_set_evaluates_all_values_before_it_assigns() -> None:
    bench = LeafTestBench()
    bench.run.variables.update(a=1, b=2)
    swap = bench.put(
        Set("set"), computed={"a": lambda: bench.run.variables["b"], "b": lambda: bench.run.variables["a"]}
    )
    bench.tick(swap)
    assert bench.run.variables == {"a": 2, "b": 1}


def test_set_fails_without_changes_if_a_variable_is_unset() -> None:
    def unknown() -> object:
        raise ValueError("there is no 'visitor' yet")

    bench = LeafTestBench()
    leaf = bench.put(Set("set"), computed={"a": lambda: 1, "b": unknown})
    assert bench.tick(leaf) is FAILURE
    assert leaf.reason == "set: b: there is no 'visitor' yet"
    assert bench.run.variables == {}


def test_succeed_succeeds() -> None:
    bench = LeafTestBench()
    assert bench.tick(bench.put(Succeed("succeed"))) is SUCCESS


def test_fail_fails_for_the_reason_given() -> None:
    bench = LeafTestBench()
    leaf = bench.put(Fail("fail"))
    assert bench.tick(leaf) is FAILURE
    assert leaf.reason == "failed as requested"
    bench.put(leaf, because="it is raining")
    bench.tick(leaf)
    assert leaf.reason == "it is raining"


@given(st.lists(st.sampled_from([RUNNING, SUCCESS, FAILURE]), min_size=1), st.integers(1, 30))
def test_pretend_cycles_through_its_outcomes(outcomes: list[object], ticks: int) -> None:
    bench = LeafTestBench()
    leaf = bench.put(Pretend("pretend"), outcomes=outcomes)
    assert [bench.tick(leaf) for _ in range(ticks)] == [outcomes[n % len(outcomes)] for n in range(ticks)]


def test_a_halt_does_not_rewind_pretend() -> None:
    bench = LeafTestBench()
    leaf = bench.put(Pretend("pretend"), outcomes=[RUNNING, FAILURE])
    bench.tick(leaf)
    assert bench.halt(leaf)
    assert bench.tick(leaf) is FAILURE
    assert leaf.reason == "failed as requested"
