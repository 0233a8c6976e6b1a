"""A line without a port whose baud rate matters: what it was set to, and what its adapter cannot do."""

from drivers.clock import ManualClock
from drivers.errors import NotConnected
from drivers.servos.bus import ServoBus
from drivers.servos.virtual.chain import VirtualServoBus
from tests.drivers.lines import DirectLine


class Wired(DirectLine[VirtualServoBus]):
    """``rates`` are the baud rates that it was set to since it was opened; those in ``beyond`` it cannot run at."""

    def __init__(self, chain: VirtualServoBus) -> None:
        self.clock = ManualClock()
        self.rates: list[int] = []
        self.beyond: set[int] = set()
        super().__init__(chain, self.clock)

    def bus(self) -> ServoBus:
        """Return a bus that has this line open."""
        bus = ServoBus("/dev/servos", self.clock, name="arm", dial=self.dial)
        bus.open()
        return bus

    def set_baud(self, baud: int) -> None:
        if baud in self.beyond:
            raise NotConnected(f"the line: cannot run at {baud} baud")
        self.rates.append(baud)
        super().set_baud(baud)
