"""All clients of a run's control socket together: what they watch, and what they are sent at the same time."""

from collections.abc import Mapping

from drivers.clock import Clock
from missions.runner import Runner
from missions.studio.client import Client
from missions.studio.commands import Watch
from missions.studio.doing import Doing
from missions.studio.messages import Picture, Scene, as_json, line_of
from missions.studio.outlet import Outlet, scene_of
from missions.studio.pictures import Pictures

PERIOD = 0.04
"""Seconds from one state to the next, at least."""

IDLE = 0.5
"""Seconds from one state to the next, at most."""

Json = dict[str, object]


class Audience:
    """The ``clients``, and when the next state is ``due`` to be told. For one thread. ``of`` is more of the scene."""

    def __init__(
        self,
        name: str,
        runner: Runner,
        outlet: Outlet,
        pictures: Pictures,
        doing: Doing,
        clock: Clock,
        of: Mapping[str, object],
    ) -> None:
        self.clients: list[Client] = []
        self.due = float("inf")
        self._name, self._runner, self._of = name, runner, of
        self._outlet, self._pictures, self._doing, self._clock = outlet, pictures, doing, clock
        self._scene: Json = {}
        self._line: tuple[object, bytes] = (None, b"")
        self._shown: tuple[object, bytes] = (None, b"")
        self._told_at = float("-inf")

    def hurry(self) -> None:
        """Something has happened: it is told soon, but not more often than ``PERIOD``."""
        if self._outlet.watched:
            self.due = min(self.due, max(self._clock.now(), self._told_at + PERIOD))

    def watch(self, client: Client, command: Watch) -> None:
        """Let a client watch so from now on, beginning with all that is so far."""
        self._scene = self._scene or scene_of(self._runner)
        self.tell()
        told = {
            **self._scene,
            **self._of,
            **self._outlet.past.told(),
            "state": self._outlet.all,
            "log": list(self._outlet.log),
        }
        client.begin(command, line_of(Scene(run=self._name, **told)) + b"\n")  # type: ignore[arg-type]
        self.look_at_watches()

    def look_at_watches(self) -> None:
        """Gather only what somebody watches."""
        watches = [client.watch for client in self.clients]
        self._outlet.watched = any(watch.state for watch in watches)
        self._outlet.listened = any(watch.events for watch in watches)
        self._pictures.watched = any(watch.pictures for watch in watches)
        if not (self._outlet.watched or self._outlet.listened or self._pictures.watched):
            self.due = float("inf")
        elif self.due == float("inf"):
            self.due = self._clock.now() + PERIOD

    def tell(self) -> None:
        """Send what is new to those who watch."""
        now = self._told_at = self._clock.now()
        self.due = now + IDLE
        state: Json = {"say": "state", "run": self._name, **self._outlet.news(self._doing.told())}
        for client in self.clients:
            client.news(state)
        if self._outlet.listened:
            events, lost = self._outlet.events()
            for client in self.clients:
                client.events(events, lost)
        if self._pictures.watched and (ask := getattr(self._runner.assembled.eyes, "ask", None)) is not None:
            ask()  # eyes that nobody asks rest

    def show(self, now: float) -> None:
        """Send the newest picture to those who look and have seen the last."""
        wanting = [client for client in self.clients if self._pictures.watched and client.wants_picture(now)]
        picture = self._pictures.newest() if wanting else None
        if picture is None:
            return
        if self._shown[0] is not picture:
            self._shown = picture, line_of(Picture(run=self._name, **picture)) + b"\n"  # type: ignore[arg-type]
        for client in wanting:
            client.picture(self._shown[1], picture["t"], now)  # type: ignore[arg-type]

    def encoded(self, state: Mapping[str, object]) -> bytes:
        """Return a state as a line: once for all who are sent the same."""
        if self._line[0] is not state:
            self._line = state, as_json(state) + b"\n"
        return self._line[1]
