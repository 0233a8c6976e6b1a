"""How a microphone is: whether sound arrives, and whether it is more than silence."""

from collections.abc import Iterator
from contextlib import closing
from threading import Event

import numpy as np

from drivers.api.driver import Finding, Site, warning, wrong
from drivers.api.senses import MicrophoneKeys
from drivers.api.sensors import Microphone
from drivers.microphone.make import sound_card

LISTEN = 1.5
"""Seconds in which half a second of sound must come."""

PIECES = 0.5

CLIPPED = 0.01
"""The share of samples at the ends of the range above which a microphone is too loud."""


def checkup(keys: MicrophoneKeys, site: Site) -> Iterator[Finding]:
    """Listen for half a second."""
    yield from listened(sound_card(keys, site), site)


def listened(microphone: Microphone, site: Site) -> Iterator[Finding]:
    """Listen by a microphone, which is closed then."""
    pause, end = Event(), site.clock.now() + LISTEN
    with closing(microphone):
        microphone.open()
        while site.clock.now() < end:
            heard = microphone.read(-1)
            if heard and heard[-1].end - heard[0].stamp >= PIECES:
                break
            pause.wait(0.05)
        heard, health = microphone.read(-1), microphone.health()
    if not heard:
        yield wrong("sound", health.detail or "none arrives", health.hint or "arecord -l  (is there a microphone?)")
        return
    samples = np.concatenate([sound.samples for sound in heard]).astype(float)
    level = float(np.sqrt(np.mean(samples**2))) / 32768
    if not samples.any():
        yield warning("sound", "nothing but zeros: it is muted", "alsamixer  (F4 shows what records; M lifts the mute)")
    elif float(np.mean(np.abs(samples) >= 32767)) > CLIPPED:
        yield warning("sound", "it is too loud: the sound is cut off", "alsamixer  (F4 shows what records)")
    else:
        yield Finding("sound", f"level {20 * np.log10(level):.0f} dB of full scale")
