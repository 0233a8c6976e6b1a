"""State shared by all clients of the studio: runs, page, clients, and handlers of commands."""

import asyncio
import base64
import hashlib
import json
import subprocess
import sys
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, replace
from functools import cache
from importlib.metadata import version
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Lock
from typing import Protocol, TypeVar
from weakref import WeakKeyDictionary

from config.defaults import config_folder
from config.diagnostics import InvalidFileError
from config.fleet import FLEET_FILE, load_fleet
from config.library import shipped_files
from missions.codec import encode_tagged
from missions.control.commands import (
    CODEC_RULES,
    COMMAND_KEY,
    BadMessage,
    ClientCommand,
    ListTuningCommand,
    Role,
    StopCommand,
    WatchCommand,
)
from missions.control.messages import PROTOCOL_VERSION, RunsMessage, WelcomeMessage
from missions.library.people import PeopleError, proper_name
from missions.plugins.fleet.messages import Address, FleetAnswer
from missions.plugins.fleet.operator import Operator, connect_operator
from missions.plugins.fleet.zenoh_transport import RosterEntry
from missions.plugins.studio.access import StudioAccess
from missions.plugins.studio.audit_log import UNLOGGED_COMMANDS, AuditLog
from missions.plugins.studio.file_reader import FileReader
from missions.plugins.studio.run_feed import FeedClient, RunFeed
from missions.plugins.studio.run_hub import RunHub
from missions.plugins.studio.run_launcher import RunLauncher
from missions.plugins.studio.studio_commands import (
    AddPerson,
    ApproveTask,
    FleetQuery,
    KeepTuning,
    ReleaseFleet,
    RevokeLinks,
    ShowPerson,
    StartRun,
    StopFleet,
)
from missions.plugins.tasks.task import TaskError

# Adding a person from pictures of a run's camera, with `mission person add`.

PERSON_PICTURE_COUNT = 6
"""Number of pictures of a person that are taken for `mission person add`."""

PERSON_PICTURE_INTERVAL = 0.8
"""Seconds between two pictures of a person: time to turn the head a little."""

PERSON_TIMEOUT = 30.0
"""Time limit in seconds for taking the pictures, and again for `mission person add`."""


async def add_person(
    command: AddPerson, sent_pictures: Sequence[bytes], feed: RunFeed | None = None, robot: str = ""
) -> Mapping[str, object]:
    """Return the answer to `add_person`: adds the person in the pictures with `mission person add`.

    The pictures are taken with the camera of the run of ``feed``; if it is None, they are the ``sent_pictures``. The
    name ``robot`` is passed on to the command if the library ships a robot of this name.
    """
    try:
        proper_name(command.name)  # an invalid name is reported before any picture is taken
    except PeopleError as error:
        raise BadMessage("no_person", str(error), error.hint) from error
    pictures = sent_pictures if feed is None else await _take_pictures(feed)
    if not pictures:
        raise BadMessage("no_person", "no picture was sent", "show_person")
    with TemporaryDirectory(prefix="person-") as folder:
        files = [Path(folder, f"{number}.jpg") for number in range(1, len(pictures) + 1)]
        for file, picture in zip(files, pictures, strict=True):
            file.write_bytes(picture)
        words = ["--robot", robot] if robot in shipped_files("robots") else []
        output = await asyncio.to_thread(_run_person_add, *words, "--", command.name, *map(str, files))
    return {"message": output}


def decode_picture(command: ShowPerson) -> bytes:
    """Decode a picture sent by a client. Raises BadMessage; `mission person add` checks the content."""
    try:
        return base64.b64decode(command.jpeg, validate=True)
    except ValueError as error:
        raise BadMessage("bad_field", f"'jpeg' is not base64: {error}") from error


async def _take_pictures(watching: RunFeed) -> list[bytes]:
    """Return pictures, as JPEG, taken with the camera of a run. Raises BadMessage if the run has no camera."""
    hearer, taken, last = FeedClient(watching), list[bytes](), -PERSON_PICTURE_INTERVAL
    try:
        async with asyncio.timeout(PERSON_TIMEOUT):
            await watching.watch(hearer, WatchCommand(state=False, pictures=1 / PERSON_PICTURE_INTERVAL))
            async for line in hearer.lines():
                message = json.loads(line)
                if message["say"] != "picture":
                    continue
                watching.on_seen(hearer, message["t"])
                if message["t"] - last < PERSON_PICTURE_INTERVAL:
                    continue
                last = message["t"]
                taken.append(base64.b64decode(message["jpeg"]))
                if len(taken) == PERSON_PICTURE_COUNT:
                    return taken
    except TimeoutError:
        pass
    finally:
        watching.leave(hearer)
    error = f"the camera of run {watching.run} has shown {len(taken)} pictures, and it takes {PERSON_PICTURE_COUNT}"
    raise BadMessage(
        "no_person", f"not added: {error}", "a mission that uses the camera, such as by_hand/drive_and_look"
    )


def _run_person_add(*words: str) -> str:
    """Run `mission person add` and return its output. Raises BadMessage with its message if it fails."""
    done = subprocess.run(  # noqa: S603 - ourselves
        [sys.executable, "-m", "missions", "person", "add", *words],
        stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=PERSON_TIMEOUT, check=False,
    )  # fmt: skip
    if done.returncode:
        raise BadMessage("no_person", done.stderr.strip()[-4000:] or f"it ended with exit code {done.returncode}")
    return "\n".join(filter(None, [done.stdout.strip(), done.stderr.strip()]))


# The fleet of this computer, for the page: its robots, their state, and the stop and release of all.

T = TypeVar("T")

Json = Mapping[str, object]


class FleetConnection:
    """Connection to the fleet of ``fleet.yaml``, opened at the first request and kept until closed.

    Without that file there is no fleet: a studio joins none by itself.
    """

    def __init__(self) -> None:
        self._exit_stack, self._lock = ExitStack(), Lock()
        self._operator: Operator | None = None
        self._close_count = 0
        self._has_discovered = False

    async def run_command(self, command: ClientCommand, by: str) -> Json:
        """Run a command of the fleet for the person ``by``. Raises BadMessage("no_fleet") without a fleet file."""
        match command:
            case FleetQuery():
                return await self._run_in_thread(self._list)
            case StopFleet():
                return await self._run_in_thread(lambda operator: _stop_json(*operator.stop(by)))
            case ReleaseFleet():
                names = [command.robot] if command.robot else []
                return await self._run_in_thread(
                    lambda operator: _answers_json(operator.release(names, by, resume=command.resume))
                )
        raise BadMessage("unknown_command", f"unknown fleet command '{command.word}'")

    async def _run_in_thread(self, work: Callable[[Operator], T]) -> T:
        try:
            return await asyncio.to_thread(lambda: work(self._open_operator()))
        except (TaskError, InvalidFileError) as error:
            raise BadMessage("no_fleet", str(error)[:2000], str(getattr(error, "hint", ""))[:500]) from error

    def _open_operator(self) -> Operator:
        """Return the fleet's operator, opened once, in a thread: opening a session may take some time."""
        with self._lock:
            if self._operator is not None:
                return self._operator
            closings = self._close_count
        if not (config_folder() / FLEET_FILE).is_file():
            folder = config_folder()
            hint = f"mkdir -p {folder} && echo 'fleet: home' > {folder / FLEET_FILE}"
            raise TaskError(f"there is no {FLEET_FILE} with the fleet of this computer", hint=hint)
        with ExitStack() as opened:
            operator = opened.enter_context(connect_operator(load_fleet()))
            with self._lock:
                if self._close_count != closings:
                    raise TaskError("the studio has left the fleet")
                if self._operator is None:  # otherwise another call opened one first, and this session is closed
                    self._operator, self._exit_stack = operator, opened.pop_all()
                return self._operator

    def _list(self, operator: Operator) -> Json:
        """Return the robots of the fleet. The first call waits until the robots are discovered."""
        met, self._has_discovered = self._has_discovered, True
        if not met:
            operator.discover()
        return _fleet_json(operator)

    def close(self) -> None:
        """Close the connection to the fleet."""
        with self._lock:
            self._operator, self._has_discovered = None, False
            self._close_count += 1
            closed, self._exit_stack = self._exit_stack, ExitStack()
        closed.close()


def _fleet_json(operator: Operator) -> Json:
    members = sorted(operator.members().values(), key=lambda each: each.address)
    return {
        "fleet": operator.fleet.fleet,
        "robots": [_robot_json(each) for each in members],
        "missing": operator.missing_robots(),
    }


def _robot_json(member: RosterEntry) -> Json:
    state = {} if member.state is None else asdict(member.state)
    return {"name": member.address.name, "number": member.address.number, "connection": member.connection, **state} | (
        {"number": member.address.number}
    )


def _stop_json(answers: Mapping[Address, FleetAnswer], silent: list[str]) -> Json:
    return {**_answers_json(answers), "silent": silent}


def _answers_json(answers: Mapping[Address, FleetAnswer]) -> Json:
    return {"answers": {str(address): {"ok": answer.ok, "why": answer.reason} for address, answer in answers.items()}}


PAGE_FOLDER = Path(__file__).with_name("page")
"""Folder of the studio's page in the browser. Only files of this folder are served."""


MAX_KEPT_PRESSES = 256
"""Number of STOP presses that are remembered: each is logged once, even if it arrives on several connections."""


class StudioClient(Protocol):
    """Client that is connected to the studio, such as a ClientSession."""

    name: str

    def send_runs(self, runs: RunsMessage) -> None:
        """Send the list of runs as soon as possible, without waiting for it.

        If several lists wait, only the newest is sent.
        """
        ...

    def disconnect(self) -> None:
        """Ignore further commands of this client and release the parts that it drives; returns at once."""
        ...


@cache
def page_edition() -> str:
    """Return the version of the studio's page, which differs between releases."""
    digest = hashlib.sha256()
    for path in sorted(PAGE_FOLDER.glob("*")):
        digest.update(path.name.encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:16]


class Studio:
    """State of one studio: ``hub`` has the runs, ``audit`` the log, ``access`` the tokens, ``reader`` the workers.

    ``fleet`` is the connection to this computer's fleet.
    """

    def __init__(self, audit: AuditLog, launcher: RunLauncher, reader: FileReader, access: StudioAccess) -> None:
        self.audit, self._reader, self.access = audit, reader, access
        self.hub = RunHub(self._send_runs)
        self._launcher = launcher
        self.fleet = FleetConnection()
        self._clients: set[StudioClient] = set()
        self._person_pictures: WeakKeyDictionary[StudioClient, deque[bytes]] = (
            WeakKeyDictionary()
        )  # sent pictures of a person
        self._name_count = 0
        self._presses: deque[str] = deque(maxlen=MAX_KEPT_PRESSES)
        self.versions = {page_edition(), str(PROTOCOL_VERSION)}

    def next_client_name(self, role: Role) -> str:
        """Return a name for a new client, such as "operator 2"."""
        self._name_count += 1
        return f"{role} {self._name_count}"

    def welcome(self, role: Role, name: str) -> WelcomeMessage:
        """Return the first message to a client: role, name, and the versions of protocol, page and MissionTree."""
        return WelcomeMessage(
            version=PROTOCOL_VERSION, page=page_edition(), role=role, name=name, release=version("missiontree")
        )

    @contextmanager
    def register(self, client: StudioClient) -> Iterator[None]:
        """Send a client the list of runs, now and after each change, while the context is entered."""
        self._clients.add(client)
        try:
            yield
        finally:
            self._clients.discard(client)

    @property
    def client_count(self) -> int:
        """Number of connected clients."""
        return len(self._clients)

    async def stop(self, run: str, by: str, press: str = "") -> Mapping[str, object]:
        """Stop a run, or all for an empty name, starting ones too; return the results by run.

        ``by`` names the person who stops; ``press`` identifies the press of STOP, so that it counts once if it arrives
        twice. Raises BadMessage for an unknown run.
        """
        if not run:
            self._launcher.stop()
        return await self.hub.stop(run, by, press)

    def log_command(self, client: StudioClient, role: Role, command: ClientCommand, outcome: str) -> None:
        """Write a command of a client and its outcome into the audit log."""
        if command.word in UNLOGGED_COMMANDS or (isinstance(command, StopCommand) and command.press in self._presses):
            return
        if isinstance(command, StopCommand) and command.press:
            self._presses.append(command.press)
        fields = encode_tagged(command, COMMAND_KEY, CODEC_RULES).items()
        about = {name: value for name, value in fields if name not in ("id", "by", "press") and value != ""}
        self.audit.write(client.name, role, about, outcome)

    async def run_command(self, command: ClientCommand, client: StudioClient) -> Mapping[str, object]:
        """Run a command that the studio itself answers, not a run; return its answer. Raises BadMessage."""
        if isinstance(command, RevokeLinks):
            return self._revoke(client)
        if isinstance(command, StartRun):
            stops = self._launcher.stops
            await self._reader.check(command)
            begun = await self._launcher.start(command, stops)
            await self.hub.search()
            return begun
        if isinstance(command, ShowPerson):
            self._person_pictures.setdefault(client, deque(maxlen=PERSON_PICTURE_COUNT)).append(decode_picture(command))
            return {}
        if isinstance(command, AddPerson):
            shown = self._person_pictures.pop(client, ())
            if not command.run:
                return await add_person(command, [*shown])
            about = self.hub.about_run(command.run)
            return await add_person(command, (), self.hub.feed_of(command.run), str(about["robot"]))
        if isinstance(command, KeepTuning):
            return await self._reader.keep(await self.hub.ask(command.run, {COMMAND_KEY: ListTuningCommand.word}))
        if isinstance(command, FleetQuery | StopFleet | ReleaseFleet):
            return await self.fleet.run_command(command, f"{client.name} of a studio")
        if isinstance(command, ApproveTask):
            command = replace(command, by=client.name)
        return await self._reader.do(command)

    def _revoke(self, by: StudioClient) -> Mapping[str, object]:
        """Replace the tokens of operator and viewer, and disconnect all clients except ``by``.

        Raises BadMessage if the new tokens cannot be stored.
        """
        try:
            self.access.renew()
        except OSError as error:
            why = f"the old tokens are still stored for the next studio: {error}"
            raise BadMessage("bad_file", why, "delete the token file before the next start of the studio") from error
        finally:
            for client in self._clients - {by}:
                client.disconnect()
        return {"operator": self.access.operator, "viewer": self.access.viewer}

    async def report(self, name: str) -> str:
        """Return the report of a record as an HTML page. Raises BadMessage if it cannot be read."""
        return await self._reader.report(name)

    async def last_output(self, run: str) -> str:
        """Return the last output of an ended run that was started here; an empty text for any other run."""
        return await self._launcher.last_output(run)

    def _send_runs(self) -> None:
        runs = RunsMessage(runs=self.hub.runs())
        for client in self._clients:
            client.send_runs(runs)
