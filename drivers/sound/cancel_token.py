"""How what is being said is broken off: from another thread, at once, whatever is at work on it."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Event, RLock


class CancelToken:
    """Broken off or not; whoever works on an utterance says in ``on_cancel`` what is to be done at that moment."""

    def __init__(self) -> None:
        self._cancelled = Event()
        self._lock = RLock()  # over what is done, which so happens within ``on_cancel`` or not at all
        self._callback: Callable[[], None] | None = None

    @property
    def is_cancelled(self) -> bool:
        """True once it was broken off."""
        return self._cancelled.is_set()

    def cancel(self) -> None:
        """Break it off. Safe more than once, from any thread."""
        with self._lock:
            self._cancelled.set()
            if self._callback is not None:
                self._callback()

    def wait(self, timeout: float) -> bool:
        """Wait until it is broken off, for so many seconds at most; True when it was."""
        return self._cancelled.wait(max(0.0, timeout))

    @contextmanager
    def on_cancel(self, callback: Callable[[], None]) -> Iterator[None]:
        """Within this, have ``act`` called when it is broken off; at once where it was already."""
        with self._lock:
            self._callback = callback
            if self.is_cancelled:
                callback()
        try:
            yield
        finally:
            with self._lock:
                self._callback = None
