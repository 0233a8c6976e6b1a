"""What was so in a run before somebody came to watch it: the way of its base, and the values of its variables."""

from collections import deque
from threading import Lock

from behaviours.robot import Robot
from missions.executive.events import Event, Ticked, VariableSet
from missions.views.words import in_words

PLACE_EVERY = 0.25
"""Seconds from one place of the base to the next."""

MOST_PLACES = 2000
"""Places of the way that are kept; of a longer one it is every second one, again and again."""

MOST_VALUES = 60
"""Values of each variable that are kept."""


class Past:
    """A listener that keeps what a page shows of before, however many watch; told from another thread."""

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._placed = float("-inf")
        self._way: list[tuple[float, float]] = []
        self._values: dict[str, deque[VariableSet]] = {}
        self._lock = Lock()

    def __call__(self, event: Event) -> None:
        """Keep an event."""
        if isinstance(event, VariableSet):
            with self._lock:
                name = f"{event.scope} {event.name}".lstrip()
                self._values.setdefault(name, deque(maxlen=MOST_VALUES)).append(event)
        elif isinstance(event, Ticked) and event.t - self._placed >= PLACE_EVERY and self._robot.base_part is not None:
            self._placed = event.t
            base = self._robot.base_part.state().value
            if base is not None and (place := (round(base.pose.x, 2), round(base.pose.y, 2))) not in self._way[-1:]:
                with self._lock:
                    self._way = [*self._way[:: 1 + (len(self._way) >= MOST_PLACES)], place]

    def told(self) -> dict[str, object]:
        """Return it as a scene has it."""
        with self._lock:
            way, values = self._way, {name: list(events) for name, events in self._values.items()}
        past = {
            name: [[each.t, None if each.value is None else in_words(each.value)] for each in events]
            for name, events in values.items()
        }
        return {"way": way, "past": past}
