"""What all clients of a studio share: the runs, the page, who is there, and who does what they ask for."""

import hashlib
from collections import deque
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Protocol
from weakref import WeakKeyDictionary

from missions.studio.access import Access
from missions.studio.audit import UNTOLD, Audit
from missions.studio.commands import KEY, Command, Role, Stop, Tuned
from missions.studio.enrolling import COUNT, add_person, picture_in
from missions.studio.fleet import FleetDesk
from missions.studio.form import BadMessage, written
from missions.studio.hub import Hub
from missions.studio.launch import Launcher
from missions.studio.messages import OLDEST_VERSION, VERSION, Runs, Welcome
from missions.studio.reader import Reader
from missions.studio.wishes import (
    AddPerson,
    ApproveTask,
    Fleet,
    KeepTuning,
    ReleaseFleet,
    Revoke,
    ShowPerson,
    Start,
    StopFleet,
)

PAGE = Path(__file__).with_name("page")
"""The folder of the page: what is in it is served, and nothing else."""


MOST_PRESSES = 256
"""Presses of STOP that are remembered: each is written into the log once, by however many ways it comes."""


class Client(Protocol):
    """Who is connected, and what the others see of that."""

    name: str

    def tell(self, runs: Runs) -> None:
        """Send what runs there are, as soon as that is possible; returns at once. Only the newest counts."""
        ...

    def shut_out(self) -> None:
        """Hear nothing of this client any more, and let go of what it drives; returns at once."""
        ...


@cache
def edition() -> str:
    """Return what tells this page from those of other releases."""
    digest = hashlib.sha256()
    for path in sorted(PAGE.glob("*")):
        digest.update(path.name.encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:16]


class Studio:
    """One studio. Its ``hub`` knows the runs, ``audit`` who did what, ``access`` who may; the ``reader`` reads.

    ``fleet`` is at the fleet of this computer.
    """

    def __init__(self, audit: Audit, launcher: Launcher, reader: Reader, access: Access) -> None:
        self.audit, self._reader, self.access = audit, reader, access
        self.hub = Hub(self._tell_runs)
        self._launcher = launcher
        self.fleet = FleetDesk()
        self._clients: set[Client] = set()
        self._shown: WeakKeyDictionary[Client, deque[bytes]] = WeakKeyDictionary()  # pictures of somebody
        self._names = 0
        self._presses: deque[str] = deque(maxlen=MOST_PRESSES)
        # A page that was loaded from an older studio has to stop robots, too.
        self.versions = {edition(), *map(str, range(OLDEST_VERSION, VERSION + 1))}

    def name(self, role: Role) -> str:
        """Return what a new client is called."""
        self._names += 1
        return f"{role} {self._names}"

    def welcome(self, role: Role, name: str) -> Welcome:
        """Return what a client hears first."""
        return Welcome(version=VERSION, page=edition(), role=role, name=name, release=version("missiontree"))

    @contextmanager
    def joined(self, client: Client) -> Iterator[None]:
        """Tell a client of the runs while this is entered."""
        self._clients.add(client)
        try:
            yield
        finally:
            self._clients.discard(client)

    @property
    def count(self) -> int:
        """How many clients are connected."""
        return len(self._clients)

    async def stop(self, run: str, by: str, press: str = "") -> Mapping[str, object]:
        """Stop a run, or all for no name: those too that are being started. Raises BadMessage for one not there."""
        if not run:
            self._launcher.stop()
        return await self.hub.stop(run, by, press)

    def tell(self, by: Client, role: Role, command: Command, outcome: str) -> None:
        """Write into the log who has commanded what, and what came of it."""
        if command.word in UNTOLD or (isinstance(command, Stop) and command.press in self._presses):
            return
        if isinstance(command, Stop) and command.press:
            self._presses.append(command.press)
        told = written(command, KEY).items()
        about = {name: value for name, value in told if name not in ("id", "by", "press") and value != ""}
        self.audit.tell(by.name, role, about, outcome)

    async def do(self, command: Command, by: Client) -> Mapping[str, object]:
        """Do a command that no run answers. Raises BadMessage with the name of what went wrong."""
        if isinstance(command, Revoke):
            return self._revoke(by)
        if isinstance(command, Start):
            stops = self._launcher.stops
            await self._reader.check(command)
            begun = await self._launcher.start(command, stops)
            await self.hub.look()
            return begun
        if isinstance(command, ShowPerson):
            self._shown.setdefault(by, deque(maxlen=COUNT)).append(picture_in(command))
            return {}
        if isinstance(command, AddPerson):
            shown = self._shown.pop(by, ())
            if not command.run:
                return await add_person(command, [*shown])
            about = self.hub.known(command.run)
            return await add_person(command, (), self.hub.watching(command.run), str(about["robot"]))
        if isinstance(command, KeepTuning):
            return await self._reader.keep(await self.hub.ask(command.run, {KEY: Tuned.word}))
        if isinstance(command, Fleet | StopFleet | ReleaseFleet):
            return await self.fleet.do(command, f"{by.name} of a studio")
        if isinstance(command, ApproveTask):
            command = replace(command, by=by.name)
        return await self._reader.do(command)

    def _revoke(self, by: Client) -> Mapping[str, object]:
        """Make both tokens anew, and shut all out but who asks. Raises BadMessage where the kept ones stay."""
        try:
            self.access.renew()
        except OSError as error:
            why = f"the former tokens are still kept for the next time: {error}"
            raise BadMessage("bad_file", why, "delete their file before the studio is started again") from error
        finally:
            for client in self._clients - {by}:
                client.shut_out()
        return {"operator": self.access.operator, "viewer": self.access.viewer}

    async def report(self, name: str) -> str:
        """Return the report of a record, as a page. Raises BadMessage for one that cannot be read."""
        return await self._reader.report(name)

    async def last_words(self, run: str) -> str:
        """Return the last that a run said which was started here and has ended; nothing of another one."""
        return await self._launcher.last_words(run)

    def _tell_runs(self) -> None:
        told = Runs(runs=self.hub.runs())
        for client in self._clients:
            client.tell(told)
