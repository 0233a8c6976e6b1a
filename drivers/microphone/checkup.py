"""Checkup of a microphone: whether sound arrives, and its level."""

from collections.abc import Iterator
from contextlib import closing
from threading import Event

import numpy as np

from drivers.api.driver import DriverContext, Finding, failure, warning
from drivers.api.sensor_sections import MicrophoneKeys
from drivers.api.sensors import Microphone
from drivers.microphone.make import sound_card

LISTEN_TIMEOUT = 1.5
"""Seconds within which ``MIN_SOUND_SECONDS`` of sound must arrive."""

MIN_SOUND_SECONDS = 0.5

MAX_CLIPPED_SHARE = 0.01
"""Share of clipped samples above which a microphone is too loud."""


def checkup(keys: MicrophoneKeys, site: DriverContext) -> Iterator[Finding]:
    """Record sound for half a second, and yield the findings."""
    yield from check_microphone(sound_card(keys, site), site)


def check_microphone(microphone: Microphone, site: DriverContext) -> Iterator[Finding]:
    """Record with ``microphone``, close it, and yield the findings."""
    pause, end = Event(), site.clock.now() + LISTEN_TIMEOUT
    with closing(microphone):
        microphone.open()
        while site.clock.now() < end:
            heard = microphone.read(-1)
            if heard and heard[-1].end - heard[0].stamp >= MIN_SOUND_SECONDS:
                break
            pause.wait(0.05)
        heard, health = microphone.read(-1), microphone.health()
    if not heard:
        yield failure("sound", health.detail or "none arrives", health.hint or "arecord -l  (is there a microphone?)")
        return
    samples = np.concatenate([sound.samples for sound in heard]).astype(float)
    level = float(np.sqrt(np.mean(samples**2))) / 32768
    if not samples.any():
        yield warning(
            "sound", "all samples are zero: it is muted", "alsamixer  (F4 shows what records; M lifts the mute)"
        )
    elif float(np.mean(np.abs(samples) >= 32767)) > MAX_CLIPPED_SHARE:
        yield warning("sound", "it is too loud: the sound is clipped", "alsamixer  (F4 shows what records)")
    else:
        yield Finding("sound", f"level {20 * np.log10(level):.0f} dB of full scale")
