"""Factories that make microphones from the keys of a robot file."""

from pathlib import Path

from drivers.api.driver import DriverContext
from drivers.api.sensor_sections import MicrophoneKeys
from drivers.microphone.declared import WavFileKeys
from drivers.microphone.sound_card import SoundCardMicrophone
from drivers.microphone.wav_microphone import WavMicrophone


def sound_card(keys: MicrophoneKeys, site: DriverContext) -> SoundCardMicrophone:
    """Return the microphone of the sound card that the robot file's section ``keys`` selects."""
    return SoundCardMicrophone(site.clock, device=keys.source, report=site.report)


def recording(keys: WavFileKeys, site: DriverContext) -> WavMicrophone:
    """Return a microphone that plays the WAV file of the robot file's section ``keys``.

    A relative path starts at the working folder.
    """
    return WavMicrophone(Path(keys.source).expanduser().absolute(), site.clock, report=site.report)
