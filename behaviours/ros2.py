"""Leaves for ROS 2 nodes: Nav2 goals, services, topics, and actions of any type."""

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
    """Base class of requests that may drive the base: none starts while the base is latched, and a latch cancels it.

    A pause cancels it too. A ``repeatable`` request starts again at the next tick; others fail, since their goal may be
    a distance, which would be driven twice.
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
    """Drive to a place of the map with Nav2, by name or by coordinates.

    Running until the robot is there, then succeeds. Fails with Nav2's reason, for an unknown place, and if Nav2 rejects
    the goal or disconnects; whether the robot drives on then is unknown. Fails and cancels the goal while the base is
    latched. A halt cancels the goal and waits for its end.
    """

    tag = "navigate"
    example = "- navigate: {x: 2 m, y: 1 m, heading: 90 deg}"
    repeatable = True
    needs = frozenset({"ros2", "base"})
    output_doc = "the result that Nav2 reports"
    to: str = argument("text", "name of a place: `mission ros2 place list`", default="", principal=True)
    x: float | None = argument("length", "x on the map", default=None)
    y: float | None = argument("length", "y on the map", default=None)
    heading: float | None = argument("angle", "final heading; by default that of the place, or 0", default=None)

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
        feedback = parse_json(progress.feedback)
        left = feedback.get("distance_remaining") if isinstance(feedback, dict) else None
        if not isinstance(left, int | float):
            return f"Nav2: {progress.state}"
        again = feedback.get("number_of_recoveries") or 0
        return f"{length_text(left)} to go" + (f", {again} times stuck" if again else "")

    def update(self) -> Status:
        status = super().update()
        if status is not Status.RUNNING:
            self.robot.base.stop()
        return status


class NavigateThrough(Navigate):
    """Drive through several places of the map with Nav2, without stopping.

    Otherwise as `navigate`.
    """

    tag = "navigate_through"
    example = "- navigate_through: [hall, kitchen]"
    through: Any = argument("value", "names of the places, in order", default=(), principal=True)
    to: str = argument("text", "name of the last place, if it is not in the list", default="")

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
    """Return x, y, heading and frame of the place ``name`` in ``places``, the named places of the map.

    Raises BadRequest that lists the known places.
    """
    if name not in places:
        there = ", ".join(sorted(places)) or "none"
        raise BadRequest(f"unknown place '{name}'; places: {there}", hint=f"mission ros2 place add {name}")
    found: tuple[float, float, float, str] = places[name]
    return found


class CallService(Ros2RequestLeaf):
    """Call a ROS 2 service.

    Running until the response arrives, then succeeds; the response is the output. Fails if there is no response. To
    check the response, use a condition: `${answer.success}`.
    """

    tag = "call_service"
    example = "- call_service: {service: /reset, type: std_srvs/srv/Trigger}\n  as: answer"
    acts = True
    output_doc = "the response"
    service: str = argument("text", "name of the service", principal=True)
    type: str = argument("text", "type, `std_srvs/srv/Trigger`; by default that of the server", default="")
    values: Any = argument("value", "request by field", default=None)

    def halting(self) -> bool:
        return False  # a service cannot be cancelled: nothing would come of waiting

    def begin(self) -> int:
        return self.robot.ros2.call(self.service, self.type, as_json(self.values))


class Ros2Action(_DrivingRequestLeaf):
    """Run a ROS 2 action of any type. It counts as driving the base.

    Running until the action is over; its result is the output. Fails if it is rejected, aborted or cancelled, if its
    server disconnects, and while the base is latched. A halt cancels the action and waits for its end.
    """

    tag = "ros2_action"
    example = "- ros2_action: {action: /dock, type: irobot_create_msgs/action/Dock}"
    output_doc = "the result"
    action: str = argument("text", "name of the action", principal=True)
    type: str = argument("text", "type, `irobot_create_msgs/action/Dock`; by default that of the server", default="")
    goal: Any = argument("value", "goal by field", default=None)

    def begin(self) -> int:
        return self.robot.ros2.begin(self.action, self.type, as_json(self.goal))


class Publish(Leaf):
    """Publish a message on a ROS 2 topic.

    Succeeds at once, whether or not there is a subscriber.
    """

    tag = "publish"
    example = "- publish: {topic: /chatter, type: std_msgs/msg/String, values: {data: Hello}}"
    acts = True
    needs = frozenset({"ros2"})
    ends = frozenset({"success", "failure"})
    topic: str = argument("text", "name of the topic", principal=True)
    type: str = argument("text", "type, `std_msgs/msg/String`; by default that of the subscriber", default="")
    values: Any = argument("value", "message by field", default=None)

    def update(self) -> Status:
        self.robot.ros2.publish(self.topic, self.type, as_json(self.values))
        return SUCCESS


class TopicLeaf(Leaf):
    """Check a field of a topic's newest message.

    Succeeds while the field is within the bounds, fails if not. Without bounds, it checks that the field exists and is
    not false, zero or empty. It answers at once, and is suspended while no message is recent enough.
    """

    tag = "topic"
    example = "- topic: {topic: /battery_state, field: percentage, above: 0.2}"
    needs = frozenset({"ros2"})
    instant = True
    output_doc = "the value of the field"
    topic: str = argument("text", "name of the topic", principal=True)
    field: str = argument(
        "text", "field, `pose.pose.position.x` or `ranges[0]`; by default the whole message", default=""
    )
    above: float | None = argument("number", "lower bound of the field", default=None)
    below: float | None = argument("number", "upper bound of the field", default=None)
    equals: Any = argument("value", "expected value of the field", default=None)
    within: Duration = argument("duration", "maximum age of the message", default=Duration(2.0), low=0.0)

    def update(self) -> Status:
        reading = self.robot.ros2.latest(self.topic)
        if reading.value is None or self.run.now() - reading.stamp > self.within:
            return self.suspend(f"topic {self.topic}")
        try:
            value = field_value(parse_json(reading.value), self.field)
        except LookupError as error:
            return self.fail(f"{self.topic} has no {self.field}: {error}")
        self.result = value
        text = json.dumps(value)[:60]
        self.feedback_message = f"{self.field or self.topic} is {text}"
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
    """Return a field of a ROS 2 message by its ``path``, such as ``pose.position.x`` or ``ranges[0]``.

    An empty path is the whole message. Raises LookupError that lists the existing fields.
    """
    for part in path.replace("[", ".[").split(".") if path else ():
        if part.startswith("["):
            try:
                value = value[int(part[1:-1])]
            except (ValueError, TypeError, IndexError) as error:
                raise LookupError(_index_error(part[1:-1], value)) from error
        elif not isinstance(value, dict) or part not in value:
            fields = ", ".join(value) if isinstance(value, dict) else "none"
            raise LookupError(f"unknown field '{part}'; fields: {fields}")
        else:
            value = value[part]
    return value


def _index_error(index: str, value: Any) -> str:
    return f"index {index} out of range (length {len(value)})" if isinstance(value, list) else "not a list"


def as_json(values: Any) -> str:
    """Return values of a mission as JSON. Raises BadRequest for values that JSON cannot represent."""
    try:
        return json.dumps({} if values is None else values)
    except (TypeError, ValueError) as error:
        raise BadRequest(f"{values!r}: {error}", hint="give numbers, texts, lists and fields") from error
