"""Control socket of a run: clients of the same user watch, drive, pause, end and stop the run.

It has its own thread, so neither slow ticks nor slow clients affect it. A stop goes straight to the drivers.
"""

import errno
import os
import selectors
import socket
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from threading import Thread
from types import TracebackType
from typing import Literal, Self

from behaviours.run import log
from drivers.api.fast_dataclass import dataclass
from drivers.clock import Clock, SystemClock, time_of_day
from missions.control import abstract_sockets, sockets
from missions.control.clients import IDLE_STATE_INTERVAL, WATCH_NOTHING, Broadcaster, ControlClient
from missions.control.command_handler import CommandHandler
from missions.control.commands import (
    BadMessage,
    ClientCommand,
    DriveCommand,
    LookCommand,
    PictureShownCommand,
    ReleaseCommand,
    StopCommand,
    WatchCommand,
    find_id,
    read_command,
)
from missions.control.holders import require_stop
from missions.control.messages import AnswerMessage, RunMessage, RunOverMessage
from missions.control.notes import RunNotes
from missions.control.picture_feed import PictureFeed
from missions.control.run_folders import (
    CHECK_TIMEOUT,
    FOLDER_TIMEOUT,
    FolderTimeoutError,
    RunFolder,
    call_with_timeout,
    run_folders,
)
from missions.control.state_feed import StateFeed
from missions.control.wheels import WheelArbiter
from missions.executive.events import Event
from missions.runner import Runner

# Addresses at which a run can be stopped: its listening sockets and its notes, checked while it runs.

CHECK_INTERVAL = 1.0
"""Seconds between two checks that the sockets can be reached."""

ACCEPT_PAUSE = 0.1
"""Seconds without accepting connections when the process has no free file descriptor."""

LISTENER_KEY = object()
"""Marker in the selector's data that distinguishes listening sockets from connections of clients."""

BUSY_ERRNOS = {errno.EMFILE, errno.ENFILE, errno.ENOMEM, errno.ENOBUFS, errno.EAGAIN}
"""Errors of a connection that do not mean a broken socket: no free descriptor, or many clients at once."""


@dataclass(slots=True)
class ListeningSocket:
    """A listening socket at an ``address``; ``inode`` detects that the socket file was replaced."""

    address: sockets.Address
    socket: socket.socket
    inode: int = 0


class Endpoint:
    """Listening sockets and note files of a run, by which clients find it.

    A note file describes the run for `mission stop`. One thread checks and repairs sockets and notes; ``selector``
    waits for connections. ``trouble`` is the reason why `mission stop` cannot reach the run; empty if it can.
    """

    def __init__(self, selector: selectors.BaseSelector, run_info: RunMessage) -> None:
        self.trouble = ""
        self.due = 0.0
        """Time of the next check, in seconds on the same clock as the argument ``now`` of ``run_due_checks``."""
        self._selector, self._run_info = selector, run_info
        self._notes: RunNotes | None = None
        self._file: ListeningSocket | None = None
        self._abstract: ListeningSocket | None = None
        self._registered: list[socket.socket] = []
        self._probes: set[object] = set()
        self._errors: list[str] = []
        self._name_descriptor: int | None = None
        self._check_at = 0.0
        self._folder_timeout = FOLDER_TIMEOUT

    @property
    def listeners(self) -> list[socket.socket]:
        """The present listening sockets."""
        return [each.socket for each in (self._file, self._abstract) if each is not None]

    def run_due_checks(self, now: float) -> None:
        """Check sockets and note files if a check is due; afterwards accept connections again, if that was paused."""
        if now < self.due:
            return
        if now >= self._check_at:
            self._check_at = now + CHECK_INTERVAL
            self.check()
            self._folder_timeout = CHECK_TIMEOUT  # from now on this thread receives stops
        self.due = self._check_at
        for each in self._registered:
            with suppress(KeyError, ValueError):  # closed, or not registered
                self._selector.unregister(each)
        self._registered = self.listeners
        for each in self._registered:
            self._selector.register(each, selectors.EVENT_READ, LISTENER_KEY)

    def pause_accepting(self, listener: socket.socket, now: float) -> None:
        """Accept no connections for ``ACCEPT_PAUSE`` seconds."""
        self._selector.unregister(listener)
        self.due = min(self.due, now + ACCEPT_PAUSE)

    def check(self) -> None:
        """Reopen sockets that cannot be reached, and write missing note files of the run."""
        self._errors = []
        self._probes.clear()
        self._file = self._keep_reachable(self._file) or self._listen_in_folder()
        self._abstract = self._keep_reachable(self._abstract) or self._listen_by_name()
        found = [each for each in (self._file, self._abstract) if each is not None]
        noted = self._write_notes([str(each.address) for each in found])
        self.trouble = "" if found and noted else "; ".join(self._errors)

    def is_probe(self, peer: object) -> bool:
        """Return True if the connection from ``peer`` is a probe by which this object checks its sockets."""
        return peer in self._probes

    def close(self) -> None:
        """Remove the sockets and note files of the run."""
        if self._notes is not None:
            self._notes.close()  # before the sockets: a run with a note and no socket looks blocked
        for each in (self._file, self._abstract):
            if each is not None:
                if isinstance(each.address, Path):
                    with suppress(OSError):  # the folder is read-only now: a socket there has no listener
                        if _inode(each.address) == each.inode:
                            call_with_timeout(each.address.parent, partial(each.address.unlink, missing_ok=True))
                each.socket.close()
        self._file = self._abstract = None
        if self._name_descriptor is not None:
            os.close(self._name_descriptor)
            self._name_descriptor = None

    def _listen_in_folder(self) -> ListeningSocket | None:
        """Listen in the first usable folder; None if there is none."""
        for place in run_folders(seconds=self._folder_timeout):
            if place.is_own:
                path = place.folder / f"{self._run_info.run}{sockets.SOCKET_SUFFIX}"
                try:
                    return call_with_timeout(place.folder, partial(_listen, place, path), self._folder_timeout)
                except OSError as error:
                    self._errors.append(f"no control socket in {place.folder}: {error.strerror or error}")
        return None

    def _listen_by_name(self) -> ListeningSocket | None:
        try:
            name = abstract_sockets.make_name(self._run_info.run, "run", simulated=bool(self._run_info.simulated))
            with suppress(OSError):  # an old kernel: the file sockets suffice
                self._name_descriptor = (
                    abstract_sockets.hold_name(name) if self._name_descriptor is None else self._name_descriptor
                )
            found = abstract_sockets.listen(name)
        except OSError as error:
            self._errors.append(f"no abstract control socket: {error.strerror or error}")
            return None
        found.setblocking(False)
        return ListeningSocket(name.address, found)

    def _write_notes(self, listening: list[str]) -> bool:
        """Write the run's note files with the addresses of its sockets (``listening``); return False if that fails."""
        try:
            if self._notes is None:
                about = self._run_info
                self._notes = RunNotes(about.run, about.mission, about.robot, about.simulated, is_run=True)
            self._notes.write(listening, self._folder_timeout)
        except OSError as error:
            self._errors.append(f"no note of the run: {error.strerror or error}")
            return False
        return True

    def _keep_reachable(self, listener: ListeningSocket | None) -> ListeningSocket | None:
        """Return ``listener`` if clients can connect to it; otherwise close it and return None."""
        if listener is None or self._is_reachable(listener):
            return listener
        with suppress(OSError):  # it may be closed already
            listener.socket.close()
        return None

    def _is_reachable(self, listener: ListeningSocket) -> bool:
        """Return False if a connection to the listener's address fails or reaches another socket.

        If a folder hangs, or no descriptor is free, the listener counts as reachable.
        """
        try:
            if isinstance(listener.address, str):
                self._probe(listener)
            else:
                call_with_timeout(listener.address.parent, partial(self._probe, listener), self._folder_timeout)
        except FolderTimeoutError:
            return True  # nothing can be written there either
        except OSError as error:
            return error.errno in BUSY_ERRNOS
        return True

    def _probe(self, listener: ListeningSocket) -> None:
        """Connect to the address of a listener. Raises OSError if another socket, or none, is there."""
        if isinstance(listener.address, Path) and listener.address.stat().st_ino != listener.inode:
            raise FileNotFoundError(f"{listener.address} is another one")
        with socket.socket(socket.AF_UNIX) as probe, sockets.bindable_address(listener.address) as target:
            probe.setblocking(False)
            probe.bind("")  # the kernel chooses a name, which identifies the connection
            self._probes.add(probe.getsockname())
            probe.connect(target)


def _listen(place: RunFolder, path: Path) -> ListeningSocket:
    """Return a socket that listens at ``path``, in the folder ``place``. Raises OSError."""
    place.prepare()
    found = sockets.listen(path)
    found.setblocking(False)
    return ListeningSocket(path, found, path.stat().st_ino)


def _inode(path: Path) -> int:
    """Return the inode number of a file; 0 if it does not exist or its folder does not respond."""
    try:
        return call_with_timeout(path.parent, path.stat).st_ino
    except OSError:
        return 0


FAREWELL_TIMEOUT = 0.5
"""Seconds for sending the last messages when the run ends."""

MAX_CLIENTS = 64
"""Maximum number of connections; one more replaces a client that neither watches nor drives."""


class ControlSocket:
    """Context manager that serves the control socket of a ``runner``; also a listener to the runner's events.

    ``trouble`` is the reason if the socket cannot be used; ``require_stop`` raises it for a run that moves a robot.
    """

    def __init__(self, runner: Runner, *, clock: Clock | None = None) -> None:
        self._runner, self._pictures = runner, PictureFeed()
        runner.observe(on_view=self._pictures.on_view, on_frame=self._pictures.on_frame)
        self._clock = clock or SystemClock()
        self.feed = StateFeed(runner, wall=self._clock)
        robot = runner.assembled_robot.robot
        self._wheels = WheelArbiter(robot.base_part, robot.head_part, self._clock)
        self._handler = CommandHandler(runner, self._wheels, self._clock)
        if runner.paused_pace is not None:
            runner.paused_pace.is_driven = lambda: bool(self._wheels.driver) and not runner.latch.reason
            runner.paused_pace.on_wait = self.feed.update
        simulated: Literal["", "wire", "fast"] = runner.request.simulation or ""
        of = {"simulated": simulated, "world": runner.request.world_name}
        began = time_of_day().timestamp()
        self._name = sockets.new_run_name()
        self._run_info = RunMessage(
            run=self._name,
            pid=os.getpid(),
            mission=runner.plan.mission,
            robot=runner.assembled_robot.name,
            simulated=simulated,
            began=round(began, 3),
        )
        self._selector = selectors.DefaultSelector()
        self._endpoint = Endpoint(self._selector, self._run_info)
        self._broadcaster = Broadcaster(self._name, runner, self.feed, self._pictures, self._handler, self._clock, of)
        self._clients = self._broadcaster.clients
        self._waker, self._wake_end = socket.socketpair()
        self._is_ending = False
        self._thread: Thread | None = None
        runner.stream.listeners.append(self)

    def __call__(self, event: Event) -> None:
        self.feed(event)

    def __enter__(self) -> Self:
        for end in (self._waker, self._wake_end):
            end.setblocking(False)
        self._endpoint.run_due_checks(
            self._clock.now()
        )  # also without a listener: one may be added later, and signals end the thread
        self._selector.register(self._waker, selectors.EVENT_READ)
        self.feed.wake = self._pictures.wake = self._wake
        self._thread = Thread(target=self._serve, name="control", daemon=True)
        self._thread.start()
        self._runner.is_reachable = True
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._runner.is_reachable = False
        if self._thread is not None:
            self._is_ending = True
            self._wake()
            self._thread.join()
            self._thread = None
            self._close_sockets()

    @property
    def trouble(self) -> str:
        """Reason why no stop can reach the run; empty otherwise."""
        return self._endpoint.trouble

    def require_stop(self, override: str) -> None:
        """Raise NoStop if the run would move a real robot and no stop can reach it, unless the user allowed that.

        ``override`` is the option that allows it, for the error message.
        """
        order = self._runner.request
        if self.trouble and not order.without_stop:
            require_stop(self.trouble, simulated=order.simulation is not None, override=override)

    def _close_sockets(self) -> None:
        self._endpoint.close()
        sockets.release_run_name(self._name)
        self._selector.close()
        for end in (self._waker, self._wake_end):
            end.close()

    def _wake(self) -> None:
        with suppress(OSError):  # the buffer is full, so it wakes anyway
            self._wake_end.send(b".")

    # --- the thread -------------------------------------------------------------------------------------------------

    def _serve(self) -> None:
        while not self._is_ending:
            due = min(self._broadcaster.due, self._handler.kill_at, self._wheels.ends_at, self._endpoint.due)
            self._run_guarded(partial(self._serve_once, max(0.0, due - self._clock.now())))
        self._wheels.stop()
        self._run_guarded(self._broadcaster.send_state)
        end = self.feed.end
        result, reason, seconds = ("", "", 0.0) if end is None else (end.result, end.reason, end.seconds)
        for client in self._clients:
            client.send_message(RunOverMessage(run=self._name, result=result, reason=reason, seconds=seconds))
        until = self._clock.now() + FAREWELL_TIMEOUT
        while (
            any(client.has_unsent and not client.is_disconnected for client in self._clients)
            and self._clock.now() < until
        ):
            self._run_guarded(lambda: self._serve_once(0.05))
        for client in list(self._clients):
            self._drop(client)

    def _run_guarded(self, work: Callable[[], None]) -> None:
        """Call ``work``; log an exception, so that the socket stays in service."""
        try:
            work()
        except Exception:
            self._broadcaster.due = self._clock.now() + IDLE_STATE_INTERVAL
            log.exception("error in the control socket")

    def _serve_once(self, seconds: float) -> None:
        """Wait up to ``seconds`` for input, then do all due work."""
        for key, mask in self._selector.select(None if seconds == float("inf") else seconds):
            if key.data is LISTENER_KEY and isinstance(key.fileobj, socket.socket):
                self._accept(key.fileobj)
            elif key.fileobj is self._waker:
                self._drain_waker()
            elif mask & selectors.EVENT_WRITE:
                key.data.flush()
            if mask & selectors.EVENT_READ and isinstance(key.data, ControlClient):
                self._read_client(key.data)
        now = self._clock.now()
        self._wheels.check(now)
        self._endpoint.run_due_checks(now)
        if now >= self._broadcaster.due:
            self._broadcaster.send_state()
        self._broadcaster.send_pictures(now)
        self._handler.kill_if_overdue(now)
        self._update_registrations()

    def _update_registrations(self) -> None:
        """Drop disconnected clients; have the selector report when a client with unsent data can receive again."""
        for client in list(self._clients):
            if client.is_disconnected:
                self._drop(client)
            else:
                events = selectors.EVENT_READ | (selectors.EVENT_WRITE if client.has_unsent else 0)
                if self._selector.get_key(client.connection).events != events:
                    self._selector.modify(client.connection, events, client)

    def _drain_waker(self) -> None:
        """Empty the pipe by which other threads wake the control thread, and schedule a state message."""
        with suppress(OSError):
            while self._waker.recv(4096):
                pass
        self._broadcaster.schedule_state()

    def _accept(self, listener: socket.socket) -> None:
        try:
            connection, address = listener.accept()
        except OSError as error:
            if error.errno in (errno.EMFILE, errno.ENFILE) and not self._drop_idle_client():
                self._endpoint.pause_accepting(listener, self._clock.now())  # or the selector loops
            return
        if self._endpoint.is_probe(address) or sockets.peer_credentials(connection)[1] not in (0, os.geteuid()):
            connection.close()
            return
        if len(self._clients) >= MAX_CLIENTS and not self._drop_idle_client():
            connection.close()
            return
        client = ControlClient(connection, self._name, self._broadcaster.encode_state)
        self._clients.append(client)
        self._selector.register(connection, selectors.EVENT_READ, client)
        client.send_message(self._run_message())

    def _drop_idle_client(self) -> bool:
        """Disconnect the oldest client that neither watches nor drives, to make room for a stop."""
        idle = (each for each in self._clients if each.watch == WATCH_NOTHING and not self._wheels.is_participant(each))
        found = next(idle, None)
        if found is not None:
            self._drop(found)
        return found is not None

    def _drop(self, client: ControlClient) -> None:
        """Disconnect a client; if it was driving, the base stops at once."""
        self._clients.remove(client)
        self._wheels.give(client)
        self._selector.unregister(client.connection)
        client.connection.close()
        self._broadcaster.update_watches()

    def _read_client(self, client: ControlClient) -> None:
        for line in client.read_lines():
            self._handle_line(client, line)
        if client.is_disconnected:
            self._wheels.give(client)  # before all else: its drive commands must end

    def _handle_line(self, client: ControlClient, line: bytes) -> None:
        number: int | None = None
        try:
            command = read_command(line)
            number = command.id
            result = self._execute(client, command)
        except BadMessage as error:
            hint = error.hint or None
            client.send_message(
                AnswerMessage(id=find_id(line), ok=False, error=error.error, message=str(error), hint=hint)
            )
        except Exception as error:  # an error of a driver must not end the socket
            client.send_message(
                AnswerMessage(id=number, ok=False, error="fault", message=f"{type(error).__name__}: {error}")
            )
        else:
            if number is not None:
                client.send_message(AnswerMessage(id=number, ok=True, result=result))

    def _execute(self, client: ControlClient, command: ClientCommand) -> Mapping[str, object] | None:
        match command:
            case PictureShownCommand():
                client.on_picture_shown(command.t)
            case WatchCommand():
                self._broadcaster.watch(client, command)
            case DriveCommand() | LookCommand():
                self._handler.execute(client, command)
            case _:
                self._broadcaster.due = self._clock.now()  # send its effect at once
                result = self._handler.execute(client, command)
                if isinstance(command, StopCommand | ReleaseCommand):
                    for each in self._clients:
                        each.send_message(self._run_message())
                return result
        return None

    def _run_message(self) -> RunMessage:
        latch = self._runner.latch
        return replace(self._run_info, stops=latch.stop_count, stopped=latch.reason)
