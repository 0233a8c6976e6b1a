"""Texts for the moments that the failsafe view of the studio shows."""

from collections.abc import Sequence
from math import degrees

from drivers.api import Source
from drivers.base.velocity_multiplexer import ONLY_LIMITED
from missions.plugins.testing.failsafe.scenario import WAITING, ScenarioMoment

SOURCE_NAMES = {Source.MISSION: "the mission", Source.TELEOP: "the person"}

ROLE_NAMES = {"mission": "the mission", "person": "the person"}


def describe_moment(moment: ScenarioMoment) -> str:
    """Return a text of base state, reason and feedback: "stands until it is enabled: cliff left"."""
    parts = [f"{ROLE_NAMES[name]} {text}" for name in ROLE_NAMES if (text := getattr(moment, name))]
    return "; ".join([_describe_base(moment), *parts])


def _describe_base(moment: ScenarioMoment) -> str:
    if moment.latched:
        return f"stands until it is enabled: {moment.latched}"
    if WAITING in (moment.mission, moment.person):
        return "gets no commands, so its firmware stops it"
    if not moment.source:
        return "stands: no commands"
    if moment.source == Source.SAFETY:
        return f"{moment.reason}, at {_velocity_text(moment.limited)}"
    who = SOURCE_NAMES[Source(moment.source)]
    if not any(moment.setpoint):
        return f"stands: {who} has control, but sends no commands"
    if not any(moment.limited):
        return f"stands, although {who} commands {_velocity_text(moment.setpoint)}: {moment.reason}"
    if moment.reason == ONLY_LIMITED:
        return (
            f"{who} drives it at {_velocity_text(moment.limited)}, slowed down from {_velocity_text(moment.setpoint)}"
        )
    if moment.reason:
        return (
            f"{who} drives it at {_velocity_text(moment.limited)} of {_velocity_text(moment.setpoint)}: {moment.reason}"
        )
    return f"{who} drives it at {_velocity_text(moment.limited)}"


def _velocity_text(velocity: tuple[float, float]) -> str:
    linear, angular = velocity
    parts = [f"{linear:g} m/s"] if linear else []
    parts += [f"{degrees(angular):.0f} deg/s"] if angular else []
    return " and ".join(parts) or "0 m/s"


def distinct_moments(moments: Sequence[ScenarioMoment]) -> Sequence[tuple[ScenarioMoment, str]]:
    """Return the moments whose text differs from that of the moment before, with their texts."""
    found: list[tuple[ScenarioMoment, str]] = []
    for moment in moments:
        words = describe_moment(moment)
        if not found or found[-1][1] != words:
            found.append((moment, words))
    return found
