"""The tunes and lights of a Kobuki."""

from threading import RLock

from drivers.api import Lamp, Tune
from drivers.kobuki.commands import SetOutputs, SoundSequence
from drivers.kobuki.requests import TUNES, Outputs, check_light, tone
from drivers.kobuki.wire import encode
from drivers.link import Link


class Panel:
    """Commands that do not move the base, sent over ``link``. Safe between threads, which ``lock`` is for."""

    def __init__(self, name: str, link: Link, lock: "RLock") -> None:
        self._name = name
        self._link = link
        self._lock = lock
        self._outputs = Outputs()

    def play(self, tune: Tune) -> None:
        """Play one of the tunes that the base knows. Raises NotConnected."""
        self._link.write(encode(SoundSequence(TUNES[tune])))

    def tone(self, frequency: float, seconds: float) -> None:
        """Play one tone of ``frequency`` hertz, for 0.255 s at most. Raises BadRequest, NotConnected."""
        self._link.write(encode(tone(self._name, frequency, seconds)))

    def light(self, number: int, colour: Lamp) -> None:
        """Switch light 1 or 2. Raises BadRequest for another, NotConnected."""
        check_light(self._name, number)
        with self._lock:
            self._outputs.light(number, colour)
            self._link.write(encode(SetOutputs(self._outputs.word)))

    def restore(self) -> None:
        """Switch everything as it was told so far, for a base that may have been off meanwhile. Raises NotConnected."""
        with self._lock:
            self._link.write(encode(SetOutputs(self._outputs.word)))
