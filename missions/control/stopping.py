"""Every run of this machine stopped, or released, at once; and each command that moves a robot and is no run ended.

A run counts as stopped once it has answered that all is latched, or once its process has ended. All else is a doubt.
"""

import secrets
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import field
from threading import Lock, Thread
from typing import Any

from drivers.api.quick import dataclass
from missions.control import sockets
from missions.control.notes import END_TIME, Holder, stamp_stop
from missions.control.processes import ProcessIdentity, identity_of
from missions.control.searching import Found, Search, is_own, reason_of, runs_by_name, search
from missions.control.sockets import RunLink

Said = dict[object, tuple[bool, str]]
"""What came of each that was asked: whether it is good, and the words for people."""

Command = Mapping[str, object]

RUN_END_TIME = 7.0
"""Seconds that a run which does not answer has to end after SIGTERM: its lifeline kills it after 5."""

STOP_TRIES = 8
"""Times that a run is asked to stop while one of its parts has not confirmed: a busy machine may be late by 0.2 s."""

GONE = (ConnectionRefusedError, FileNotFoundError)
"""Errors of a connection to a socket of which nobody listens any more, or which has been removed."""


def ask_all(
    asked: Sequence[Command],
    by: str,
    which: Sequence[str] = (),
    *,
    found: Search | None = None,
    only: Callable[[Mapping[str, Any]], bool] = lambda _: True,
) -> Said:
    """Ask all runs, or those of ``which``, one thing after another; return what came of it, within a second or so.

    Where a stop is asked for, commands that have no latch are ended too; where nothing is, all are listed. ``found`` is
    what a search has found just now; of the runs it is ``only`` those with such a first message. What could not be
    looked at, and could be meant, is returned as well.
    """
    asking = Asking(asked, by, which, only)
    if asking.stops:
        asking.ask_by_name(runs_by_name())  # at once, whatever the folders are like that are looked at next
    unstamped = stamp_stop() if asking.stops and not which else ""
    found = search(thorough=False) if found is None else found
    work = asking.begin(found.found)
    known = {each.key for each in found.found}
    found = search()  # what is there at once does not wait for this
    work += asking.begin([each for each in found.found if each.key not in known])
    for thread in [*work, *(thread for _, thread in asking.early.values())]:
        thread.join()
    if not which or not asking.answered.issuperset(which):
        asking.said |= {each: (False, each.words) for each in found.doubts}
    if unstamped and not asking.said:
        asking.said["stamp"] = False, unstamped
    for name in which:
        if name not in asking.meant:
            asking.said[name] = False, f"no run {name}: `mission stop --list` lists what runs"
    return asking.said


@dataclass(slots=True)
class Asking:
    """One thing asked of many, from a thread for each. ``said`` is what came of it, ``answered`` the runs that have.

    ``results`` are what runs have answered to a stop, ``meant`` those names of ``which`` that there are. ``early`` are
    the runs that were asked by name alone, each with the thread that does.
    """

    commands: Sequence[Command]
    by: str
    which: Sequence[str] = ()
    only: Callable[[Mapping[str, Any]], bool] = lambda _: True
    said: Said = field(default_factory=dict)
    answered: set[str] = field(default_factory=set)
    meant: set[str] = field(default_factory=set)
    results: dict[object, Mapping[str, Any]] = field(default_factory=dict)
    early: dict[object, tuple[Found, Thread]] = field(default_factory=dict)
    _press: str = field(default_factory=lambda: secrets.token_hex(8))
    _claimed: set[object] = field(default_factory=set)
    _lock: Lock = field(default_factory=Lock)

    @property
    def stops(self) -> bool:
        """Whether a stop is asked for."""
        return any(command["do"] == "stop" for command in self.commands)

    def begin(self, found: Sequence[Found]) -> list[Thread]:
        """Ask all at the same time, so that one that hangs holds up no other; return the threads that do."""
        work = list[Thread]()
        for each in found:
            thread = Thread(target=self.ask, args=(each,))
            try:
                thread.start()
            except RuntimeError:  # the system allows no more threads
                self.ask(each)
            else:
                work.append(thread)
        return work

    def ask_by_name(self, found: Sequence[Found]) -> None:
        """Begin to ask runs that the kernel lists. One that does not answer is left to ``begin``, which knows more."""

        def work(each: Found) -> None:
            unanswered = suppress(OSError, ValueError, KeyError, TypeError, AttributeError)
            with unanswered, sockets.linked(each.addresses[0]) as link:
                if link.told and each.is_at(link.process) and link.uid == each.uid:
                    self._ask_by(each, link)

        for each in found:
            if each.addresses and each.is_meant(self.which) is not False:
                thread = Thread(target=work, args=(each,))
                with suppress(RuntimeError):  # the system allows no more threads
                    thread.start()
                    self.early[each.key] = each, thread

    def ask(self, found: Found) -> None:
        """Ask one, if it is meant, and note what came of it."""
        if found.key in self.early:
            early, thread = self.early[found.key]
            thread.join()
            if early in self.said:
                return
        if found.is_meant(self.which) is False:
            return
        self.meant |= found.names.intersection(self.which)
        try:
            if found.is_command:
                self._end(found)
            else:
                self._ask_run(found)
        except Exception as error:  # whatever it is: what was not asked is not taken for what was stopped
            self._doubt(found, f"{found.words}: {type(error).__name__}: {error}")

    def _doubt(self, found: Found, why: str, peer: ProcessIdentity | None = None) -> None:
        """Note that a run has perhaps not been stopped, or has not done what was asked. ``peer`` listens for it."""
        hint = found.way_to_end(peer) if self.stops else f"mission stop {found.run}  (which ends it)"
        self.said[found] = False, f"{why}{': perhaps not stopped' * self.stops}\n  try: {hint}"

    def _ask_run(self, found: Found) -> None:
        """Ask a run at one of its addresses; where it answers at none of them, end its process if it was to stop."""
        failed = list[OSError | ValueError]()
        peer: ProcessIdentity | None = None
        for address in found.addresses:
            try:
                with sockets.linked(address) as link:
                    if not found.is_at(link.process) or (isinstance(address, str) and link.uid != found.uid):
                        continue  # another run has this name, or another user has given a socket this name
                    peer = peer or identity_of(link.process)
                    self._ask_by(found, link)
                    return
            except (OSError, ValueError) as error:
                failed.append(error)
        self._has_not_answered(found, failed, peer)

    def _ask_by(self, found: Found, link: RunLink) -> None:
        """Ask a run by way of a link, if it is meant, and note its answer. Raises OSError where it does not answer."""
        told = link.told
        if not told and not self.stops:
            raise TimeoutError("it does not answer")
        if told and not self._is_meant(found, link):
            return
        try:
            words = [self._done(found, link, command) for command in self.commands]
        except BaseException:
            self._claimed.discard(_claim_of(link))  # it may answer by another way
            raise
        name = found.words if found.holder is not None or not told else _words_of(link)
        self.said[found] = all(good for good, _ in words), name + "".join(f": {each}" for _, each in words)
        self.answered.add(found.run)

    def _is_meant(self, found: Found, link: RunLink) -> bool:
        """Return whether a run is meant that tells what it is, and nobody asks it already by another way."""
        told = link.told
        names = {found.run, str(told.get("run")), str(link.process), str(told.get("mission"))}
        if (self.which and names.isdisjoint(self.which)) or not self.only(told):
            return False
        self.meant |= names.intersection(self.which)
        known = _claim_of(link)
        with self._lock:
            is_new = known not in self._claimed
            self._claimed.add(known)
        return is_new

    def _done(self, found: Found, link: RunLink, command: Command) -> tuple[bool, str]:
        """Have one thing done, and say what came of it. Raises OSError where nobody answers."""
        if command["do"] == "release":
            command = {**command, "stop": link.last_stop()}
        elif command["do"] == "stop":
            command = {**command, "press": self._press}
        for _ in range(STOP_TRIES):
            answer = link.ask({**command, "by": self.by})
            if not answer["ok"]:
                hint = answer.get("hint")
                return False, str(answer["message"]) + (f"\n  try: {hint}" if hint else "")
            result: Mapping[str, Any] = answer.get("result") or {}
            if not result.get("missing"):
                break
        if command["do"] == "stop":
            self.results[found] = result
        parts = ", ".join(result.get("parts", ()))
        if missing := ", ".join(result.get("missing", ())):
            told = f"perhaps not stopped: {missing} (stopped: {parts or 'nothing'})"
            return False, f"{told}\n  try: mission stop --end {link.process or found.run}, or the robot's own switch"
        words = {
            "stop": f"stopped ({parts or 'it has nothing that moves'})",
            "halt": "is being ended",
            "release": "released, and paused",
            "resume": "goes on",
        }
        return True, words[str(command["do"])]

    def _has_not_answered(self, found: Found, failed: Sequence[Exception], peer: ProcessIdentity | None) -> None:
        """Note of a run that does not answer what that means; end its process, if it was to stop."""
        is_gone = all(isinstance(error, GONE) for error in failed)
        if is_gone and found.identity is None and found.holder is None:
            return  # the file of a process that was killed: what lives has a note, or a name, besides
        why = "; ".join(dict.fromkeys(f"{getattr(each, 'strerror', None) or each}" for each in failed))
        why = f"hangs ({why or 'it has no socket'})"
        try:
            if not found.lives(peer) or (is_gone and not _is_there(found, search())):
                return  # it has ended meanwhile
        except OSError as error:
            self._doubt(found, f"{found.words}: {why}; {reason_of(error)}", peer)
            return
        if not self.stops or found.is_meant(self.which) is None:
            self._doubt(found, f"{found.words}: {why}", peer)
        else:
            self._terminate(found, peer, why)

    def _terminate(self, found: Found, peer: ProcessIdentity | None, why: str) -> None:
        """Send a run that hangs the signal that its watchdog hears, and wait for its end."""
        identity = found.visible or peer
        try:
            found.terminate(peer)
            if identity is not None and identity.has_ended_within(RUN_END_TIME):
                self.said[found] = True, f"{found.words}: {why}; SIGTERM was sent, which has ended it"
                self.answered.add(found.run)
                return
        except OSError as error:
            self._doubt(found, f"{found.words}: {why}; no SIGTERM could be sent: {reason_of(error)}", peer)
            return
        why = f"{why}; SIGTERM was sent, and has not ended it within {RUN_END_TIME:g} s"
        self._doubt(found, f"{found.words}: {why}", peer)

    def _end(self, found: Found) -> None:
        """End a command that holds a robot, and note what came of it."""
        if is_own(found) or any(command["do"] in ("release", "resume") for command in self.commands):
            return  # what was ended is not there to be released
        if found.is_meant(self.which) is None:
            self._doubt(found, f"{found.words}: it is not known which command it is")
            return
        if not self.commands:
            self.said[found] = True, found.words
            return
        try:
            has_ended = found.as_holder().end(self.by)
        except OSError as error:
            self._doubt(found, f"{found.words}: could not be ended: {reason_of(error)}")
            return
        if has_ended:
            self.said[found] = True, f"{found.words}: ended, with what it moved at rest"
            self.answered.add(found.run)
        else:
            self._doubt(found, f"{found.words}: hangs (SIGTERM did not end it in {END_TIME:g} s)")


def stop_one(found: Found, by: str) -> Mapping[str, object]:
    """Stop one run, or end one command; return what is told of it. Nothing where it has gone, or is this process."""
    asking = Asking([{"do": "stop"}], by)
    asking.ask(found)
    result = asking.results.get(found, {})
    if found not in asking.said:
        return {}
    is_good, words = asking.said[found]
    if not is_good:
        return {**result, "trouble": words}
    return result or {"ended": found.words}


def _is_there(found: Found, now: Search) -> bool:
    """Return whether what was found is there still, or that is not known."""
    return bool(now.doubts) or any(each.run == found.run and each.identity == found.identity for each in now.found)


def _claim_of(link: RunLink) -> object:
    """Return what tells a run from all others that were asked, by what it tells of itself."""
    return link.process, *(link.told.get(each) for each in ("pid", "run", "began"))


def _words_of(link: RunLink) -> str:
    """Return what a run tells that it is."""
    told = link.told
    mission, robot, simulated = (str(told.get(name, "")) for name in ("mission", "robot", "simulated"))
    process = link.process or told.get("pid", 0)  # the kernel does not tell the number of one in another container
    return Holder(process, mission, robot, simulated, run=str(told.get("run", ""))).words
