"""How what is being said is broken off: from another thread, at once, whatever is at work on it."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Event, RLock


class Cut:
    """Broken off or not; whoever works on an utterance says in ``then`` what is to be done at that moment."""

    def __init__(self) -> None:
        self._made = Event()
        self._lock = RLock()  # over what is done, which so happens within ``then`` or not at all
        self._act: Callable[[], None] | None = None

    @property
    def made(self) -> bool:
        """True once it was broken off."""
        return self._made.is_set()

    def make(self) -> None:
        """Break it off. Safe more than once, from any thread."""
        with self._lock:
            self._made.set()
            if self._act is not None:
                self._act()

    def wait(self, seconds: float) -> bool:
        """Wait until it is broken off, for so many seconds at most; True when it was."""
        return self._made.wait(max(0.0, seconds))

    @contextmanager
    def then(self, act: Callable[[], None]) -> Iterator[None]:
        """Within this, have ``act`` called when it is broken off; at once where it was already."""
        with self._lock:
            self._act = act
            if self.made:
                act()
        try:
            yield
        finally:
            with self._lock:
                self._act = None
