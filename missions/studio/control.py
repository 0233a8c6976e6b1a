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
from threading import Thread
from types import TracebackType
from typing import Literal, Self

from behaviours.run import log
from drivers.clock import Clock, SystemClock, time_of_day
from missions.executive.events import Event
from missions.runner import Runner
from missions.studio import sockets
from missions.studio.audience import IDLE, NOTHING, Audience, Client
from missions.studio.commands import Command, Drive, Look, Release, Seen, Stop, Watch
from missions.studio.doing import Doing
from missions.studio.endpoint import LISTENER, Endpoint
from missions.studio.form import BadMessage
from missions.studio.holders import require_stop
from missions.studio.messages import Answer, Over, Run
from missions.studio.outlet import Outlet
from missions.studio.pictures import Pictures
from missions.studio.reading import id_in, read_command
from missions.studio.wheels import Wheels

FAREWELL = 0.5
"""Seconds that clients have, in the end, to hear the last."""

MOST_CLIENTS = 64
"""Connections at once; for one more, one that is idle is hung up on."""


class ControlSocket:
    """Serves the control socket of a ``runner`` while it is entered, and listens to its events.

    ``pictures`` is who gets the frames. What goes wrong with the socket itself is in ``trouble``; ``require_stop``
    raises it for a run that would move a robot.
    """

    def __init__(self, runner: Runner, pictures: Pictures, *, clock: Clock | None = None) -> None:
        self._runner, self._pictures = runner, pictures
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
        self._audience = Audience(self._name, runner, self.outlet, pictures, self._doing, self._clock, of)
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
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
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
