"""People who act: at a time, or because of what they hear; always the same for the same time and the same words."""

from math import dist, pi

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.errors import BadRequest
from drivers.sim.acts import NOD_DEPTH, NOD_TIME, REACTION, Act, Heard, Reply, nod_at
from drivers.sim.people import Person, Presence
from drivers.sim.world import World


def only(world: World, time: float) -> Presence:
    (presence,) = world.people_at(time)
    return presence


def test_somebody_answers_what_they_listen_for_whatever_its_capitals() -> None:
    world = World(people=(Person("Anna", acts=(Act(hears="hello", say="Hello, robot!"),)),))
    assert world.hear("Hello there", 2.0) == (Reply("Anna", "Hello, robot!", 2.0 + REACTION),)
    assert world.hear("Goodbye", 5.0) == ()
    assert world.heard == (Heard("Hello there", 2.0, ("Anna",)), Heard("Goodbye", 5.0, ("Anna",)))


def test_answers_of_several_come_in_the_order_of_time() -> None:
    slow = Person("Anna", acts=(Act(hears="hello", after=2.0, say="Hello!"),))
    quick = Person("Ben", x=2.5, acts=(Act(hears="", after=0.5, say="Hm?"),))
    world = World(people=(slow, quick))
    assert [reply.who for reply in world.hear("hello", 0.0)] == ["Ben", "Anna"]


def test_what_people_say_of_their_own_accord_is_told_once() -> None:
    world = World(people=(Person("Anna", acts=(Act(at=3.0, say="Anybody there?"), Act(hears="yes", say="Good."))),))
    world.hear("yes", 4.0)
    assert world.said(0.0, 2.9) == ()
    assert world.said(2.9, 3.0) == (Reply("Anna", "Anybody there?", 3.0),)
    assert world.said(3.0, 10.0) == (Reply("Anna", "Good.", 4.0 + REACTION),)


def test_somebody_turns_away_and_back_at_their_times() -> None:
    acts = (Act(at=5.0, turn="away"), Act(at=8.0, turn="camera"), Act(at=9.0, turn=0.0))
    world = World(people=(Person("Anna", x=2.0, acts=acts),))
    assert [only(world, time).shows_face(0.0, 0.0) for time in (4.9, 5.0, 8.0, 9.0)] == [True, False, True, False]
    assert only(world, 6.0).direction(0.0, 0.0) == pytest.approx(2 * pi)
    assert only(world, 8.5).direction(0.0, 0.0) == pytest.approx(pi)
    assert only(world, 9.5).direction(5.0, 5.0) == 0.0


def test_a_nod_lowers_the_eyes_twice_and_ends_where_it_began() -> None:
    world = World(people=(Person("Anna", height=1.6, acts=(Act(hears="hello", nod=True),)),))
    world.hear("hello", 1.0)
    begin = 1.0 + REACTION
    depths = [1.6 - only(world, begin + NOD_TIME * step / 40).eyes for step in range(41)]
    assert max(depths) == pytest.approx(NOD_DEPTH)
    assert depths[0] == pytest.approx(0.0)
    assert depths[20] == pytest.approx(0.0)
    assert only(world, begin + NOD_TIME).eyes == 1.6
    peaks = [b for a, b, c in zip(depths, depths[1:], depths[2:], strict=False) if a < b > c]
    assert len(peaks) == 2


@given(st.floats(-10, 10))
def test_a_nod_is_never_deeper_than_it_may_be(since: float) -> None:
    assert 0.0 <= nod_at(since) <= NOD_DEPTH


def test_who_leaves_walks_to_the_nearest_wall_and_is_gone_and_deaf() -> None:
    walker = Person("Anna", x=3.0, y=2.0, speed=0.5, acts=(Act(at=10.0, leave=True), Act(hears="", say="What?")))
    world = World(people=(walker,))
    assert [reply.when for reply in world.hear("Anna?", 9.0)] == [9.0 + REACTION]
    leaving = only(world, 11.0)  # half a metre on its way to the left wall, one metre away
    assert (leaving.x, leaving.y) == pytest.approx((3.0, 2.5))
    assert leaving.direction(0.0, 0.0) == pytest.approx(pi / 2)
    assert world.hear("Anna?", 11.0) == ()
    assert world.people_at(12.0) == ()
    assert only(world, 9.0).y == 2.0  # the past is as it was


def test_nothing_is_done_after_leaving() -> None:
    acts = (Act(at=2.0, leave=True), Act(at=3.0, say="I am back", turn="away"))
    world = World(people=(Person("Anna", x=1.0, y=0.5, acts=acts),))
    assert world.said(0.0, 100.0) == ()
    assert only(world, 3.5).facing == pytest.approx(pi / 2)  # the way out, not "away"


@given(st.lists(st.tuples(st.sampled_from(["hello", "bye", "what?"]), st.floats(0, 20)), max_size=5), st.floats(0, 40))
def test_the_same_words_at_the_same_times_make_the_same_people(said: list[tuple[str, float]], time: float) -> None:
    acts = (Act(hears="hello", nod=True, turn="away"), Act(hears="bye", leave=True), Act(at=4.0, turn=1.0))

    def world() -> World:
        made = World(people=(Person("Anna", path=((2.0, 1.0),), acts=acts), Person("Ben", x=2.0)))
        for text, when in said:
            made.hear(text, when)
        return made

    assert world().people_at(time) == world().people_at(time)


@given(st.floats(0, 30), st.floats(0, 3), st.floats(0.1, 2))
def test_nobody_hurries_on_the_way_out(time: float, later: float, speed: float) -> None:
    acts = (Act(at=3.0, leave=True),)
    world = World(people=(Person("Anna", x=1.0, y=1.0, path=((2.0, 1.0),), speed=speed, acts=acts),))
    now, then = world.people_at(time), world.people_at(time + later)
    if now and then:
        assert dist((now[0].x, now[0].y), (then[0].x, then[0].y)) <= speed * later + 1e-9


def test_an_act_needs_a_reason() -> None:
    with pytest.raises(BadRequest, match="needs one of them"):
        Act(nod=True)
    with pytest.raises(BadRequest, match="needs one of them"):
        Act(at=1.0, hears="hello", nod=True)
    with pytest.raises(BadRequest, match="0 s or more"):
        Act(at=-1.0, nod=True)
