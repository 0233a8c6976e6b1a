"""The failsafe page: what it says is what the real driver does with a virtual Kobuki at the end of its wire."""

from math import inf
from random import Random

import pytest

from drivers.api import Sides
from drivers.base.arbitrated import settings_of
from drivers.kobuki.driver import IDLE_POLL_INTERVAL, kobuki_base
from drivers.kobuki.virtual import VirtualKobuki
from drivers.sim.timeline import Timeline
from missions.plugins.testing.failsafe.scenario import (
    CHOICES,
    NOTHING,
    FailsafeScenario,
    FailsafeSetting,
    NullCallbacks,
    ScenarioMoment,
    keys_for,
    run_scenario,
)
from missions.plugins.testing.failsafe.staged_ranger import StagedRanger
from tests.drivers.cranked import HandWire
from tests.tries import tries

SETTINGS = tries(10, most=200)
SOON, NEAR = 0.1, 0.03
"""Seconds and metres by which a wire, and a driver that looks at it 200 times a second, may differ from a twin."""


ON_ITS_WAY = 0.045 + IDLE_POLL_INTERVAL
"""Seconds for which something must hold to count: a command takes two reports over a wire, and one that stands is not
looked at for a while."""


class WireHand:
    """A ``Hand`` on a virtual Kobuki, which the real driver talks to."""

    def __init__(self, setting: FailsafeSetting, timeline: Timeline) -> None:
        self.kobuki = VirtualKobuki()
        self.wire = HandWire(self.kobuki, timeline)
        self.base = kobuki_base(
            self.wire.link("base"), timeline.clock, **settings_of(keys_for(setting), NullCallbacks())
        )
        self.ranger = StagedRanger(self.base, timeline.clock)

    def press_sensors(
        self, bumper: Sides = NOTHING, cliff: Sides = NOTHING, buttons: frozenset[int] = frozenset()
    ) -> None:
        self.kobuki.bumper, self.kobuki.cliff, self.kobuki.buttons = bumper, cliff, buttons

    def lift(self, *, up: bool) -> None:
        self.kobuki.body.lifted = up

    def set_plugged(self, *, is_plugged: bool) -> None:
        if is_plugged:
            self.wire.plug_in()
        else:
            self.wire.unplug()

    def set_battery(self, percent: float, *, charging: bool) -> None:
        self.kobuki.body.battery.percent, self.kobuki.body.force_docked = percent, charging


def on_the_wire(setting: FailsafeSetting) -> list[ScenarioMoment]:
    timeline = Timeline()
    return list(FailsafeScenario(setting, timeline, WireHand(setting, timeline)).play())


def lasting(moments: list[ScenarioMoment]) -> list[ScenarioMoment]:
    """Return what held for longer than the wire takes."""
    ends = [*(each.t for each in moments[1:]), inf]
    kept = [one for one, end in zip(moments, ends, strict=True) if end - one.t > ON_ITS_WAY]
    return [one for at, one in enumerate(kept) if at == 0 or one.compared_fields != kept[at - 1].compared_fields]


def drawn(seed: int) -> FailsafeSetting:
    chance = Random(f"failsafe {seed}")  # noqa: S311 - a draw is no secret
    return FailsafeSetting(**{name: chance.choice(words) for name, words in CHOICES.items()})


@pytest.mark.parametrize("first", range(0, SETTINGS, 10))
def test_failsafe_scenario_matches_the_driver_with_a_virtual_kobuki(first: int) -> None:
    for seed in range(first, first + 10):
        setting = drawn(seed)
        page, wire = lasting(list(run_scenario(setting))), lasting(on_the_wire(setting))
        assert [each.compared_fields for each in page] == [each.compared_fields for each in wire], setting
        assert [each.t for each in page] == pytest.approx([each.t for each in wire], abs=SOON), setting
        assert [each.ahead for each in page] == pytest.approx([each.ahead for each in wire], abs=NEAR), setting


@pytest.mark.parametrize("fault", ["something 2 cm ahead for 2 s", "no scans for 4 s"])
@pytest.mark.parametrize("wish", ["ahead", "back"])
def test_range_guard_behaves_the_same_over_the_wire(fault: str, wish: str) -> None:
    setting = FailsafeSetting(fault=fault, wish=wish)
    page, wire = lasting(list(run_scenario(setting))), lasting(on_the_wire(setting))
    assert [each.compared_fields for each in page] == [each.compared_fields for each in wire]
    assert any("range finder" in each.reason or "in the way" in each.reason for each in page) is (
        fault.startswith("no scans") or wish == "ahead"
    )
