"""The cable between the computer and a twin: pulled and put back in a mission's test as in real life."""

from collections.abc import Callable, Mapping

from drivers.api import DeviceStatus, Health, StatusCallback, ignore
from drivers.errors import NotConnected
from drivers.transport.loop import guard_callback


class SimulatedPlug:
    """Whether a twin is there, and the notices of its coming and going. It is plugged in until ``unplug``.

    ``back`` is called whenever the device has come online, ``gone`` whenever it was unplugged; after a ``close``
    nothing is told, for that was on purpose. ``connections`` counts how often it came since it was opened.
    """

    def __init__(
        self,
        name: str,
        report: StatusCallback = ignore,
        *,
        on_online: Callable[[], None] = ignore,
        on_offline: Callable[[], None] = ignore,
    ) -> None:
        self.connections = 0
        self._name = name
        self._report = guard_callback(report)
        self._on_online = on_online
        self._on_offline = on_offline
        self._open = False
        self._plugged = True

    @property
    def online(self) -> bool:
        """Whether it is open and plugged in."""
        return self._open and self._plugged

    def open(self) -> None:
        """Look for the device: it is online at once if it is plugged in. Does nothing while open."""
        if not self._open:
            self._open = True
            self._connect()

    def close(self) -> None:
        """Let the device go. Safe more than once."""
        self._open = False
        self.connections = 0

    def unplug(self) -> None:
        """Pull the plug. Safe more than once."""
        was_online, self._plugged = self.online, False
        if was_online:
            self._on_offline()
            why = self.offline_error()
            self._report(DeviceStatus(self._name, "offline", str(why), why.hint))

    def plug_in(self) -> None:
        """Put the plug in again. Safe more than once."""
        if not self._plugged:
            self._plugged = True
            self._connect()

    def check_online(self) -> None:
        """Raise NotConnected, with the reason and what to try, unless the device is online."""
        if not self.online:
            raise self.offline_error()

    def health(self, counters: Mapping[str, int]) -> Health:
        """Say whether the device is there, with its ``counters``."""
        figures = {"connections": self.connections, **counters}
        if self.online:
            return Health(online=True, counters=figures)
        why = self.offline_error()
        return Health(online=False, detail=str(why), hint=why.hint, counters=figures)

    def _connect(self) -> None:
        if self.online:
            self.connections += 1
            self._report(DeviceStatus(self._name, "online", "the simulated device is there"))
            self._on_online()

    def offline_error(self) -> NotConnected:
        """Return why the device is not there, and what to try."""
        if not self._open:
            return NotConnected(f"{self._name}: not opened yet", hint="open it first")
        return NotConnected(f"{self._name}: the simulated device is unplugged", hint=f"plug the {self._name} in again")
