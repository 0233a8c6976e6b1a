"""People who act: at a time, or because of what they hear; always the same for the same time and the same words."""

from math import dist, pi

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.errors import BadRequest
from drivers.sim.people import Person, Presence
from drivers.sim.person_actions import (
    NOD_DEPTH,
    NOD_TIME,
    REACTION_TIME,
    PersonAction,
    PersonReply,
    RobotUtterance,
    eye_drop,
)
from drivers.sim.world import SimulatedWorld


def only(world: SimulatedWorld, time: float) -> Presence:
    (presence,) = world.people_at(time)
    return presence


def test_person_answers_a_phrase_in_any_case() -> None:
    world = SimulatedWorld(people=(Person("Anna", acts=(PersonAction(hears="hello", say="Hello, robot!"),)),))
    assert world.deliver_speech("Hello there", 2.0) == (PersonReply("Anna", "Hello, robot!", 2.0 + REACTION_TIME),)
    assert world.deliver_speech("Goodbye", 5.0) == ()
    assert world.utterances == (
        RobotUtterance("Hello there", 2.0, ("Anna",)),
        RobotUtterance("Goodbye", 5.0, ("Anna",)),
    )


def test_answers_are_ordered_by_time() -> None:
    slow = Person("Anna", acts=(PersonAction(hears="hello", after=2.0, say="Hello!"),))
    quick = Person("Ben", x=2.5, acts=(PersonAction(hears="", after=0.5, say="Hm?"),))
    world = SimulatedWorld(people=(slow, quick))
    assert [reply.speaker for reply in world.deliver_speech("hello", 0.0)] == ["Ben", "Anna"]


def test_spontaneous_speech_is_reported_once() -> None:
    world = SimulatedWorld(
        people=(
            Person("Anna", acts=(PersonAction(at=3.0, say="Anybody there?"), PersonAction(hears="yes", say="Good."))),
        )
    )
    world.deliver_speech("yes", 4.0)
    assert world.replies_between(0.0, 2.9) == ()
    assert world.replies_between(2.9, 3.0) == (PersonReply("Anna", "Anybody there?", 3.0),)
    assert world.replies_between(3.0, 10.0) == (PersonReply("Anna", "Good.", 4.0 + REACTION_TIME),)


def test_person_turns_away_and_back_at_set_times() -> None:
    acts = (PersonAction(at=5.0, turn="away"), PersonAction(at=8.0, turn="camera"), PersonAction(at=9.0, turn=0.0))
    world = SimulatedWorld(people=(Person("Anna", x=2.0, acts=acts),))
    assert [only(world, time).shows_face(0.0, 0.0) for time in (4.9, 5.0, 8.0, 9.0)] == [True, False, True, False]
    assert only(world, 6.0).direction(0.0, 0.0) == pytest.approx(2 * pi)
    assert only(world, 8.5).direction(0.0, 0.0) == pytest.approx(pi)
    assert only(world, 9.5).direction(5.0, 5.0) == 0.0


def test_nod_lowers_the_eyes_twice_and_ends_at_the_start() -> None:
    world = SimulatedWorld(people=(Person("Anna", height=1.6, acts=(PersonAction(hears="hello", nod=True),)),))
    world.deliver_speech("hello", 1.0)
    begin = 1.0 + REACTION_TIME
    depths = [1.6 - only(world, begin + NOD_TIME * step / 40).eye_height for step in range(41)]
    assert max(depths) == pytest.approx(NOD_DEPTH)
    assert depths[0] == pytest.approx(0.0)
    assert depths[20] == pytest.approx(0.0)
    assert only(world, begin + NOD_TIME).eye_height == 1.6
    peaks = [b for a, b, c in zip(depths, depths[1:], depths[2:], strict=False) if a < b > c]
    assert len(peaks) == 2


@given(st.floats(-10, 10))
def test_nod_depth_is_bounded(since: float) -> None:
    assert 0.0 <= eye_drop(since) <= NOD_DEPTH


def test_leaving_person_walks_to_the_nearest_wall_and_vanishes() -> None:
    walker = Person(
        "Anna", x=3.0, y=2.0, speed=0.5, acts=(PersonAction(at=10.0, leave=True), PersonAction(hears="", say="What?"))
    )
    world = SimulatedWorld(people=(walker,))
    assert [reply.time for reply in world.deliver_speech("Anna?", 9.0)] == [9.0 + REACTION_TIME]
    leaving = only(world, 11.0)  # half a metre on its way to the left wall, one metre away
    assert (leaving.x, leaving.y) == pytest.approx((3.0, 2.5))
    assert leaving.direction(0.0, 0.0) == pytest.approx(pi / 2)
    assert world.deliver_speech("Anna?", 11.0) == ()
    assert world.people_at(12.0) == ()
    assert only(world, 9.0).y == 2.0  # the past is as it was


def test_person_does_not_act_after_leaving() -> None:
    acts = (PersonAction(at=2.0, leave=True), PersonAction(at=3.0, say="I am back", turn="away"))
    world = SimulatedWorld(people=(Person("Anna", x=1.0, y=0.5, acts=acts),))
    assert world.replies_between(0.0, 100.0) == ()
    assert only(world, 3.5).facing == pytest.approx(pi / 2)  # the way out, not "away"


@given(st.lists(st.tuples(st.sampled_from(["hello", "bye", "what?"]), st.floats(0, 20)), max_size=5), st.floats(0, 40))
def test_people_depend_only_on_words_and_times(said: list[tuple[str, float]], time: float) -> None:
    acts = (
        PersonAction(hears="hello", nod=True, turn="away"),
        PersonAction(hears="bye", leave=True),
        PersonAction(at=4.0, turn=1.0),
    )

    def world() -> SimulatedWorld:
        made = SimulatedWorld(people=(Person("Anna", path=((2.0, 1.0),), acts=acts), Person("Ben", x=2.0)))
        for text, when in said:
            made.deliver_speech(text, when)
        return made

    assert world().people_at(time) == world().people_at(time)


@given(st.floats(0, 30), st.floats(0, 3), st.floats(0.1, 2))
def test_leaving_person_keeps_its_speed(time: float, later: float, speed: float) -> None:
    acts = (PersonAction(at=3.0, leave=True),)
    world = SimulatedWorld(people=(Person("Anna", x=1.0, y=1.0, path=((2.0, 1.0),), speed=speed, acts=acts),))
    now, then = world.people_at(time), world.people_at(time + later)
    if now and then:
        assert dist((now[0].x, now[0].y), (then[0].x, then[0].y)) <= speed * later + 1e-9


def test_person_action_needs_a_trigger() -> None:
    with pytest.raises(BadRequest, match="exactly one of them must be set"):
        PersonAction(nod=True)
    with pytest.raises(BadRequest, match="exactly one of them must be set"):
        PersonAction(at=1.0, hears="hello", nod=True)
    with pytest.raises(BadRequest, match="0 s or more"):
        PersonAction(at=-1.0, nod=True)
