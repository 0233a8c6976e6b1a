"""The control socket of a run: whoever may use it watches, drives, pauses, ends and stops the run.

It is served by a thread of its own: what the tick does, and what clients do or leave undone, does not matter to it, nor
does it to them. A stop goes from here straight to the drivers.
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
from drivers.api.quick import dataclass
from drivers.clock import Clock, SystemClock, time_of_day
from missions.control import abstract, sockets
from missions.control.audience import IDLE, NOTHING, Audience, Client
from missions.control.commands import BadMessage, Command, Drive, Look, Release, Seen, Stop, Watch, id_in, read_command
from missions.control.doing import Doing
from missions.control.holders import require_stop
from missions.control.messages import Answer, Over, Run
from missions.control.notes import Notes
from missions.control.outlet import Outlet
from missions.control.pictures import Pictures
from missions.control.places import CHECK_TIMEOUT, FOLDER_TIMEOUT, FolderTimeoutError, Place, places, within
from missions.control.wheels import Wheels
from missions.executive.events import Event
from missions.runner import Runner

# Where a run can be stopped: its listening sockets, and the notes that name them, looked after while it goes on.

CHECK_INTERVAL = 1.0
"""Seconds from one look whether the sockets can be reached to the next."""

BREATH = 0.1
"""Seconds for which nobody is let in where the process has no descriptor left for one more."""

LISTENER = object()
"""The data of the sockets among all that the selector waits for."""

BUSY = {errno.EMFILE, errno.ENFILE, errno.ENOMEM, errno.ENOBUFS, errno.EAGAIN}
"""Errors of a connection that say nothing of the socket: this process has no descriptor left, or many ask at once."""


@dataclass(slots=True)
class Listener:
    """A socket that listens at an ``address``; of a file, ``inode`` tells it from one that was put in its place."""

    address: sockets.Address
    socket: socket.socket
    inode: int = 0


class Endpoint:
    """The sockets and notes of a run, for one thread, which waits for ``selector``: its key has the data ``LISTENER``.

    ``trouble`` says why no stop can reach the run; empty where one can.
    """

    def __init__(self, selector: selectors.BaseSelector, of_run: Run) -> None:
        self.trouble = ""
        self.due = 0.0
        """When something is to be done, in seconds of the clock whose time ``turn`` is given."""
        self._selector, self._of_run = selector, of_run
        self._notes: Notes | None = None
        self._file: Listener | None = None
        self._abstract: Listener | None = None
        self._registered: list[socket.socket] = []
        self._probes: set[object] = set()
        self._errors: list[str] = []
        self._held: int | None = None
        self._check_at = 0.0
        self._seconds = FOLDER_TIMEOUT

    @property
    def listeners(self) -> list[socket.socket]:
        """Those that there are now."""
        return [each.socket for each in (self._file, self._abstract) if each is not None]

    def turn(self, now: float) -> None:
        """Look after sockets and notes, if it is time; and let people in again after a rest."""
        if now < self.due:
            return
        if now >= self._check_at:
            self._check_at = now + CHECK_INTERVAL
            self.check()
            self._seconds = CHECK_TIMEOUT  # from now on stops are heard by this thread
        self.due = self._check_at
        for each in self._registered:
            with suppress(KeyError, ValueError):  # it is closed, or at rest
                self._selector.unregister(each)
        self._registered = self.listeners
        for each in self._registered:
            self._selector.register(each, selectors.EVENT_READ, LISTENER)

    def rest(self, listener: socket.socket, now: float) -> None:
        """Let nobody in for a moment."""
        self._selector.unregister(listener)
        self.due = min(self.due, now + BREATH)

    def check(self) -> None:
        """Listen where no socket can be reached, or not any more, and write the notes that are missing."""
        self._errors = []
        self._probes.clear()
        self._file = self._kept(self._file) or self._listen_in_a_folder()
        self._abstract = self._kept(self._abstract) or self._listen_by_name()
        found = [each for each in (self._file, self._abstract) if each is not None]
        noted = self._note([str(each.address) for each in found])
        self.trouble = "" if found and noted else "; ".join(self._errors)

    def is_probe(self, peer: object) -> bool:
        """Return whether a connection that has come from there is this endpoint's own look at itself."""
        return peer in self._probes

    def close(self) -> None:
        """Remove sockets and notes."""
        if self._notes is not None:
            self._notes.close()  # before the sockets: without those the run would be taken for one that hangs
        for each in (self._file, self._abstract):
            if each is not None:
                if isinstance(each.address, Path):
                    with suppress(OSError):  # the folder cannot be written any more: nobody answers there
                        if _inode(each.address) == each.inode:
                            within(each.address.parent, partial(each.address.unlink, missing_ok=True))
                each.socket.close()
        self._file = self._abstract = None
        if self._held is not None:
            os.close(self._held)
            self._held = None

    def _listen_in_a_folder(self) -> Listener | None:
        """Listen in the first folder that can be used."""
        for place in places(seconds=self._seconds):
            if place.is_own:
                path = place.folder / f"{self._of_run.run}{sockets.ENDING}"
                try:
                    return within(place.folder, partial(_listen, place, path), self._seconds)
                except OSError as error:
                    self._errors.append(f"no control socket in {place.folder}: {error.strerror or error}")
        return None

    def _listen_by_name(self) -> Listener | None:
        try:
            name = abstract.name_of(self._of_run.run, "run", simulated=bool(self._of_run.simulated))
            with suppress(OSError):  # an old kernel: that is one way of several
                self._held = abstract.hold(name) if self._held is None else self._held
            found = abstract.listen(name)
        except OSError as error:
            self._errors.append(f"no abstract control socket: {error.strerror or error}")
            return None
        found.setblocking(False)
        return Listener(name.address, found)

    def _note(self, listening: list[str]) -> bool:
        """Leave notes of the sockets; return whether there is one."""
        try:
            if self._notes is None:
                about = self._of_run
                self._notes = Notes(about.run, about.mission, about.robot, about.simulated, is_run=True)
            self._notes.write(listening, self._seconds)
        except OSError as error:
            self._errors.append(f"no note of the run: {error.strerror or error}")
            return False
        return True

    def _kept(self, listener: Listener | None) -> Listener | None:
        """Return a listener that can be reached; else close it."""
        if listener is None or self._can_be_reached(listener):
            return listener
        with suppress(OSError):  # something else may have closed it
            listener.socket.close()
        return None

    def _can_be_reached(self, listener: Listener) -> bool:
        """Return whether who connects to the address of a listener reaches it, as far as that can be seen now."""
        try:
            if isinstance(listener.address, str):
                self._probe(listener)
            else:
                within(listener.address.parent, partial(self._probe, listener), self._seconds)
        except FolderTimeoutError:
            return True  # nothing can be put in its place either
        except OSError as error:
            return error.errno in BUSY
        return True

    def _probe(self, listener: Listener) -> None:
        """Connect to the address of a listener. Raises OSError where another socket is there, or none."""
        if isinstance(listener.address, Path) and listener.address.stat().st_ino != listener.inode:
            raise FileNotFoundError(f"{listener.address} is another one")
        with socket.socket(socket.AF_UNIX) as probe, sockets.address(listener.address) as target:
            probe.setblocking(False)
            probe.bind("")  # the kernel gives it a name, by which the connection is known
            self._probes.add(probe.getsockname())
            probe.connect(target)


def _listen(place: Place, path: Path) -> Listener:
    """Return a listener in a folder. Raises OSError."""
    place.prepare()
    found = sockets.listen(path)
    found.setblocking(False)
    return Listener(path, found, path.stat().st_ino)


def _inode(path: Path) -> int:
    """Return the inode at a path; 0 where there is none, or its folder hangs."""
    try:
        return within(path.parent, path.stat).st_ino
    except OSError:
        return 0


FAREWELL = 0.5
"""Seconds that clients have, in the end, to hear the last."""

MOST_CLIENTS = 64
"""Connections at once; for one more, one that is idle is hung up on."""


class ControlSocket:
    """Serves the control socket of a ``runner`` while it is entered, and listens to its events.

    What goes wrong with the socket itself is in ``trouble``; ``require_stop``
    raises it for a run that would move a robot.
    """

    def __init__(self, runner: Runner, *, clock: Clock | None = None) -> None:
        self._runner, self._pictures = runner, Pictures()
        runner.observe(on_view=self._pictures.view, on_frame=self._pictures.frame)
        self._clock = clock or SystemClock()
        self.outlet = Outlet(runner, wall=self._clock)
        robot = runner.assembled.robot
        self._wheels = Wheels(robot.base_part, robot.head_part, self._clock)
        self._doing = Doing(runner, self._wheels, self._clock)
        if runner.paused_pace is not None:
            runner.paused_pace.driven = lambda: bool(self._wheels.driver) and not runner.latch.reason
            runner.paused_pace.waited = self.outlet.look
        simulated: Literal["", "wire", "fast"] = runner.order.simulation or ""
        of = {"simulated": simulated, "world": runner.order.world_name}
        began = time_of_day().timestamp()
        self._name = sockets.new_run()
        self._of_run = Run(
            run=self._name,
            pid=os.getpid(),
            mission=runner.plan.mission,
            robot=runner.assembled.name,
            simulated=simulated,
            began=round(began, 3),
        )
        self._selector = selectors.DefaultSelector()
        self._endpoint = Endpoint(self._selector, self._of_run)
        self._audience = Audience(self._name, runner, self.outlet, self._pictures, self._doing, self._clock, of)
        self._clients = self._audience.clients
        self._waker, self._wake_end = socket.socketpair()
        self._ending = False
        self._thread: Thread | None = None
        runner.stream.listeners.append(self)

    def __call__(self, event: Event) -> None:
        """Keep an event of the run."""
        self.outlet(event)

    def __enter__(self) -> Self:
        for end in (self._waker, self._wake_end):
            end.setblocking(False)
        self._endpoint.turn(self._clock.now())  # without a listener too: it may get one later, and a signal ends it
        self._selector.register(self._waker, selectors.EVENT_READ)
        self.outlet.wake = self._pictures.wake = self._wake
        self._thread = Thread(target=self._serve, name="control", daemon=True)
        self._thread.start()
        self._runner.is_reachable = True
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._runner.is_reachable = False
        if self._thread is not None:
            self._ending = True
            self._wake()
            self._thread.join()
            self._thread = None
            self._hang_up()

    @property
    def trouble(self) -> str:
        """Why no stop can reach the run; empty where one can."""
        return self._endpoint.trouble

    def require_stop(self, allowed: str) -> None:
        """Raise NoStop where the run would move a robot and no stop can reach it, unless the user allows that.

        ``allowed`` is what to type for that.
        """
        order = self._runner.order
        if self.trouble and not order.without_stop:
            require_stop(self.trouble, simulated=order.simulation is not None, allowed=allowed)

    def _hang_up(self) -> None:
        self._endpoint.close()
        sockets.forget_run(self._name)
        self._selector.close()
        for end in (self._waker, self._wake_end):
            end.close()

    def _wake(self) -> None:
        with suppress(OSError):  # it is full: it wakes anyway
            self._wake_end.send(b".")

    # --- the thread -------------------------------------------------------------------------------------------------

    def _serve(self) -> None:
        while not self._ending:
            due = min(self._audience.due, self._doing.kill_at, self._wheels.ends_at, self._endpoint.due)
            self._guarded(partial(self._turn, max(0.0, due - self._clock.now())))
        self._wheels.stop()
        self._guarded(self._audience.tell)
        end = self.outlet.end
        result, reason, seconds = ("", "", 0.0) if end is None else (end.result, end.reason, end.seconds)
        for client in self._clients:
            client.tell(Over(run=self._name, result=result, reason=reason, seconds=seconds))
        until = self._clock.now() + FAREWELL
        while any(client.waiting and not client.gone for client in self._clients) and self._clock.now() < until:
            self._guarded(lambda: self._turn(0.05))
        for client in list(self._clients):
            self._drop(client)

    def _guarded(self, work: Callable[[], None]) -> None:
        """Do something; whatever a driver raises meanwhile, the socket serves on."""
        try:
            work()
        except Exception:
            self._audience.due = self._clock.now() + IDLE
            log.exception("the control socket stumbled")

    def _turn(self, seconds: float) -> None:
        """Wait so long for something to happen, and do what is due."""
        for key, mask in self._selector.select(None if seconds == float("inf") else seconds):
            if key.data is LISTENER and isinstance(key.fileobj, socket.socket):
                self._accept(key.fileobj)
            elif key.fileobj is self._waker:
                self._drain()
            elif mask & selectors.EVENT_WRITE:
                key.data.flush()
            if mask & selectors.EVENT_READ and isinstance(key.data, Client):
                self._hear(key.data)
        now = self._clock.now()
        self._wheels.check(now)
        self._endpoint.turn(now)
        if now >= self._audience.due:
            self._audience.tell()
        self._audience.show(now)
        self._doing.look(now)
        self._renew()

    def _renew(self) -> None:
        """Drop those who have gone, and wait for those who could not take all that there is."""
        for client in list(self._clients):
            if client.gone:
                self._drop(client)
            else:
                events = selectors.EVENT_READ | (selectors.EVENT_WRITE if client.waiting else 0)
                if self._selector.get_key(client.connection).events != events:
                    self._selector.modify(client.connection, events, client)

    def _drain(self) -> None:
        """Something has happened: it is to be told."""
        with suppress(OSError):
            while self._waker.recv(4096):
                pass
        self._audience.hurry()

    def _accept(self, listener: socket.socket) -> None:
        try:
            connection, address = listener.accept()
        except OSError as error:
            if error.errno in (errno.EMFILE, errno.ENFILE) and not self._make_room():
                self._endpoint.rest(listener, self._clock.now())  # it would be ready again and again
            return
        if self._endpoint.is_probe(address) or sockets.peer_of(connection)[1] not in (0, os.geteuid()):
            connection.close()
            return
        if len(self._clients) >= MOST_CLIENTS and not self._make_room():
            connection.close()
            return
        client = Client(connection, self._name, self._audience.encoded)
        self._clients.append(client)
        self._selector.register(connection, selectors.EVENT_READ, client)
        client.tell(self._about())

    def _make_room(self) -> bool:
        """Hang up on the oldest client that neither watches nor drives: the next one may be somebody with a stop."""
        idle = (each for each in self._clients if each.watch == NOTHING and not self._wheels.knows(each))
        found = next(idle, None)
        if found is not None:
            self._drop(found)
        return found is not None

    def _drop(self, client: Client) -> None:
        """A client has gone: where it drove, the base stops now."""
        self._clients.remove(client)
        self._wheels.give(client)
        self._selector.unregister(client.connection)
        client.connection.close()
        self._audience.look_at_watches()

    def _hear(self, client: Client) -> None:
        for line in client.read():
            self._answer(client, line)
        if client.gone:
            self._wheels.give(client)  # at once, before anything else is done

    def _answer(self, client: Client, line: bytes) -> None:
        """Do what a client asks for, and answer."""
        number: int | None = None
        try:
            command = read_command(line)
            number = command.id
            result = self._do(client, command)
        except BadMessage as error:
            hint = error.hint or None
            client.tell(Answer(id=id_in(line), ok=False, error=error.error, message=str(error), hint=hint))
        except Exception as error:  # of a driver: the socket serves on
            client.tell(Answer(id=number, ok=False, error="fault", message=f"{type(error).__name__}: {error}"))
        else:
            if number is not None:
                client.tell(Answer(id=number, ok=True, result=result))

    def _do(self, client: Client, command: Command) -> Mapping[str, object] | None:
        match command:
            case Seen():
                client.seen(command.t)
            case Watch():
                self._audience.watch(client, command)
            case Drive() | Look():
                self._doing.do(client, command)
            case _:
                self._audience.due = self._clock.now()  # what comes of it is told at once
                result = self._doing.do(client, command)
                if isinstance(command, Stop | Release):
                    for each in self._clients:
                        each.tell(self._about())
                return result
        return None

    def _about(self) -> Run:
        latch = self._runner.latch
        return replace(self._of_run, stops=latch.number, stopped=latch.reason)
