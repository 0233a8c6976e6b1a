"""What the eyes take their pictures from."""

from typing import Protocol, runtime_checkable

from perception.api import Frame


class FrameSource(Protocol):
    """Where frames come from: a camera."""

    def read(self, timeout: float) -> Frame | None:
        """Wait up to ``timeout`` seconds for a frame newer than the last one read; None when none came."""
        ...


@runtime_checkable
class Skipping(Protocol):
    """A source that can let pictures go by, at less cost than to read them: a camera of the house."""

    def skip(self, pictures: int) -> None:
        """Let so many pictures go by after the newest that was read."""
        ...
