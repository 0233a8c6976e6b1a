"""Declarations of the microphone drivers: one for the sound card, one for WAV files."""

from collections.abc import Iterator

from drivers.api.driver import Driver
from drivers.api.keys import KeyDiagnostic, key, keys
from drivers.api.sensor_sections import MicrophoneKeys


@keys
class WavFileKeys(MicrophoneKeys):
    """Keys of the ``microphone`` section for a WAV file, which plays when the robot is switched on."""

    source: str = key(default="", help="The path of the WAV file.")

    def diagnostics(self) -> Iterator[KeyDiagnostic]:
        if not self.source:
            yield KeyDiagnostic("a microphone with 'driver: file' needs 'source'", hint="source: commands.wav")
        yield from MicrophoneKeys.diagnostics(self)


MICROPHONE = Driver(
    "microphone",
    "microphone",
    "The sound card.",
    MicrophoneKeys,
    make="drivers.microphone.make:sound_card",
    checkup="drivers.microphone.checkup:checkup",
    extra="listen",
)
FILE = Driver(
    "file",
    "microphone",
    "A WAV file, which plays when the robot is switched on.",
    WavFileKeys,
    make="drivers.microphone.make:recording",
    extra="listen",
)
