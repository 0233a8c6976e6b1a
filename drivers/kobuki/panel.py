"""What a Kobuki has beside its wheels: tunes, lights, sockets, supplies, and the gains of its motors."""

from threading import RLock

from drivers.api import Lamp, Tune
from drivers.kobuki.commands import GetGains, Output, SetGains, SetOutputs, SoundSequence
from drivers.kobuki.outputs import Outputs
from drivers.kobuki.requests import TUNES, check_light, tone
from drivers.kobuki.wire import encode
from drivers.link import Link


class Panel:
    """Commands that do not move the base, sent over ``link``. Safe between threads."""

    def __init__(self, name: str, link: Link) -> None:
        self._name = name
        self._link = link
        # Held from the choice of a command until it is written, so that no older one can follow the zero of a stop.
        self._lock = RLock()
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

    def switch(self, output: Output, *, on: bool) -> None:
        """Switch sockets or supplies, and leave all others as they are. Raises NotConnected."""
        with self._lock:
            self._outputs.switch(output, on=on)
            self._link.write(encode(SetOutputs(self._outputs.word)))

    def set_gains(self, gains: SetGains) -> None:
        """Set the gains of the wheel controller until the base is switched off. Raises NotConnected."""
        self._link.write(encode(gains))

    def ask_gains(self) -> None:
        """Ask for the gains, which ``telemetry`` has once the base has answered. Raises NotConnected."""
        self._link.write(encode(GetGains()))

    def restore(self) -> None:
        """Switch everything as it was told so far, for a base that may have been off meanwhile. Raises NotConnected."""
        with self._lock:
            self._link.write(encode(SetOutputs(self._outputs.word)))
