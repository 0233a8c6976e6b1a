"""The face on the robot's own display: a page for a browser, served from within the run."""

from threading import Event, Thread

from drivers.api import DeviceStatus, Health, Mood, Report, ignore
from drivers.clock import Clock
from drivers.guard import guarded
from drivers.screen.kept import KeptScreen
from drivers.screen.page import asset, news, page, picture
from drivers.screen.server import Document, PageServer

PORT, PORTS = 8321, 20
"""Where it is served when nobody says where, and how many ports it tries from there."""

RETRY = 1.0
"""Seconds between attempts to get a port that is taken."""


class PageScreen(KeptScreen):
    """A ``drivers.api.Screen`` as a page at ``address``, for up to four browsers on this computer.

    ``port`` 0 is the first free one from 8321 on; another is waited for while it is taken. ``host`` is the address
    that it is served at: who else can reach that sees the face.

    A face is an ornament, without which the robot does its work: while it waits for its port it counts as online, and
    ``health`` has the reason in ``detail``.
    """

    def __init__(
        self,
        clock: Clock,
        *,
        host: str = "127.0.0.1",
        port: int = 0,
        rest: Mood = Mood.ASLEEP,
        awake: Mood = Mood.NEUTRAL,
        report: Report = ignore,
    ) -> None:
        super().__init__(clock, rest=rest, awake=awake)
        self._host = host
        self._ports = (port,) if port else (*range(PORT, PORT + PORTS), 0)
        self._report = guarded(report)
        site = {
            "/": lambda: Document("text/html", page(self.shown(), clock.now())),
            "/page.js": lambda: Document("text/javascript", asset("page.js")),
            "/page.css": lambda: Document("text/css", asset("page.css")),
            "/face.svg": lambda: Document("image/svg+xml", picture(self.shown(), clock.now())),
        }
        self._server = PageServer(site, lambda: news(self.shown(), clock.now()))
        self._trouble = ""
        self._ending = Event()
        self._waiting: Thread | None = None
        self._open = False

    @property
    def address(self) -> str:
        """Where a browser finds the face; empty while it is not served."""
        return self._server.address

    def open(self) -> None:
        """Wake up, and serve the page; where the port is taken, wait for it on a thread."""
        super().open()
        if self._open:
            return
        self._open = True
        self._ending.clear()
        if not self._served():
            self._report(DeviceStatus(self.name, "fault", self._trouble, self._hint()))
            self._waiting = Thread(target=self._wait, name=f"screen {self.name}", daemon=True)
            self._waiting.start()

    def close(self) -> None:
        """Rest, show that, and free the port. Safe from any state, more than once."""
        self.rest()
        self._open = False
        self._ending.set()
        if self._waiting is not None:
            self._waiting.join()
            self._waiting = None
        self._server.close()

    def health(self) -> Health:
        """Say whether it is open, why the page is not served yet where it is not, and how many look at it."""
        counters = {"pages": self._server.listeners}
        if self.address:
            return Health(True, counters=counters)
        if not self._open:
            return Health(False, f"{self.name}: not opened yet", counters=counters)
        return Health(True, self._trouble, self._hint(), counters)

    def _served(self) -> bool:
        for port in self._ports:
            try:
                self._server.open(self._host, port)
            except OSError as error:
                self._trouble = f"{self.name}: no page at {self._host} port {port}: {error.strerror or error}"
            else:
                return True
        return False

    def _hint(self) -> str:
        return "`ss -ltnp` lists which program has which port"

    def _wait(self) -> None:
        while not self._ending.wait(RETRY):
            if self._served():
                self._report(DeviceStatus(self.name, "online", f"the face is at {self.address}"))
                return
