"""Who has the wheels of a base, and what it does by itself: arbiter, reflexes and helm, in handed-in time."""

from dataclasses import replace
from math import radians

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.api import COMMAND_LIFE, STILL, BaseState, Pose2D, Reflexes, Sides, Source, Velocity
from drivers.kobuki.arbiter import Arbiter
from drivers.kobuki.limits import Limits
from drivers.kobuki.velocity_multiplexer import VelocityMultiplexer

FREE = BaseState(Pose2D(0.0, 0.0, 0.0), STILL)
LIMITS = Limits(0.5, radians(110), 0.5, radians(200))
AHEAD, BACK = Velocity(0.3, 0.0), Velocity(-0.2, 0.0)
SIDES = st.builds(Sides, st.booleans(), st.booleans(), st.booleans())
PERIOD = 0.02


class Ride:
    """A helm asked 50 times a second; the base does as it is told at once."""

    def __init__(self, reflexes: Reflexes | None = None) -> None:
        self.mux = VelocityMultiplexer(LIMITS, reflexes)
        self.now = 0.0
        self.felt = FREE
        self.given = STILL

    def drive(self, wanted: Velocity, seconds: float, source: Source = Source.MISSION) -> Velocity:
        for _ in range(round(seconds / PERIOD)):
            self.mux.steer(wanted, self.now, self.felt, source)
            self.wait(PERIOD)
        return self.given

    def wait(self, seconds: float) -> Velocity:
        for _ in range(round(seconds / PERIOD)):
            self.now += PERIOD
            self.mux.feel(self.felt, self.now)
            self.given = self.mux.velocity(self.now, self.felt)
            x = self.felt.pose.x + self.given.linear * PERIOD
            heading = self.felt.pose.heading + self.given.angular * PERIOD
            self.felt = replace(self.felt, pose=Pose2D(x, 0.0, heading))
        return self.given

    def feel(self, **contacts: Sides) -> None:
        self.felt = replace(self.felt, **contacts)  # type: ignore[arg-type]  # contacts are fields of BaseState


def test_the_more_important_source_has_the_wheels_until_it_has_been_silent_for_long_enough() -> None:
    arbiter = Arbiter()
    assert arbiter.decide(0.0) == (None, None)
    arbiter.ask(Source.MISSION, AHEAD, 0.0)
    assert arbiter.decide(0.1) == (Source.MISSION, AHEAD)
    arbiter.ask(Source.TELEOP, BACK, 0.1)
    arbiter.ask(Source.MISSION, AHEAD, 0.35)
    assert arbiter.decide(0.39) == (Source.TELEOP, BACK)
    assert arbiter.decide(0.45) == (Source.TELEOP, None), "a command is good for 0.3 s, the wheels are kept for 1 s"
    arbiter.ask(Source.MISSION, AHEAD, 1.0)
    assert arbiter.decide(1.09) == (Source.TELEOP, None)
    assert arbiter.decide(1.2) == (Source.MISSION, AHEAD)
    assert arbiter.decide(1.4) == (None, None)


def test_what_a_source_forgets_is_no_longer_wanted_and_nothing_else() -> None:
    arbiter = Arbiter()
    for source in (Source.MISSION, Source.TELEOP):
        arbiter.ask(source, AHEAD, 0.0)
    arbiter.forget(Source.TELEOP)
    assert arbiter.decide(0.1) == (Source.MISSION, AHEAD)
    arbiter.forget()
    assert arbiter.decide(0.1) == (None, None)


@pytest.mark.parametrize("source", [Source.MISSION, Source.TELEOP])
def test_a_command_that_nobody_renews_ends_at_once(source: Source) -> None:
    ride = Ride()
    assert ride.drive(AHEAD, 2.0, source) == AHEAD
    assert ride.wait(COMMAND_LIFE + 2 * PERIOD) == STILL
    ride.wait(1.0)
    assert ride.mux.steering.source is None


def test_backing_off_has_the_time_that_its_way_needs_and_keeps_to_the_limits() -> None:
    ride = Ride(Reflexes(back_off_way=0.3, back_off_speed=0.1))
    ride.drive(AHEAD, 2.0)
    hit = ride.felt.pose.x
    ride.feel(bumper=Sides(left=True))
    ride.wait(0.1)
    ride.feel(bumper=Sides())
    ride.wait(5.0)
    assert hit - 0.34 < ride.felt.pose.x < hit - 0.29
    slow = VelocityMultiplexer(Limits(0.1, 0.1, 0.5, 3.0), Reflexes(back_off_speed=0.3))
    slow.steer(AHEAD, 0.0, FREE)
    for step in range(1, 40):
        slow.steer(AHEAD, step * PERIOD, FREE)
        slow.feel(FREE if step < 20 else replace(FREE, bumper=Sides(left=True)), step * PERIOD)
        given = slow.velocity(step * PERIOD, FREE)
        assert abs(given.linear) <= 0.1 + 1e-9
        assert abs(given.angular) <= 0.1 + 1e-9


def test_a_contact_that_lasts_for_one_report_of_several_is_felt() -> None:
    mux = VelocityMultiplexer(LIMITS, Reflexes(bumper="latch", stop_button=0))
    for contact in (replace(FREE, bumper=Sides(left=True)), replace(FREE, buttons=frozenset({0}))):
        mux.enable()
        for state in (FREE, contact, FREE):
            mux.feel(state, 0.0)
        assert mux.latched
    mux.enable()
    for state in (FREE, replace(FREE, cliff=Sides(left=True)), FREE):
        mux.feel(state, 0.0)
    assert mux.steer(Velocity(0.0, 1.0), 0.0, FREE) == STILL, "there was an edge"


def test_a_wheel_that_hangs_for_a_moment_does_not_make_an_edge_go_away() -> None:
    ride = Ride()
    for contacts in (
        {"cliff": Sides(right=True)},
        {"wheel_drop": Sides(right=True)},
        {"cliff": Sides(), "wheel_drop": Sides()},
    ):
        ride.feel(**contacts)
        ride.wait(PERIOD)
    assert ride.drive(Velocity(0.2, 1.0), 0.1) == STILL


def test_enabled_it_does_not_latch_again_for_what_it_felt_before() -> None:
    ride = Ride(Reflexes(bumper="latch"))
    ride.drive(AHEAD, 1.0)
    ride.felt = held = replace(ride.felt, bumper=Sides(centre=True))
    ride.mux.feel(held, ride.now)
    assert ride.mux.latched
    ride.mux.enable()
    ride.mux.feel(held, ride.now + PERIOD)
    assert not ride.mux.latched


def test_what_was_wanted_what_is_given_and_why_is_known() -> None:
    ride = Ride()
    ride.drive(Velocity(5.0, 0.0), 0.1)
    steering = ride.mux.steering
    assert (steering.source, steering.wanted.linear, steering.given.linear) == (Source.MISSION, 5.0, 0.5)
    assert steering.because == "limited"
    ride.drive(AHEAD, 0.1)
    assert ride.mux.steering.because == ""
    ride.feel(wheel_drop=Sides(left=True))
    ride.drive(AHEAD, 0.1)
    assert (ride.given, ride.mux.steering.because) == (STILL, "wheel drop left")


@pytest.mark.parametrize(
    ("side", "turn"), [("left", -0.4), ("centre", 0.0), ("right", 0.4)], ids=["left", "centre", "right"]
)
def test_a_bump_on_the_way_makes_it_back_off_so_far_and_no_farther(side: str, turn: float) -> None:
    ride = Ride()
    ride.drive(AHEAD, 2.0)
    hit = ride.felt.pose.x
    ride.feel(bumper=Sides(**{side: True}))
    ride.drive(AHEAD, 0.2)
    assert (ride.mux.steering.source, ride.mux.steering.given) == (Source.SAFETY, Velocity(-0.1, turn))
    ride.feel(bumper=Sides())
    while ride.mux.steering.source is Source.SAFETY:
        ride.drive(AHEAD, PERIOD)
    assert hit - 0.07 < ride.felt.pose.x < hit - 0.04
    assert ride.mux.steering.source is Source.MISSION


def test_what_holds_it_is_not_pulled_at_for_ever() -> None:
    ride = Ride()
    ride.drive(AHEAD, 2.0)
    ride.feel(bumper=Sides(centre=True))
    ride.wait(2.0)
    assert (ride.given, ride.mux.steering.source) == (STILL, None)


def test_a_base_that_stands_or_goes_gently_does_not_back_off_from_what_touches_it() -> None:
    for speed in (0.0, 0.05):
        ride = Ride()
        ride.drive(Velocity(speed, 0.0), 1.0)
        ride.feel(bumper=Sides(centre=True))
        ride.drive(Velocity(speed, 0.0), 0.1)
        assert ride.given == STILL


def test_at_an_edge_it_only_goes_straight_back_until_the_edge_is_behind() -> None:
    ride = Ride()
    ride.drive(AHEAD, 1.0)
    ride.feel(cliff=Sides(left=True))
    assert ride.drive(AHEAD, 0.04) == STILL
    assert ride.drive(Velocity(0.0, 1.0), 0.5) == STILL, "turning there, a wheel would go over the edge"
    assert ride.drive(Velocity(-0.1, 1.0), 0.1).angular == 0.0
    ride.feel(cliff=Sides())
    assert ride.drive(Velocity(0.0, 1.0), 0.1) == STILL
    assert ride.mux.steering.because == "at an edge"
    ride.drive(BACK, 1.0)
    assert ride.drive(Velocity(0.0, 1.0), 1.0) == Velocity(0.0, 1.0)


def test_carried_away_from_an_edge_it_drives_again() -> None:
    ride = Ride()
    ride.feel(cliff=Sides(left=True))
    ride.wait(0.1)
    ride.feel(cliff=Sides(left=True, centre=True, right=True), wheel_drop=Sides(left=True, right=True))
    ride.wait(0.5)
    ride.feel(cliff=Sides(), wheel_drop=Sides())
    assert ride.drive(AHEAD, 1.0) == AHEAD


@pytest.mark.parametrize("contact", ["bumper", "cliff", "wheel_drop"])
def test_a_reflex_that_latches_waits_for_somebody_to_enable_the_base(contact: str) -> None:
    ride = Ride(Reflexes(**{contact: "latch"}))  # type: ignore[arg-type]  # the names of three fields
    ride.drive(AHEAD, 1.0)
    ride.feel(**{contact: Sides(left=True)})
    ride.drive(AHEAD, 0.1)
    ride.feel(**{contact: Sides()})
    assert ride.drive(BACK, 1.0) == STILL
    assert ride.mux.latched == f"{contact.replace('_', ' ')} left"
    ride.mux.enable()
    assert ride.drive(BACK, 1.0) == BACK


def test_buttons_stop_and_enable_it_when_they_go_down() -> None:
    ride = Ride(Reflexes(stop_button=0, enable_button=2))
    ride.drive(AHEAD, 1.0)
    ride.felt = replace(ride.felt, buttons=frozenset({0}))
    assert ride.drive(AHEAD, 0.1) == STILL
    assert ride.mux.latched == "button 0 was pressed"
    ride.mux.enable()
    assert ride.drive(AHEAD, 1.0) == AHEAD, "it is still held down, but was not pressed again"
    ride.felt = replace(ride.felt, buttons=frozenset())
    ride.drive(AHEAD, 0.1)
    ride.felt = replace(ride.felt, buttons=frozenset({0}))
    ride.drive(AHEAD, 0.1)
    ride.felt = replace(ride.felt, buttons=frozenset({2}))
    assert ride.drive(AHEAD, 1.0) == AHEAD


def test_stopping_one_source_leaves_the_other_its_wheels() -> None:
    ride = Ride()
    ride.drive(BACK, 1.0, Source.TELEOP)
    assert not ride.mux.halt(Source.MISSION)
    assert ride.wait(PERIOD) == BACK
    assert ride.mux.halt(Source.TELEOP)
    assert ride.wait(PERIOD) == STILL


@given(
    st.lists(
        st.tuples(
            SIDES,
            SIDES,
            SIDES,
            st.floats(-1.0, 1.0),
            st.floats(-4.0, 4.0),
            st.sampled_from((Source.MISSION, Source.TELEOP)),
            st.integers(1, 20),
        ),
        max_size=20,
    )
)
def test_whatever_is_felt_and_wanted_it_never_goes_on_into_it(
    steps: list[tuple[Sides, Sides, Sides, float, float, Source, int]],
) -> None:
    ride = Ride()
    for bumper, cliff, wheel_drop, linear, angular, source, count in steps:
        ride.feel(bumper=bumper, cliff=cliff, wheel_drop=Sides(wheel_drop.left, False, wheel_drop.right))
        for _ in range(count):
            given = ride.drive(Velocity(linear, angular), PERIOD, source)
            felt = ride.felt
            assert not (felt.wheel_drop and given != STILL)
            assert not ((felt.cliff or felt.bumper) and given.linear > 0.0)
            assert not (felt.cliff and given.angular != 0.0)
            assert abs(given.linear) <= 0.5 + 1e-9
            assert abs(given.angular) <= radians(110) + 1e-9
