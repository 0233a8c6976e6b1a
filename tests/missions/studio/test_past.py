"""What a run tells of before somebody came to watch it."""

from behaviours.robot import Robot
from drivers.api import BaseState, Pose2D, Quality, Reading, Velocity
from missions.control.state_feed import MAX_POSITIONS, MAX_VALUES, POSITION_INTERVAL, RunHistory
from missions.executive.events import Ticked, VariableSet


class Rolling:
    """A base that goes ahead by 1 m whenever it is looked at."""

    x = -1.0

    def state(self) -> Reading[BaseState]:
        self.x += 1.0
        return Reading(BaseState(Pose2D(self.x, 0.0, 0.0), Velocity(0.0, 0.0)), 0.0, Quality.GOOD)


def test_history_keeps_the_last_values_of_a_variable_with_times() -> None:
    past = RunHistory(Robot())
    for t in range(100):
        past(VariableSet(float(t), t, "1.2", "count", t if t < 99 else None))
    told = past.as_dict()["past"]
    assert isinstance(told, dict)
    assert len(told["1.2 count"]) == MAX_VALUES
    assert told["1.2 count"][-2:] == [[98.0, "98"], [99.0, None]]


def test_long_route_is_thinned_and_keeps_its_ends() -> None:
    past = RunHistory(Robot(base_part=Rolling()))  # type: ignore[arg-type]
    for tick in range(3 * MAX_POSITIONS):
        past(Ticked(tick * POSITION_INTERVAL, tick, "running", None))
    way = past.as_dict()["way"]
    assert isinstance(way, list)
    assert MAX_POSITIONS / 2 < len(way) <= MAX_POSITIONS
    assert (way[0], way[-1]) == ((0.0, 0.0), (3.0 * MAX_POSITIONS - 1, 0.0))


def test_a_robot_without_a_base_has_no_way() -> None:
    past = RunHistory(Robot())
    past(Ticked(1.0, 1, "running", None))
    assert past.as_dict() == {"way": [], "past": {}}
