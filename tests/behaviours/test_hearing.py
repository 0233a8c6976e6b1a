"""Listening: for phrases that were begun in time, with reasons for all that goes otherwise."""

import pytest

from behaviours.hearing import MAX_AGE, HeardLeaf, Listen
from behaviours.leaf import FAILURE, RUNNING, SUCCESS
from drivers.microphone import twin
from missions.plugins.testing.recorders import LeafTestBench
from perception.hearing import listener

ANSWERS = {"yes": "Yes!", "no": "No"}


def listening(bench: LeafTestBench, *, timeout: float | None = None) -> Listen:
    return bench.put(Listen("listen"), phrases=ANSWERS, timeout=timeout)


def test_listen_waits_for_a_phrase_and_stores_its_written_form() -> None:
    bench = LeafTestBench()
    leaf = listening(bench)
    assert bench.tick(leaf) is RUNNING
    assert leaf.reason == "listening"
    bench.clock.advance(1.0)
    bench.hearing.say("yes")
    assert bench.tick(leaf) is SUCCESS
    assert (leaf.result, leaf.reason) == ("Yes!", 'heard "yes"')


def test_listen_ignores_phrases_that_began_before_its_start() -> None:
    bench = LeafTestBench()
    leaf = listening(bench)
    bench.hearing.say("yes")
    assert bench.tick(leaf) is RUNNING
    bench.hearing.say("no", seconds=0.2)
    assert bench.tick(leaf) is RUNNING
    bench.clock.advance(1.0)
    bench.hearing.say("no", seconds=0.2)
    assert bench.tick(leaf) is SUCCESS
    assert leaf.result == "No"


def test_listen_starts_again_after_success() -> None:
    bench = LeafTestBench()
    leaf = listening(bench)
    bench.tick(leaf)
    bench.clock.advance(1.0)
    bench.hearing.say("yes")
    assert bench.tick(leaf) is SUCCESS
    assert bench.tick(leaf) is RUNNING


@pytest.mark.parametrize(
    ("said", "reason"),
    [
        ([], "nothing heard"),
        ([("go home", True)], "heard something else once (nearest: go home)"),
        ([("yes", False)], "heard something else once (nearest: yes)"),
        ([("yes", False), ("go home", True), ("", False)], "heard something else 3 times"),
    ],
)
def test_listen_reports_other_phrases_at_its_timeout(said: list[tuple[str, bool]], reason: str) -> None:
    bench = LeafTestBench()
    leaf = listening(bench, timeout=8.0)
    bench.tick(leaf)
    for phrase, accepted in said:
        bench.clock.advance(1.0)
        bench.hearing.say(phrase, accepted=accepted)
    assert bench.tick(leaf) is RUNNING
    assert bench.tick(leaf, after=8.0) is FAILURE
    assert leaf.reason == reason


def test_listen_reports_a_silent_microphone_at_once() -> None:
    bench = LeafTestBench()
    bench.hearing.heard_until = bench.clock.now() - 2.0
    leaf = listening(bench, timeout=1.0)
    assert bench.tick(leaf) is RUNNING
    assert leaf.reason == "no sound from the microphone, or no recogniser: see the notices"
    assert bench.tick(leaf, after=1.0) is FAILURE
    assert leaf.reason == "no sound from the microphone, or no recogniser: see the notices"


def test_heard_succeeds_for_a_while_after_the_phrase() -> None:
    bench = LeafTestBench()
    leaf = bench.put(HeardLeaf("heard"), phrases={"hello robot": "Hello, robot!"})
    assert bench.tick(leaf) is FAILURE
    assert leaf.reason == "not heard"
    bench.hearing.say("hello robot")
    assert bench.tick(leaf, after=2.9) is SUCCESS
    assert leaf.result == "Hello, robot!"
    assert bench.tick(leaf, after=0.2) is FAILURE


def test_heard_ignores_other_phrases() -> None:
    bench = LeafTestBench()
    leaf = bench.put(HeardLeaf("heard"), phrases={"stop": "stop"}, within=5.0)
    bench.hearing.say("stop")
    bench.hearing.say("hello robot")
    assert bench.tick(leaf) is SUCCESS
    bench.hearing.understood = ()
    bench.hearing.heard_until = 0.0
    assert bench.tick(leaf) is RUNNING
    assert (leaf.is_suspended, leaf.reason) == (True, "waiting: the microphone does not report")


def test_heard_window_equals_the_age_of_stored_words() -> None:
    assert HeardLeaf.arguments["within"].high == MAX_AGE == listener.MAX_WORD_AGE == twin.MAX_WORD_AGE
