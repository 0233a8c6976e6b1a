"""What a camera thread takes its pictures from: a device, a stream, a recording or a folder."""

from typing import Protocol

from drivers.api import Image


class Feed(Protocol):
    """A source of pictures that may be absent, may end and may be started again. Used from one thread."""

    @property
    def what(self) -> str:
        """What the user calls it: a path, a device or an address."""
        ...

    @property
    def hint(self) -> str:
        """What to type next when it opens and yet gives no picture."""
        ...

    def start(self) -> float | None:
        """Open it; return the seconds between the pictures of a recording, or None for one that is live.

        Raises NotConnected when it is not there.
        """
        ...

    def grab(self) -> Image | None:
        """Return the next picture, waiting for it if it is live; None when there is no more."""
        ...

    def skip(self) -> bool:
        """Let the next picture go by without decoding it, as ``grab`` waits for it; False when there is no more."""
        ...

    def stop(self) -> None:
        """Release it. Safe from any state, more than once."""
        ...
