"""Who drives, and which commands count: on a clock of the test's own."""

from collections.abc import Callable
from contextlib import suppress
from math import inf
from random import Random

import pytest

from drivers.api import ZERO_VELOCITY, HeadPose, Source, Velocity
from drivers.clock import ManualClock
from missions.control.commands import BadMessage, DriveCommand, LookCommand
from missions.control.pilot import MAX_STATE_AGE
from missions.control.wheels import STAMP_LIFETIME, WheelArbiter
from missions.plugins.testing.recorders import STOP, RecordedBase, RecordedHead
from tests.machines import walk


class Driving:
    """A base, two who want it, and the time."""

    def __init__(self) -> None:
        self.clock = ManualClock()
        self.base = RecordedBase(self.clock)
        self.head = RecordedHead(self.clock)
        self.wheels = WheelArbiter(self.base, self.head, self.clock)
        self.number = 0

    def drive(
        self, who: str = "Ada", *, ahead: float = 1.0, stamp: int | None = None, number: int | None = None
    ) -> None:
        self.number = self.number + 1 if number is None else number
        stamp = self.wheels.stamp() if stamp is None else stamp
        self.wheels.drive(who, DriveCommand(n=self.number, stamp=stamp, ahead=ahead, left=0.0, pace=0.5))

    def look(self, who: str = "Ada", *, stamp: int | None = None) -> None:
        self.number += 1
        stamp = self.wheels.stamp() if stamp is None else stamp
        self.wheels.look(who, LookCommand(n=self.number, stamp=stamp, left=1.0, down=0.0))

    @property
    def commands(self) -> list[object]:
        return list(self.base.commands)

    @property
    def stands(self) -> bool:
        """Whether the last that the base heard is to stand."""
        return self.commands[-2:] == [STOP, (Source.TELEOP, ZERO_VELOCITY)]


@pytest.fixture
def driving() -> Driving:
    return Driving()


def refused(error: str, action: Callable[[], None]) -> str:
    with pytest.raises(BadMessage) as found:
        action()
    assert found.value.error == error
    return str(found.value)


def test_drive_without_the_wheels_is_refused(driving: Driving) -> None:
    assert refused("no_wheels", driving.drive) == "no client has the wheels"
    assert driving.commands == []


def test_driver_drives_at_the_chosen_pace(driving: Driving) -> None:
    assert driving.wheels.take("Ada", "Ada")
    driving.drive()
    assert driving.commands == [(Source.TELEOP, Velocity(0.5 * driving.base.limits.speed, 0.0))]


def test_second_client_waits_until_the_wheels_are_given(driving: Driving) -> None:
    driving.wheels.take("Ada", "Ada")
    assert not driving.wheels.take("Bob", "Bob")
    assert (driving.wheels.driver, driving.wheels.waiting_names) == ("Ada", ["Bob"])
    assert refused("no_wheels", lambda: driving.drive("Bob")) == "Ada drives"
    driving.wheels.give("Ada")
    assert (driving.wheels.driver, driving.wheels.waiting_names) == ("Bob", [])
    driving.drive("Bob")
    assert refused("no_wheels", driving.drive) == "Bob drives"


def test_base_stops_when_its_driver_gives_the_wheels(driving: Driving) -> None:
    driving.wheels.take("Ada", "Ada")
    driving.drive()
    driving.wheels.give("Ada")
    assert driving.stands


@pytest.mark.parametrize("number", [4, 5])
def test_the_base_stops_at_a_number_out_of_order_and_obeys_the_next(driving: Driving, number: int) -> None:
    driving.wheels.take("Ada", "Ada")
    driving.drive(number=5)
    refused("out_of_order", lambda: driving.drive(number=number))
    assert driving.stands
    driving.drive(number=6)
    assert not driving.stands


def test_the_base_stops_at_a_command_behind_which_an_old_state_is(driving: Driving) -> None:
    driving.wheels.take("Ada", "Ada")
    driving.drive()
    stamp = driving.wheels.stamp()
    driving.clock.advance(MAX_STATE_AGE - 0.01)
    driving.drive(ahead=0.0, stamp=stamp)
    driving.drive(stamp=stamp)
    assert driving.wheels.round_trip == pytest.approx(MAX_STATE_AGE - 0.01)
    driving.clock.advance(0.02)
    assert "0.5 s old" in refused("stale", lambda: driving.drive(stamp=stamp))
    assert driving.stands
    refused("let_go", driving.drive)
    refused("let_go", driving.look)
    assert driving.stands
    driving.drive(ahead=0.0)
    driving.drive()
    assert not driving.stands


@pytest.mark.parametrize("times", [(0.06, 0.12, 0.4, 0.49), ()])
def test_the_base_stops_once_the_newest_state_is_too_old_whether_commands_go_on_or_not(
    driving: Driving, times: tuple[float, ...]
) -> None:
    driving.wheels.take("Ada", "Ada")
    stamp = driving.wheels.stamp()
    driving.drive(stamp=stamp)
    for sent in times:
        driving.clock.advance_to(sent)
        driving.drive(stamp=stamp)
    assert driving.wheels.ends_at == MAX_STATE_AGE
    stood = []
    for moment in (MAX_STATE_AGE - 0.001, MAX_STATE_AGE):
        driving.clock.advance_to(moment)
        driving.wheels.check(moment)
        stood.append(driving.stands)
    assert stood == [False, True]
    refused("let_go", driving.drive)


def test_forged_stamps_are_refused(driving: Driving) -> None:
    driving.wheels.take("Ada", "Ada")
    driving.drive()
    newest = driving.wheels.stamp()
    for forged in {0, 1, newest + 1, newest - 1, 2**53, int(driving.clock.now()) + 1} - {newest}:
        driving.drive(ahead=0.0, stamp=newest)
        driving.drive(stamp=newest)
        assert "not of this run" in refused("stale", lambda stamp=forged: driving.drive(stamp=stamp))  # type: ignore[misc]
        assert driving.stands


def test_stamp_older_than_that_of_the_last_command_is_refused(driving: Driving) -> None:
    driving.wheels.take("Ada", "Ada")
    older = driving.wheels.stamp()
    driving.clock.advance(0.1)
    driving.drive()
    refused("out_of_order", lambda: driving.drive(stamp=older))
    assert driving.stands


def test_stamps_are_forgotten_after_a_while_and_never_alike(driving: Driving) -> None:
    driving.wheels.take("Ada", "Ada")
    first = driving.wheels.stamp()
    driving.clock.advance(STAMP_LIFETIME + 0.1)
    stamps = {driving.wheels.stamp() for _ in range(5000)}
    assert len(stamps) == 5000
    assert "over 10 s old" in refused("stale", lambda: driving.drive(stamp=first))


def test_an_old_state_keeps_the_head_still_too_and_stops_the_base(driving: Driving) -> None:
    driving.wheels.take("Ada", "Ada")
    driving.drive()
    stamp = driving.wheels.stamp()
    driving.clock.advance(MAX_STATE_AGE)
    refused("stale", lambda: driving.look(stamp=stamp))
    assert driving.stands
    assert not driving.head.commands


def test_taking_the_wheels_again_stops_the_base(driving: Driving) -> None:
    driving.wheels.take("Ada", "Ada")
    driving.drive()
    driving.wheels.take("Ada", "Ada")
    assert driving.stands
    assert driving.wheels.round_trip == 0.0


def test_the_base_stops_at_a_movement_of_the_head_out_of_order_too(driving: Driving) -> None:
    driving.wheels.take("Ada", "Ada")
    driving.drive(number=5)
    driving.number = 3
    refused("out_of_order", driving.look)
    assert driving.stands


def test_after_a_lost_link_one_has_to_let_go_before_the_base_obeys_again(driving: Driving) -> None:
    driving.wheels.take("Ada", "Ada")
    driving.drive()
    driving.clock.advance(MAX_STATE_AGE)
    for _ in range(3):
        refused("let_go", driving.drive)
    assert driving.stands
    driving.drive(ahead=0.0)
    driving.drive()
    assert not driving.stands


def test_driver_may_pause_with_the_stick_released(driving: Driving) -> None:
    driving.wheels.take("Ada", "Ada")
    driving.clock.advance(10.0)
    driving.drive()
    driving.drive(ahead=0.0)
    driving.clock.advance(10.0)
    driving.drive()


def test_a_latched_base_is_not_driven(driving: Driving) -> None:
    driving.wheels.take("Ada", "Ada")
    driving.base.latch("a button")
    assert refused("stopped", driving.drive) == "a button"


def test_the_head_turns_on_as_long_as_the_stick_is_pushed(driving: Driving) -> None:
    driving.wheels.take("Ada", "Ada")
    driving.look()
    driving.clock.advance(0.05)
    driving.look()
    pans = [target.pan for target in driving.head.commands if isinstance(target, HeadPose)]
    assert pans[1] - pans[0] == pytest.approx(0.05 * 1.047, rel=0.01)


def test_wheels_without_a_base_are_refused() -> None:
    wheels = WheelArbiter(None, None, ManualClock())
    with pytest.raises(BadMessage, match="no base"):
        wheels.take("Ada", "Ada")


def test_random_commands_take_every_transition_and_no_other(monkeypatch: pytest.MonkeyPatch) -> None:
    def drive(driving: Driving, chance: Random) -> None:
        with suppress(BadMessage):
            driving.drive(chance.choice(("Ada", "Bob")), ahead=chance.choice((0.0, 1.0)))

    def let_time_pass(driving: Driving, _: Random) -> None:
        driving.clock.advance(MAX_STATE_AGE + 0.01)
        driving.wheels.check(driving.clock.now())
        assert driving.wheels.ends_at == inf

    def stop(driving: Driving, _: Random) -> None:
        driving.wheels.stop()

    def take(driving: Driving, chance: Random) -> None:
        driving.wheels.take(name := chance.choice(("Ada", "Bob")), name)

    def give(driving: Driving, chance: Random) -> None:
        driving.wheels.give(chance.choice(("Ada", "Bob")))

    actions = [drive, drive, let_time_pass, stop, take, give]
    table = walk(monkeypatch, "missions.control.wheels.TRANSITIONS", Driving, actions)
    assert table.visited == set(table)
    assert not table.missing
