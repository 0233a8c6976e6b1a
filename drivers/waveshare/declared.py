"""Declaration and keys of Waveshare's rovers."""

from collections.abc import Iterator

from drivers.api.driver import Driver
from drivers.api.keys import KeyDiagnostic, key, keys
from drivers.api.sections import BaseKeys, SerialKeys


@keys
class WaveshareKeys(BaseKeys, SerialKeys):
    """Keys of the base of a Waveshare rover."""

    max_speed: float = key("speed", default=0.5, low=0.01, high=2.0, help="Maximum speed.")
    encoders: bool = key(
        default=True,
        help="Whether it has encoders: UGV Rover, UGV Beast. Without (WAVE ROVER), its pose is dead reckoning.",
    )
    speed_at_full: float = key(
        "speed", default=1.25, low=0.05, high=5.0, help="Speed at full power; used only without encoders."
    )
    track: float = key(
        "length",
        default=0.172,
        low=0.02,
        high=2.0,
        help="Effective distance of its wheels; larger than measured if four wheels skid in turns.",
    )

    def diagnostics(self) -> Iterator[KeyDiagnostic]:
        """Yield a diagnostic for a maximum speed that the rover cannot reach."""
        if not self.encoders and self.max_speed > self.speed_at_full:
            most, full = f"{self.max_speed:g} m/s", f"{self.speed_at_full:g} m/s"
            message = f"'max_speed' ({most}) is above 'speed_at_full' ({full}): it cannot go that fast"
            yield KeyDiagnostic(message, ("max_speed",), ("speed_at_full",))


WAVESHARE = Driver(
    "waveshare",
    "base",
    "A rover of Waveshare's that speaks JSON: WAVE ROVER, UGV Rover, UGV Beast.",
    WaveshareKeys,
    make="drivers.waveshare.driver:make",
    twin="drivers.waveshare.twin:make",
    virtual="drivers.waveshare.virtual:make",
    probe="drivers.waveshare.probe:probe",
    usb=("10c4:ea60", "1a86:55d4"),
)
