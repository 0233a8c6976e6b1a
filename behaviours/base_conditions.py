"""Conditions on the newest report of the base or of the range finder."""

import math
from abc import abstractmethod

from py_trees.common import Status

from behaviours.leaf import SUCCESS, Leaf, argument
from drivers.api import BaseState, Sides
from drivers.api.measures import length_text

# The leaf that asks whether something is near, by the range finder.


class ObstacleWithin(Leaf):
    """Check whether the range finder sees an obstacle within `distance`.

    Succeeds if the newest scan has one in a sector around straight ahead, fails if not. It answers at once, and is
    suspended while there is no recent scan. Distances are from the range finder, which does not see objects below its
    plane.
    """

    tag = "obstacle_within"
    example = "- obstacle_within: {distance: 0.5 m, sector: 40 deg}"
    needs = frozenset({"range"})
    instant = True
    distance: float = argument("length", "distance from the range finder", principal=True, low=0.0)
    sector: float = argument(
        "angle",
        "width of the sector around straight ahead",
        default=math.radians(60),
        low=math.radians(2),
        high=math.tau,
    )

    def update(self) -> Status:
        reading = self.robot.ranger.scan()
        if reading.value is None or not reading.good:
            return self.suspend("range finder")
        nearest = reading.value.nearest(0.0, self.sector)
        self.feedback_message = f"{length_text(nearest)} away" if math.isfinite(nearest) else "nothing in sight"
        return SUCCESS if nearest <= self.distance else self.fail(self.feedback_message)


SIDES = ("any", "left", "centre", "right")


class BaseCondition(Leaf):
    """Base class of conditions on the newest report of the base; suspended while there is no recent report."""

    needs = frozenset({"base"})
    instant = True

    def update(self) -> Status:
        reading = self.robot.base.state()
        if reading.value is None or not reading.good:
            return self.suspend("base")
        return self.judge(reading.value)

    @abstractmethod
    def judge(self, state: BaseState) -> Status:
        """Return SUCCESS, or fail with a reason, for the newest report ``state`` of the base."""


class _SideCondition(BaseCondition):
    """Base class of conditions on a sensor with a left, a centre and a right."""

    side: str = argument("choice", "side of the sensor", default="any", choices=SIDES, principal=True)
    noun: str

    def judge(self, state: BaseState) -> Status:
        sides = self.sensor_sides(state)
        on = bool(sides) if self.side == "any" else getattr(sides, self.side)
        self.feedback_message = f"{self.noun} {sides}" if sides else f"no {self.noun}"
        return SUCCESS if on else self.fail(self.feedback_message)

    @abstractmethod
    def sensor_sides(self, state: BaseState) -> Sides:
        """Return at which of its three sides (left, centre, right) the sensor is triggered."""


class Bumped(_SideCondition):
    """Check whether a bumper is pressed.

    Succeeds while it is pressed at the given side, or at any side; fails if not. It answers at once. After a base has
    backed off, the bumper is free again.
    """

    tag = "bumped"
    example = "- bumped: left"
    noun = "bumper"

    def sensor_sides(self, state: BaseState) -> Sides:
        return state.bumper


class Cliff(_SideCondition):
    """Check whether a cliff sensor sees no floor.

    Succeeds while the sensor of the given side, or any sensor, sees no floor; fails if not. It answers at once.
    """

    tag = "cliff"
    example = "- cliff"
    noun = "cliff"

    def sensor_sides(self, state: BaseState) -> Sides:
        return state.cliff


class BatteryBelow(BaseCondition):
    """Check whether the battery of the base is below a charge.

    Succeeds if the newest report is below `percent`, fails if not. It answers at once. Under load the charge dips for a
    moment. For a debounced value use `battery.low` or `battery.critical` in an expression, with the thresholds of the
    robot file.
    """

    tag = "battery_below"
    example = "- battery_below: 20 %"
    percent: float = argument("share", "charge of the battery", principal=True, low=0.0, high=1.0)

    def judge(self, state: BaseState) -> Status:
        self.feedback_message = f"the battery holds {state.battery_percent:.0f} %"
        return SUCCESS if state.battery_percent < 100 * self.percent else self.fail(self.feedback_message)


class Docked(BaseCondition):
    """Check whether the base stands on the contacts of its dock.

    Succeeds while it does, fails if not. It answers at once.
    """

    tag = "docked"
    example = "- docked"

    def judge(self, state: BaseState) -> Status:
        return SUCCESS if state.docked else self.fail("not on the dock")


class ButtonPressed(BaseCondition):
    """Check whether a button of the base is pressed.

    Succeeds while it is pressed, fails if not. It answers at once, so check it at every tick: a press is short.
    """

    tag = "button_pressed"
    example = "- button_pressed: 0"
    number: int = argument("count", "number of the button: 0, 1 or 2", principal=True, low=0, high=2)

    def judge(self, state: BaseState) -> Status:
        return SUCCESS if self.number in state.buttons else self.fail(f"button {self.number} is not pressed")
