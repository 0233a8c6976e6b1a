"""What a run tells of before somebody came to watch it."""

from behaviours.robot import Robot
from drivers.api import BaseState, Pose2D, Quality, Reading, Velocity
from missions.control.outlet import MOST_PLACES, MOST_VALUES, PLACE_EVERY, Past
from missions.executive.events import Ticked, VariableSet


class Rolling:
    """A base that goes ahead by 1 m whenever it is looked at."""

    x = -1.0

    def state(self) -> Reading[BaseState]:
        self.x += 1.0
        return Reading(BaseState(Pose2D(self.x, 0.0, 0.0), Velocity(0.0, 0.0)), 0.0, Quality.GOOD)


def test_the_last_values_of_a_variable_are_told_and_when_they_were_so() -> None:
    past = Past(Robot())
    for t in range(100):
        past(VariableSet(float(t), t, "1.2", "count", t if t < 99 else None))
    told = past.told()["past"]
    assert isinstance(told, dict)
    assert len(told["1.2 count"]) == MOST_VALUES
    assert told["1.2 count"][-2:] == [[98.0, "98"], [99.0, None]]


def test_of_a_long_way_every_second_place_is_kept_and_its_two_ends() -> None:
    past = Past(Robot(base_part=Rolling()))  # type: ignore[arg-type]
    for tick in range(3 * MOST_PLACES):
        past(Ticked(tick * PLACE_EVERY, tick, "running", None))
    way = past.told()["way"]
    assert isinstance(way, list)
    assert MOST_PLACES / 2 < len(way) <= MOST_PLACES
    assert (way[0], way[-1]) == ((0.0, 0.0), (3.0 * MOST_PLACES - 1, 0.0))


def test_a_robot_without_a_base_has_no_way() -> None:
    past = Past(Robot())
    past(Ticked(1.0, 1, "running", None))
    assert past.told() == {"way": [], "past": {}}
