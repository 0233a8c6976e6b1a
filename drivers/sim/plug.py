"""Simulated cable between the computer and a simulated device, which tests can unplug and plug in."""

from collections.abc import Callable, Mapping

from drivers.api import DeviceStatus, Health, StatusCallback, ignore
from drivers.errors import NotConnected
from drivers.transport.loop import guard_callback


class SimulatedPlug:
    """Connection state of a simulated device, with its notices. It is plugged in until ``unplug``.

    ``on_online`` is called whenever the device has come online, ``on_offline`` after ``unplug``. ``close`` reports
    nothing, because it is intended. ``connections`` counts the connections since ``open``.
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
        """True while the device is open and plugged in."""
        return self._open and self._plugged

    def open(self) -> None:
        """Connect the device: it is online at once if it is plugged in. Does nothing while open."""
        if not self._open:
            self._open = True
            self._connect()

    def close(self) -> None:
        """Disconnect without a notice. Safe more than once."""
        self._open = False
        self.connections = 0

    def unplug(self) -> None:
        """Take the device offline and report it. Safe more than once."""
        was_online, self._plugged = self.online, False
        if was_online:
            self._on_offline()
            why = self.offline_error()
            self._report(DeviceStatus(self._name, "offline", str(why), why.hint))

    def plug_in(self) -> None:
        """Bring the device online again and report it. Safe more than once."""
        if not self._plugged:
            self._plugged = True
            self._connect()

    def check_online(self) -> None:
        """Raise NotConnected, with the reason and a hint, unless the device is online."""
        if not self.online:
            raise self.offline_error()

    def health(self, counters: Mapping[str, int]) -> Health:
        """Return the connection state with the ``counters`` of the device."""
        figures = {"connections": self.connections, **counters}
        if self.online:
            return Health(online=True, counters=figures)
        why = self.offline_error()
        return Health(online=False, detail=str(why), hint=why.hint, counters=figures)

    def _connect(self) -> None:
        if self.online:
            self.connections += 1
            self._report(DeviceStatus(self._name, "online", "the simulated device is connected"))
            self._on_online()

    def offline_error(self) -> NotConnected:
        """Return the error of an offline device, with a hint."""
        if not self._open:
            return NotConnected(f"{self._name}: not opened yet", hint="open it first")
        return NotConnected(f"{self._name}: the simulated device is unplugged", hint=f"plug the {self._name} in again")
