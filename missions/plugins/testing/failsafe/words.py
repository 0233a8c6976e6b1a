"""What comes of a setting of the failsafe page, in words."""

from collections.abc import Sequence
from math import degrees

from drivers.api import Source
from drivers.base.velocity_multiplexer import ONLY_LIMITED
from missions.plugins.testing.failsafe.ride import AWAY, Moment

WHO = {Source.MISSION: "the mission", Source.TELEOP: "the person"}

NOUNS = {"mission": "the mission", "person": "the person"}


def in_words(moment: Moment) -> str:
    """Return what the base does, why, and what whoever commands is told: "stands until it is enabled: cliff left"."""
    told = [f"{NOUNS[name]} {said}" for name in NOUNS if (said := getattr(moment, name))]
    return "; ".join([_base(moment), *told])


def _base(moment: Moment) -> str:
    if moment.latched:
        return f"stands until it is enabled: {moment.latched}"
    if AWAY in (moment.mission, moment.person):
        return "is not heard, so its firmware lets it stand"
    if not moment.source:
        return "stands: nobody commands it"
    if moment.source == Source.SAFETY:
        return f"{moment.because}, at {_speed(moment.given)}"
    who = WHO[Source(moment.source)]
    if not any(moment.wanted):
        return f"stands: {who} has the wheels, and is silent"
    if not any(moment.given):
        return f"stands, though {who} wants {_speed(moment.wanted)}: {moment.because}"
    if moment.because == ONLY_LIMITED:
        return f"{who} drives it at {_speed(moment.given)}, slowed down from {_speed(moment.wanted)}"
    if moment.because:
        return f"{who} drives it at {_speed(moment.given)} of {_speed(moment.wanted)}: {moment.because}"
    return f"{who} drives it at {_speed(moment.given)}"


def _speed(velocity: tuple[float, float]) -> str:
    linear, angular = velocity
    parts = [f"{linear:g} m/s"] if linear else []
    parts += [f"{degrees(angular):.0f} deg/s"] if angular else []
    return " and ".join(parts) or "0 m/s"


def steps(moments: Sequence[Moment]) -> Sequence[tuple[Moment, str]]:
    """Return the moments that say something new, with their words."""
    told: list[tuple[Moment, str]] = []
    for moment in moments:
        words = in_words(moment)
        if not told or told[-1][1] != words:
            told.append((moment, words))
    return told
