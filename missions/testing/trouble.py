"""Makes what a test file gives go wrong: at its time, and right again, by the hand that twins have for tests."""

import math
from collections.abc import Iterable
from functools import partial

from drivers.api import Sides
from drivers.sim.twins.base import BaseTwin
from drivers.sim.twins.plug import Plug
from missions.assembly.twins import Twins
from missions.testing.history import History
from missions.testing.mishaps import Mishap
from missions.testing.moments import Happening


class Trouble:
    """All that goes wrong with the twins of one run."""

    def __init__(self, twins: Twins, history: History) -> None:
        self._twins = twins
        self._history = history
        self._felt: list[Mishap] = []  # what the base is made to feel now

    def arrange(self, mishaps: Iterable[Mishap]) -> None:
        """See to it that each happens when it is due; what is so from the beginning is so at once."""
        for mishap in mishaps:
            if mishap.moment is not None:
                self._wait(mishap)
            elif mishap.start > 0.0:
                self._twins.timeline.at(mishap.start, partial(self._begin, mishap))
            else:
                self._begin(mishap)

    def _wait(self, mishap: Mishap) -> None:
        """Let it happen when its moment comes for the first time: after that tick, not within it."""

        def hear(happening: Happening) -> None:
            if mishap.moment is not None and mishap.moment.fits(happening):
                self._history.told.remove(hear)
                self._twins.timeline.at(self._now(), partial(self._begin, mishap))

        self._history.told.append(hear)

    def _begin(self, mishap: Mishap) -> None:
        self._switch(mishap, on=True)
        if mishap.seconds < math.inf:
            self._twins.timeline.at(self._now() + mishap.seconds, partial(self._switch, mishap, on=False))

    def _now(self) -> float:
        return self._twins.timeline.clock.now()

    def _switch(self, mishap: Mishap, *, on: bool) -> None:
        """Begin or end it. The checker has made sure that the part is there."""
        twins = self._twins
        plug = _plug(twins, mishap.part)
        match mishap.state:
            case "unplugged" if plug is not None:
                plug.unplug() if on else plug.plug_in()
            case "overloaded" if twins.arm is not None:
                twins.arm.overload(mishap.detail)
            case "turned" if twins.arm is not None:
                twins.arm.turn_by_hand(mishap.detail, mishap.amount)
            case "frozen" if twins.camera is not None:
                twins.camera.freeze() if on else twins.camera.thaw()
            case "covered" if twins.camera is not None:
                twins.camera.cover() if on else twins.camera.uncover()
            case "deaf" if twins.microphone is not None:
                twins.microphone.dulled = on
            case _ if twins.base is not None:
                self._switch_base(twins.base, mishap, on=on)

    def _switch_base(self, base: BaseTwin, mishap: Mishap, *, on: bool) -> None:
        match mishap.state:
            case "lifted":
                base.lift(up=on)
            case "docked":
                base.feed(on=on)
            case "battery":
                base.drain(100.0 * mishap.amount)
            case _:
                self._felt = felt = [each for each in self._felt if each is not mishap] + ([mishap] if on else [])
                buttons = frozenset(int(each.detail) for each in felt if each.state == "button")
                base.press(_sides(felt, "bumped"), cliff=_sides(felt, "cliff"), buttons=buttons)


def _sides(mishaps: list[Mishap], state: str) -> Sides:
    sides = {mishap.detail for mishap in mishaps if mishap.state == state}
    return Sides(left="left" in sides, centre="centre" in sides, right="right" in sides)


def _plug(twins: Twins, part: str) -> Plug | None:
    twin = twins.parts.get(part)
    return None if twin is None else twin.plug
