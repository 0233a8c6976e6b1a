"""Leaves for the nodes of ROS 2: driving to places by Nav2, services, topics, actions of any kind."""

import json
import math
from typing import Any, ClassVar

from py_trees.common import Status

from behaviours.driving.motion import latch_reason
from behaviours.leaf import SUCCESS, Leaf, argument
from behaviours.ros2_request import CANCELLED_STATES, Ros2RequestLeaf, has_ended, parse_json
from drivers.api import Duration, Progress
from drivers.api.measures import length_text
from drivers.errors import BadRequest


class _DrivingRequestLeaf(Ros2RequestLeaf):
    """A request that may drive the base: none is begun while that is latched, and one under way is cancelled.

    Paused, it is cancelled as well. One that is ``repeatable`` begins again at the next tick, others fail: their goal
    may be a distance, and twice begun be twice as far.
    """

    drives = frozenset({"base"})
    repeatable: ClassVar[bool] = False
    _cancelled_at: float | None = None  # when a pause has cancelled it

    def initialise(self) -> None:
        self._request_number = self._cancelled_at = None
        if not self._latch_reason():
            super().initialise()

    def update(self) -> Status:
        if latched := self._latch_reason():
            return self.fail(latched)
        if self._request_number is not None and self._cancelled_at is not None:
            if not has_ended(self.robot.ros2, self._request_number, self.run.now() - self._cancelled_at):
                return self.wait("waiting for the cancelled action to end")
            if self.robot.ros2.progress(self._request_number).state in CANCELLED_STATES:
                if not self.repeatable:
                    return self.fail("cancelled, since it was not ticked while a sensor was silent")
                self._request_number, self._cancelled_at = self.begin(), None
                return self.wait("begun again")
            self._cancelled_at = None
        return super().update()

    def on_pause(self) -> None:
        if self._request_number is not None and not self.robot.ros2.progress(self._request_number).is_final:
            self._cancelled_at = self.run.now()
            self.robot.ros2.cancel(self._request_number)

    def _latch_reason(self) -> str:
        return "" if self.robot.base_part is None else latch_reason(self.robot.base)


class Navigate(_DrivingRequestLeaf):
    """Have Nav2 drive to a place of the map, by name or by its figures.

    Running until it is there, then succeeds. Fails with Nav2's reason, where the place is not known, where the goal is
    rejected, and where Nav2 goes away: whether the robot drives on then is not known. Fails and cancels the goal while
    the base is stopped until somebody enables it. Halted, it cancels the goal and waits for its end.
    """

    tag = "navigate"
    repeatable = True
    needs = frozenset({"ros2", "base"})
    output_doc = "what Nav2 says in the end"
    to: str = argument("text", "the name of a place: `mission ros2 place list`", default="", principal=True)
    x: float | None = argument("length", "where it is on the map", default=None)
    y: float | None = argument("length", "where it is on the map", default=None)
    heading: float | None = argument("angle", "how to stand there; else as the place says, or 0", default=None)

    def begin(self) -> int:
        place, frame = self._place()
        return self.robot.ros2.navigate((place,), frame)

    def _place(self) -> tuple[tuple[float, float, float], str]:
        if self.to:
            x, y, heading, frame = find_place(self.robot.places, self.to)
            return (x, y, heading if self.heading is None else self.heading), frame
        if self.x is None or self.y is None:
            raise BadRequest("navigate: needs a place: a name, or x and y", hint="navigate: {to: kitchen}")
        return (self.x, self.y, self.heading or 0.0), "map"

    def progress_text(self, progress: Progress) -> str:
        told = parse_json(progress.feedback)
        left = told.get("distance_remaining") if isinstance(told, dict) else None
        if not isinstance(left, int | float):
            return f"Nav2: {progress.state}"
        again = told.get("number_of_recoveries") or 0
        return f"{length_text(left)} to go" + (f", {again} times stuck" if again else "")

    def update(self) -> Status:
        status = super().update()
        if status is not Status.RUNNING:
            self.robot.base.stop()
        return status


class NavigateThrough(Navigate):
    """Have Nav2 drive through places of the map, one after another, without a stop.

    As `navigate`, for several.
    """

    tag = "navigate_through"
    through: Any = argument("value", "the names of the places, in their order", default=(), principal=True)
    to: str = argument("text", "the name of the last place, if it is not among them", default="")

    def begin(self) -> int:
        names = [self.through] if isinstance(self.through, str) else list(self.through)
        names += [self.to] if self.to else []
        if not names:
            raise BadRequest("navigate_through: needs places", hint="navigate_through: [hall, kitchen]")
        found = [find_place(self.robot.places, str(name)) for name in names]
        frames = {frame for *_, frame in found}
        if len(frames) > 1:
            raise BadRequest(f"navigate_through: the places are in several frames: {', '.join(sorted(frames))}")
        return self.robot.ros2.navigate(tuple((x, y, heading) for x, y, heading, _ in found), frames.pop())


def find_place(places: Any, name: str) -> tuple[float, float, float, str]:
    """Return a place by its name. Raises BadRequest with those that there are."""
    if name not in places:
        there = ", ".join(sorted(places)) or "none yet"
        raise BadRequest(f"there is no place '{name}': there are {there}", hint=f"mission ros2 place add {name}")
    found: tuple[float, float, float, str] = places[name]
    return found


class CallService(Ros2RequestLeaf):
    """Ask a service of ROS 2.

    Running until it has answered, then succeeds; what it answered is kept. Fails where no answer comes. Whether the
    answer is a good one, a condition says: `${answer.success}`.
    """

    tag = "call_service"
    output_doc = "the answer"
    service: str = argument("text", "its name", principal=True)
    type: str = argument("text", "its type, `std_srvs/srv/Trigger`; else that of who offers it", default="")
    values: Any = argument("value", "what it is asked, by field", default=None)

    def halting(self) -> bool:
        return False  # a service cannot be cancelled: nothing would come of waiting

    def begin(self) -> int:
        return self.robot.ros2.call(self.service, self.type, as_json(self.values))


class Ros2Action(_DrivingRequestLeaf):
    """Have a node of ROS 2 do an action of any type. It counts as one that drives the base.

    Running until it is over; what it says in the end is kept. Fails where it is rejected, aborted or cancelled, and
    where its server goes away, and while the base is stopped until somebody enables it. Halted, it cancels the action
    and waits for its end.
    """

    tag = "ros2_action"
    output_doc = "the result"
    action: str = argument("text", "its name", principal=True)
    type: str = argument("text", "its type, `irobot_create_msgs/action/Dock`; else that of who offers it", default="")
    goal: Any = argument("value", "the goal, by field", default=None)

    def begin(self) -> int:
        return self.robot.ros2.begin(self.action, self.type, as_json(self.goal))


class Publish(Leaf):
    """Send a message on a topic of ROS 2.

    Succeeds at once; who hears it is not known.
    """

    tag = "publish"
    needs = frozenset({"ros2"})
    ends = frozenset({"success", "failure"})
    topic: str = argument("text", "the topic", principal=True)
    type: str = argument("text", "its type, `std_msgs/msg/String`; else that of who listens", default="")
    values: Any = argument("value", "the message, by field", default=None)

    def update(self) -> Status:
        self.robot.ros2.publish(self.topic, self.type, as_json(self.values))
        return SUCCESS


class TopicLeaf(Leaf):
    """Does a field of a topic's newest message say so?

    Succeeds while it does, fails when not. With no bounds it asks whether the field is there and not false, zero or
    empty. It never runs, and is suspended while no message is there, or none new enough.
    """

    tag = "topic"
    needs = frozenset({"ros2"})
    instant = True
    output_doc = "what the field says"
    topic: str = argument("text", "the topic", principal=True)
    field: str = argument("text", "the field, `pose.pose.position.x` or `ranges[0]`; else all of it", default="")
    above: float | None = argument("number", "it is above that", default=None)
    below: float | None = argument("number", "it is below that", default=None)
    equals: Any = argument("value", "it is that", default=None)
    within: Duration = argument("duration", "how new the message is to be", default=Duration(2.0), low=0.0)

    def update(self) -> Status:
        reading = self.robot.ros2.latest(self.topic)
        if reading.value is None or self.run.now() - reading.stamp > self.within:
            return self.suspend(f"topic {self.topic}")
        try:
            value = field_value(parse_json(reading.value), self.field)
        except LookupError as error:
            return self.fail(f"{self.topic} has no {self.field}: {error}")
        self.result = value
        shown = json.dumps(value)[:60]
        self.feedback_message = f"{self.field or self.topic} is {shown}"
        return SUCCESS if self._holds(value) else self.fail(self.feedback_message)

    def _holds(self, value: Any) -> bool:
        if self.equals is not None:
            return bool(value == self.equals)
        if self.above is None and self.below is None:
            return bool(value)
        above, below = (
            (-math.inf if self.above is None else self.above),
            (math.inf if self.below is None else self.below),
        )
        return isinstance(value, int | float) and above < value < below


def field_value(value: Any, path: str) -> Any:
    """Return a field of a message by its path. Raises LookupError with what there is."""
    for part in path.replace("[", ".[").split(".") if path else ():
        if part.startswith("["):
            try:
                value = value[int(part[1:-1])]
            except (ValueError, TypeError, IndexError) as error:
                raise LookupError(f"'{part}' is no place of a list of {_length(value)}") from error
        elif not isinstance(value, dict) or part not in value:
            there = ", ".join(value) if isinstance(value, dict) else "no fields"
            raise LookupError(f"no '{part}' in it: there are {there}")
        else:
            value = value[part]
    return value


def _length(value: Any) -> int:
    return len(value) if isinstance(value, list) else 0


def as_json(values: Any) -> str:
    """Return values of a mission as JSON. Raises BadRequest for what has no form there."""
    try:
        return json.dumps({} if values is None else values)
    except (TypeError, ValueError) as error:
        raise BadRequest(f"{values!r}: {error}", hint="give numbers, texts, lists and fields") from error
