"""From the keys of a robot file to a microphone."""

from pathlib import Path

from drivers.api.driver import Site
from drivers.api.senses import MicrophoneKeys
from drivers.microphone.captured import CapturedMicrophone
from drivers.microphone.declared import FileKeys
from drivers.microphone.wav import WavMicrophone


def sound_card(keys: MicrophoneKeys, site: Site) -> CapturedMicrophone:
    """Return the microphone of the sound card."""
    return CapturedMicrophone(site.clock, device=keys.source, report=site.report)


def recording(keys: FileKeys, site: Site) -> WavMicrophone:
    """Return a recording as a microphone; a relative path goes from the working folder."""
    return WavMicrophone(Path(keys.source).expanduser().absolute(), site.clock, report=site.report)
