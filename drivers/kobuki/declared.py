"""Declaration of the Kobuki driver, and the keys of its section in a robot file."""

from drivers.api.driver import Driver
from drivers.api.keys import key, keys
from drivers.api.sections import BaseKeys, SerialKeys


@keys
class KobukiKeys(BaseKeys, SerialKeys):
    """Keys of the ``base`` section of a robot file for a Kobuki, with the limits of its values."""

    max_speed: float = key("speed", default=0.5, low=0.01, high=0.7, help="Maximum speed.")
    max_turn: float = key("turn rate", default=1.9, low=0.01, high=3.2, help="Maximum turn rate.")

    @property
    def capabilities(self) -> frozenset[str]:
        """Optional capabilities of a Kobuki: sounder and lights."""
        return frozenset({"sounds", "lights"})


KOBUKI = Driver(
    "kobuki",
    "base",
    "A Kobuki, the base of a TurtleBot 2.",
    KobukiKeys,
    make="drivers.kobuki.driver:make",
    twin="drivers.kobuki.twin:make",
    virtual="drivers.kobuki.virtual:make",
    probe="drivers.kobuki.probe:probe",
    checkup="drivers.kobuki.checkup:checkup",
    usb=("0403:6001:kobuki_*",),
)
