"""What a behaviour sees of a voice."""

from typing import Protocol

from drivers.api.device import Device


class Utterance(Protocol):
    """Something being said, or waiting to be."""

    def done(self) -> bool:
        """True once it was spoken to the end, or cancelled."""
        ...

    def cancel(self) -> None:
        """Fall silent now. Safe more than once."""
        ...


class Voice(Device, Protocol):
    """What the robot speaks with."""

    def say(self, text: str) -> Utterance:
        """Start to speak ``text``, after whatever is being said; returns at once."""
        ...
