"""Leaves that ask what the base feels: five conditions on its newest report."""

import math
from abc import abstractmethod

from py_trees.common import Status

from behaviours.leaf import SUCCESS, Leaf, argument
from drivers.api import BaseState, Sides
from drivers.api.measures import length_text

# The leaf that asks whether something is near, by the range finder.


class ObstacleWithin(Leaf):
    """Does the range finder see something nearer than that?

    Succeeds when the newest turn of the finder has something within the distance, in a sector about straight ahead;
    fails when not. It never runs, and is suspended while there is no fresh turn. Distances are from the finder; what is
    lower than it looks, it does not see.
    """

    tag = "obstacle_within"
    needs = frozenset({"range"})
    instant = True
    distance: float = argument("length", "how near", principal=True, low=0.0)
    sector: float = argument("angle", "how wide to look", default=math.radians(60), low=math.radians(2), high=math.tau)

    def update(self) -> Status:
        reading = self.robot.ranger.scan()
        if reading.value is None or not reading.good:
            return self.suspend("range finder")
        nearest = reading.value.nearest(0.0, self.sector)
        self.feedback_message = f"{length_text(nearest)} away" if math.isfinite(nearest) else "nothing in sight"
        return SUCCESS if nearest <= self.distance else self.fail(self.feedback_message)


SIDES = ("any", "left", "centre", "right")


class BaseCondition(Leaf):
    """Judges the base's newest report; suspended while there is no fresh one."""

    needs = frozenset({"base"})
    instant = True

    def update(self) -> Status:
        reading = self.robot.base.state()
        if reading.value is None or not reading.good:
            return self.suspend("base")
        return self.judge(reading.value)

    @abstractmethod
    def judge(self, state: BaseState) -> Status:
        """Succeed or fail by what is felt."""


class _SideCondition(BaseCondition):
    """Is something felt at a side?"""

    side: str = argument("choice", "where", default="any", choices=SIDES, principal=True)
    noun: str

    def judge(self, state: BaseState) -> Status:
        felt = self.sensor_sides(state)
        on = bool(felt) if self.side == "any" else getattr(felt, self.side)
        self.feedback_message = f"{self.noun} {felt}" if felt else f"no {self.noun}"
        return SUCCESS if on else self.fail(self.feedback_message)

    @abstractmethod
    def sensor_sides(self, state: BaseState) -> Sides:
        """Return the sensor's left, centre and right."""


class Bumped(_SideCondition):
    """Is a bumper pressed?

    Succeeds while it is, there or anywhere, fails when not. It never runs. A base that has backed off after a bump does
    not feel it any more.
    """

    tag = "bumped"
    noun = "bumper"

    def sensor_sides(self, state: BaseState) -> Sides:
        return state.bumper


class Cliff(_SideCondition):
    """Does a cliff sensor see no floor?

    Succeeds while one does not, there or anywhere, fails when all see it. It never runs.
    """

    tag = "cliff"
    noun = "cliff"

    def sensor_sides(self, state: BaseState) -> Sides:
        return state.cliff


class BatteryBelow(BaseCondition):
    """Is the base's battery lower than that?

    Succeeds when its newest report says so, fails when not. It never runs. Under load the figure dips for a moment;
    `battery.low` and `battery.critical` in expressions are sure of it, by the thresholds of the robot file.
    """

    tag = "battery_below"
    percent: float = argument("share", "how full", principal=True, low=0.0, high=1.0)

    def judge(self, state: BaseState) -> Status:
        self.feedback_message = f"the battery holds {state.battery_percent:.0f} %"
        return SUCCESS if state.battery_percent < 100 * self.percent else self.fail(self.feedback_message)


class Docked(BaseCondition):
    """Does the base stand on the contacts of its dock?

    Succeeds while it does, fails when not. It never runs.
    """

    tag = "docked"

    def judge(self, state: BaseState) -> Status:
        return SUCCESS if state.docked else self.fail("not on the dock")


class ButtonPressed(BaseCondition):
    """Is a button of the base pressed?

    Succeeds while it is, fails when not. It never runs, so it has to be asked in time: a press is over in a moment.
    """

    tag = "button_pressed"
    number: int = argument("count", "which: 0, 1 or 2", principal=True, low=0, high=2)

    def judge(self, state: BaseState) -> Status:
        return SUCCESS if self.number in state.buttons else self.fail(f"button {self.number} is not pressed")
