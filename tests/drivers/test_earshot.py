"""Who hears whom in a simulated world: those who are near, with no inner wall between."""

from hypothesis import given
from hypothesis import strategies as st

from drivers.sim.people import EARSHOT, Person
from drivers.sim.person_actions import PersonAction
from drivers.sim.room import Room
from drivers.sim.world import SimulatedWorld
from drivers.sim.world_objects import Wall

HALL = Room.with_default_fixtures(20.0, 10.0, 2.6, (5.0, 0.0))


def listeners(world: SimulatedWorld, *at: float) -> tuple[str, ...]:
    world.deliver_speech("hello", 0.0, (at[0], at[1]))
    return world.utterances[-1].listeners


@given(st.floats(0.3, 9.0), st.floats(0.5, 9.0))
def test_hearing_range_of_people_is_limited(x: float, reach: float) -> None:
    world = SimulatedWorld(HALL, (Person("Anna", x=x, hears_within=reach),))
    assert listeners(world, 0.0, 0.0) == (("Anna",) if x <= reach else ())
    assert world.is_audible("Anna", 0.0, (0.0, 0.0)) is (x <= EARSHOT)


def test_speech_without_a_position_is_heard_by_all() -> None:
    world = SimulatedWorld(HALL, (Person("Anna", x=14.0),))
    world.deliver_speech("hello", 0.0)
    assert world.utterances[-1].listeners == ("Anna",)


def test_a_wall_keeps_words_from_both_sides_and_a_low_one_does_not() -> None:
    wall, low = Wall((1.0, -2.0), (1.0, 2.0)), Wall((1.0, -2.0), (1.0, 2.0), 0.9)
    anna = (Person("Anna", x=2.0),)
    assert listeners(SimulatedWorld(HALL, anna, walls=(wall,)), 0.0, 0.0) == ()
    assert not SimulatedWorld(HALL, anna, walls=(wall,)).is_audible("Anna", 0.0, (0.0, 0.0))
    assert listeners(SimulatedWorld(HALL, anna, walls=(low,)), 0.0, 0.0) == ("Anna",)


def test_walking_person_hears_at_the_present_position() -> None:
    world = SimulatedWorld(HALL, (Person("Anna", x=8.0, path=((1.0, 0.0),), speed=1.0, loop=False),))
    world.deliver_speech("hello", 1.0, (0.0, 0.0))
    world.deliver_speech("hello", 5.0, (0.0, 0.0))
    assert [heard.listeners for heard in world.utterances] == [(), ("Anna",)]


def test_person_out_of_earshot_does_not_reply() -> None:
    world = SimulatedWorld(HALL, (Person("Anna", x=8.0, acts=(PersonAction(hears="hello", say="Hi"),)),))
    assert world.deliver_speech("hello", 0.0, (0.0, 0.0)) == ()
    assert [reply.text for reply in world.deliver_speech("hello", 0.0, (6.0, 0.0))] == ["Hi"]


def test_times_limits_the_repetitions_of_an_act() -> None:
    acts = (
        PersonAction(hears="message", say="Say it again", times=1),
        PersonAction(hears="message", after=2.0, say="Thank you"),
    )
    world = SimulatedWorld(HALL, (Person("Anna", acts=acts),))
    assert [reply.text for reply in world.deliver_speech("a message", 0.0)] == ["Say it again", "Thank you"]
    assert [reply.text for reply in world.deliver_speech("a message", 9.0)] == ["Thank you"]


def test_person_who_has_left_is_not_audible() -> None:
    world = SimulatedWorld(HALL, (Person("Anna", acts=(PersonAction(at=1.0, leave=True),), speed=5.0),))
    assert world.is_audible("Anna", 0.5, (0.0, 0.0))
    assert listeners(world, 0.0, 0.0) == ("Anna",)
    assert not world.is_audible("Anna", 60.0, (0.0, 0.0))
    world.deliver_speech("hello", 60.0, (0.0, 0.0))
    assert world.utterances[-1].listeners == ()
