"""Who drives, and which commands count: on a clock of the test's own."""

from collections.abc import Callable

import pytest

from drivers.api import STILL, HeadPose, Source, Velocity
from drivers.clock import ManualClock
from missions.studio.commands import Drive, Look
from missions.studio.form import BadMessage
from missions.studio.wheels import ANEW, LATE, Wheels
from missions.testing.recorders import STOP, RecordedBase, RecordedHead


class Driving:
    """A base, two who want it, and the time."""

    def __init__(self) -> None:
        self.clock = ManualClock()
        self.base = RecordedBase(self.clock)
        self.head = RecordedHead(self.clock)
        self.wheels = Wheels(self.base, self.head, self.clock)
        self.number = 0

    def drive(
        self, who: str = "Ada", *, ahead: float = 1.0, sent: float | None = None, number: int | None = None
    ) -> None:
        self.number = self.number + 1 if number is None else number
        sent = self.clock.now() if sent is None else sent
        self.wheels.drive(who, Drive(n=self.number, t=sent, ahead=ahead, left=0.0, pace=0.5))

    def look(self, who: str = "Ada") -> None:
        self.number += 1
        self.wheels.look(who, Look(n=self.number, t=self.clock.now(), left=1.0, down=0.0))

    @property
    def commands(self) -> list[object]:
        return list(self.base.commands)

    @property
    def stands(self) -> bool:
        """Whether the last that the base heard is to stand."""
        return self.commands[-2:] == [STOP, (Source.TELEOP, STILL)]


@pytest.fixture
def driving() -> Driving:
    return Driving()


def refused(error: str, action: Callable[[], None]) -> str:
    with pytest.raises(BadMessage) as found:
        action()
    assert found.value.error == error
    return str(found.value)


def test_nobody_drives_who_has_not_taken_the_wheels(driving: Driving) -> None:
    assert refused("no_wheels", driving.drive) == "nobody has taken the wheels"
    assert driving.commands == []


def test_who_has_the_wheels_drives_at_the_pace_chosen(driving: Driving) -> None:
    assert driving.wheels.take("Ada", "Ada")
    driving.drive()
    assert driving.commands == [(Source.TELEOP, Velocity(0.5 * driving.base.limits.speed, 0.0))]


def test_the_second_one_asks_and_gets_them_when_they_are_given(driving: Driving) -> None:
    driving.wheels.take("Ada", "Ada")
    assert not driving.wheels.take("Bob", "Bob")
    assert (driving.wheels.driver, driving.wheels.asking) == ("Ada", ["Bob"])
    assert refused("no_wheels", lambda: driving.drive("Bob")) == "Ada drives"
    driving.wheels.give("Ada")
    assert (driving.wheels.driver, driving.wheels.asking) == ("Bob", [])
    driving.drive("Bob")
    assert refused("no_wheels", driving.drive) == "Bob drives"


def test_the_base_stops_when_its_driver_goes(driving: Driving) -> None:
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


def test_the_base_stops_at_a_command_that_was_long_on_its_way_whatever_clock_its_sender_has(driving: Driving) -> None:
    driving.wheels.take("Ada", "Ada")
    driving.drive(sent=-1e6)
    driving.clock.advance(LATE + 0.01)
    refused("late", lambda: driving.drive(sent=-1e6))
    assert driving.stands
    driving.drive(sent=-1e6 + LATE)
    assert not driving.stands


def test_the_base_stops_at_a_movement_of_the_head_out_of_order_too(driving: Driving) -> None:
    driving.wheels.take("Ada", "Ada")
    driving.drive(number=5)
    driving.number = 3
    refused("out_of_order", driving.look)
    assert driving.stands


def test_after_a_lost_link_one_has_to_let_go_before_the_base_obeys_again(driving: Driving) -> None:
    driving.wheels.take("Ada", "Ada")
    driving.drive()
    driving.clock.advance(ANEW + 0.1)
    for _ in range(3):
        assert "let go" in refused("late", driving.drive)
    assert driving.stands
    driving.drive(ahead=0.0)
    driving.drive()
    assert not driving.stands


def test_who_waits_with_the_stick_let_go_loses_nothing(driving: Driving) -> None:
    driving.wheels.take("Ada", "Ada")
    driving.clock.advance(10 * ANEW)
    driving.drive()
    driving.drive(ahead=0.0)
    driving.clock.advance(10 * ANEW)
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


def test_a_robot_without_a_base_says_so() -> None:
    wheels = Wheels(None, None, ManualClock())
    with pytest.raises(BadMessage, match="no base"):
        wheels.take("Ada", "Ada")
