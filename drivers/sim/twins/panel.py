"""What the twin of a Kobuki has beside its wheels: tunes and lights, noted where nobody hears or sees them."""

from drivers.api import Lamp, Tune
from drivers.base.requests import LIGHTS, check_light, check_tone
from drivers.sim.twins.plug import Plug


class PanelTwin:
    """Commands that do not move the base. For one thread.

    ``played`` are the tunes and tones (hertz, seconds) that it was asked for, ``lights`` the colours of its lights.
    """

    def __init__(self, name: str, plug: Plug) -> None:
        self._name = name
        self.plug = plug
        self.played: list[Tune | tuple[float, float]] = []
        self.lights: dict[int, Lamp] = dict.fromkeys(LIGHTS, Lamp.OFF)

    def play(self, tune: Tune) -> None:
        """Note a tune in ``played``. Raises NotConnected."""
        self.plug.require()
        self.played.append(tune)

    def tone(self, frequency: float, seconds: float) -> None:
        """Note a tone in ``played``. Raises BadRequest, NotConnected."""
        check_tone(self._name, frequency, seconds)
        self.plug.require()
        self.played.append((frequency, seconds))

    def light(self, number: int, colour: Lamp) -> None:
        """Switch light 1 or 2. Raises BadRequest for another, NotConnected."""
        check_light(self._name, number)
        self.plug.require()
        self.lights[number] = colour
