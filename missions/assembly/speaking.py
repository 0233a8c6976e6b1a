"""The robot's voice: people hear what it says, and in a simulation it is printed."""

from collections.abc import Callable, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any

from config.robot import Section
from drivers.api import Voice
from drivers.voice.make import printed

if TYPE_CHECKING:
    from missions.assembly.assemble import Place


def real_voice(place: "Place", section: Section, made: Mapping[str, Any]) -> tuple[Voice, Voice]:
    """Return the voice of a robot; in a simulation it prints its words, and the people there hear them."""
    simulation = place.simulation
    if simulation is None:
        voice: Voice = place.device(section, made)
    else:
        out = partial(_aloud, place.audience.out, simulation.hear)
        voice = printed(section.keys, place.site(section, made, out))
    return voice, voice


def _aloud(out: Callable[[str], None], hear: Callable[[str], None], text: str) -> None:
    """Say ``text``, where people hear it."""
    out(text)
    hear(text)
