"""Stops or releases every run of this user on this computer at once, and ends each command that moves a robot.

A run counts as stopped once it has confirmed the latch, or once its process has ended. Anything else is a warning.
"""

import secrets
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import field
from threading import Lock, Thread
from typing import Any

from drivers.api.fast_dataclass import dataclass
from missions.control import sockets
from missions.control.notes import END_TIMEOUT, RobotHolder, stamp_stop
from missions.control.processes import ProcessIdentity, identity_of
from missions.control.run_search import FoundProcess, SearchResult, error_text, is_own_process, listed_runs, search_runs
from missions.control.sockets import RunConnection

StopOutcomes = dict[object, tuple[bool, str]]
"""Outcomes of the commands by run: whether all commands succeeded, and a text for people."""

JsonCommand = Mapping[str, object]

RUN_END_TIMEOUT = 7.0
"""Seconds to wait for the end of a hanging run after SIGTERM; the run's lifeline process kills it after 5 s."""

STOP_TRIES = 8
"""Maximum number of stop requests to a run until all its parts have confirmed; one may take over 0.2 s."""

NOT_STOPPED = "not stopped"
"""Start of the reply to ``release`` of a run that is not stopped."""

GONE_ERRORS = (ConnectionRefusedError, FileNotFoundError)
"""Errors of a connection to a socket without a listener, or a removed one."""


def send_to_all(
    commands: Sequence[JsonCommand],
    by: str,
    wanted_names: Sequence[str] = (),
    *,
    search_result: SearchResult | None = None,
    is_wanted: Callable[[Mapping[str, Any]], bool] = lambda _: True,
) -> StopOutcomes:
    """Send ``commands`` in order to all runs, or to those with ``wanted_names``; return the outcomes.

    This takes about a second. Without commands, it only lists the runs, and the commands that move a robot without
    being a run, such as teleop. A stop also ends these commands. ``by`` is the person who sends them. ``search_result``
    is the result of a search for runs just before, if the caller has one. ``is_wanted`` is called with the first
    message of each run, and returns False to leave the run out. For each folder that could not be searched for runs,
    the outcomes contain a failure.
    """
    asking = CommandBroadcast(commands, by, wanted_names, is_wanted)
    if asking.is_stop:
        asking.request_listed(listed_runs())  # before the folders, which may be slow
    unstamped = stamp_stop() if asking.is_stop and not wanted_names else ""
    search_result = search_runs(thorough=False) if search_result is None else search_result
    work = asking.start_requests(search_result.processes)
    known = {each.key for each in search_result.processes}
    search_result = search_runs()  # quick results are not delayed by this
    work += asking.start_requests([each for each in search_result.processes if each.key not in known])
    for thread in [*work, *(thread for _, thread in asking.early_requests.values())]:
        thread.join()
    if not wanted_names or not asking.replied_runs.issuperset(wanted_names):
        asking.outcomes |= {each: (False, each.message) for each in search_result.warnings}
    if unstamped and not asking.outcomes:
        asking.outcomes["stamp"] = False, unstamped
    for name in wanted_names:
        if name not in asking.matched_names:
            asking.outcomes[name] = False, f"no run {name}: `mission stop --list` lists the runs"
    return asking.outcomes


@dataclass(slots=True)
class CommandBroadcast:
    """Sends commands to many runs, each in its own thread, and collects the ``outcomes``.

    ``replied_runs`` are the names of the runs that have replied, ``results`` are their answers to a stop.
    ``matched_names`` are those of ``wanted_names`` that exist. ``early_requests`` are the runs that were found first,
    in the kernel's list of sockets, each with the thread that sends the commands to it.
    """

    commands: Sequence[JsonCommand]
    by: str
    wanted_names: Sequence[str] = ()
    is_wanted: Callable[[Mapping[str, Any]], bool] = lambda _: True
    outcomes: StopOutcomes = field(default_factory=dict)
    replied_runs: set[str] = field(default_factory=set)
    matched_names: set[str] = field(default_factory=set)
    results: dict[object, Mapping[str, Any]] = field(default_factory=dict)
    early_requests: dict[object, tuple[FoundProcess, Thread]] = field(default_factory=dict)
    _press: str = field(default_factory=lambda: secrets.token_hex(8))
    _claimed_runs: set[object] = field(default_factory=set)
    _lock: Lock = field(default_factory=Lock)

    @property
    def is_stop(self) -> bool:
        """True if the commands contain a stop."""
        return any(command["do"] == "stop" for command in self.commands)

    def start_requests(self, processes: Sequence[FoundProcess]) -> list[Thread]:
        """Start a thread for each process, so that a hanging one delays no other; return the threads."""
        work = list[Thread]()
        for each in processes:
            thread = Thread(target=self.request, args=(each,))
            try:
                thread.start()
            except RuntimeError:  # no thread can be started
                self.request(each)
            else:
                work.append(thread)
        return work

    def request_listed(self, processes: Sequence[FoundProcess]) -> None:
        """Start requests to runs in the kernel's socket list, before slow folders are searched.

        ``start_requests`` sends the commands again to each of these runs that has not replied.
        """

        def work(each: FoundProcess) -> None:
            unanswered = suppress(OSError, ValueError, KeyError, TypeError, AttributeError)
            with unanswered, sockets.open_connection(each.addresses[0]) as link:
                if link.run_info and each.is_process(link.process) and link.uid == each.uid:
                    self._request_over(each, link)

        for each in processes:
            if each.addresses and each.matches(self.wanted_names) is not False:
                thread = Thread(target=work, args=(each,))
                with suppress(RuntimeError):  # no thread can be started
                    thread.start()
                    self.early_requests[each.key] = each, thread

    def request(self, process: FoundProcess) -> None:
        """Send the commands to a process, unless ``wanted_names`` excludes it; store the outcome."""
        if process.key in self.early_requests:
            early, thread = self.early_requests[process.key]
            thread.join()
            if early in self.outcomes:
                return
        if process.matches(self.wanted_names) is False:
            return
        self.matched_names |= process.names.intersection(self.wanted_names)
        try:
            if process.is_command:
                self._end_command(process)
            else:
                self._request_run(process)
        except Exception as error:  # any error: a run that was not reached must not be reported as stopped
            self._add_warning(process, f"{process.description}: {type(error).__name__}: {error}")

    def _add_warning(self, process: FoundProcess, reason: str, peer: ProcessIdentity | None = None) -> None:
        """Store as outcome that a run may not have stopped, or not executed the command.

        ``reason`` says why; ``peer`` is the process that listens at the run's socket, if known.
        """
        hint = process.end_hint(peer) if self.is_stop else f"mission stop {process.run}  (which ends it)"
        self.outcomes[process] = False, f"{reason}{': perhaps not stopped' * self.is_stop}\n  try: {hint}"

    def _request_run(self, process: FoundProcess) -> None:
        """Send the commands to a run at its first address that replies; if none replies, a stop ends the process."""
        failed = list[OSError | ValueError]()
        peer: ProcessIdentity | None = None
        for address in process.addresses:
            try:
                with sockets.open_connection(address) as link:
                    if not process.is_process(link.process) or (isinstance(address, str) and link.uid != process.uid):
                        continue  # another run has the same name, or another user created a socket with this name
                    peer = peer or identity_of(link.process)
                    self._request_over(process, link)
                    return
            except (OSError, ValueError) as error:
                failed.append(error)
        self._handle_no_reply(process, failed, peer)

    def _request_over(self, process: FoundProcess, link: RunConnection) -> None:
        """Send the commands over the connection ``link``, and store the outcome.

        This does nothing if ``_claim_run`` refuses the run. Raises OSError if the run does not reply.
        """
        run_info = link.run_info
        if not run_info and not self.is_stop:
            raise TimeoutError("it does not answer")
        if run_info and not self._claim_run(process, link):
            return
        try:
            words = [self._execute(process, link, command) for command in self.commands] or [(True, _state_of(link))]
        except BaseException:
            self._claimed_runs.discard(_run_key(link))  # it may be reachable by another address
            raise
        if len(words) > 1 and words[0][1].startswith(NOT_STOPPED) and words[1][0]:
            words = [(True, "was not stopped; it goes on")]
        name = process.description if process.holder is not None or not run_info else _description_of(link)
        self.outcomes[process] = all(good for good, _ in words), name + "".join(f": {each}" for _, each in words)
        self.replied_runs.add(process.run)

    def _claim_run(self, process: FoundProcess, link: RunConnection) -> bool:
        """Return whether the run at ``link`` is to get the commands from this thread.

        It is not if ``wanted_names`` or ``is_wanted`` excludes it, or if another thread has claimed it already.
        """
        run_info = link.run_info
        names = {process.run, str(run_info.get("run")), str(link.process), str(run_info.get("mission"))}
        if (self.wanted_names and names.isdisjoint(self.wanted_names)) or not self.is_wanted(run_info):
            return False
        self.matched_names |= names.intersection(self.wanted_names)
        known = _run_key(link)
        with self._lock:
            is_new = known not in self._claimed_runs
            self._claimed_runs.add(known)
        return is_new

    def _execute(self, process: FoundProcess, link: RunConnection, command: JsonCommand) -> tuple[bool, str]:
        """Send one command; return whether it succeeded, and the text. Raises OSError if the run does not reply."""
        if command["do"] == "release":
            command = {**command, "stop": link.scene_state()["stops"]}
        elif command["do"] == "stop":
            command = {**command, "press": self._press}
        for _ in range(STOP_TRIES):
            answer = link.request({**command, "by": self.by})
            if not answer["ok"]:
                hint = answer.get("hint")
                return False, str(answer["message"]) + (f"\n  try: {hint}" if hint else "")
            result: Mapping[str, Any] = answer.get("result") or {}
            if not result.get("missing"):
                break
        if command["do"] == "stop":
            self.results[process] = result
        parts = ", ".join(result.get("parts", ()))
        if missing := ", ".join(result.get("missing", ())):
            message = f"perhaps not stopped: {missing} (stopped: {parts or 'nothing'})"
            return (
                False,
                f"{message}\n  try: mission stop --end {link.process or process.run}, or the robot's own switch",
            )
        words = {
            "stop": f"stopped ({parts or 'no actuators'})",
            "halt": "is being ended",
            "release": "released, and paused",
            "resume": "resumed",
        }
        return True, words[str(command["do"])]

    def _handle_no_reply(
        self, process: FoundProcess, errors: Sequence[Exception], peer: ProcessIdentity | None
    ) -> None:
        """Store the outcome for a run that does not reply; a stop ends its process."""
        is_gone = all(isinstance(error, GONE_ERRORS) for error in errors)
        if is_gone and process.identity is None and process.holder is None:
            return  # left by a killed process: a live one also has a note or an abstract name
        why = "; ".join(dict.fromkeys(f"{getattr(each, 'strerror', None) or each}" for each in errors))
        why = f"hangs ({why or 'it has no socket'})"
        try:
            if not process.is_alive(peer) or (is_gone and not _is_still_found(process, search_runs())):
                return  # it has ended meanwhile
        except OSError as error:
            self._add_warning(process, f"{process.description}: {why}; {error_text(error)}", peer)
            return
        if not self.is_stop or process.matches(self.wanted_names) is None:
            self._add_warning(process, f"{process.description}: {why}", peer)
        else:
            self._terminate(process, peer, why)

    def _terminate(self, process: FoundProcess, peer: ProcessIdentity | None, reason: str) -> None:
        """Send SIGTERM to a hanging run, which its watchdog handles, and wait for its end."""
        identity = process.local_identity or peer
        try:
            process.terminate(peer)
            if identity is not None and identity.has_ended_within(RUN_END_TIMEOUT):
                self.outcomes[process] = True, f"{process.description}: {reason}; ended by SIGTERM"
                self.replied_runs.add(process.run)
                return
        except OSError as error:
            self._add_warning(
                process, f"{process.description}: {reason}; SIGTERM could not be sent: {error_text(error)}", peer
            )
            return
        reason = f"{reason}; SIGTERM did not end it within {RUN_END_TIMEOUT:g} s"
        self._add_warning(process, f"{process.description}: {reason}", peer)

    def _end_command(self, process: FoundProcess) -> None:
        """End a command that moves a robot, such as teleop, and store the outcome."""
        if is_own_process(process) or any(command["do"] in ("release", "resume") for command in self.commands):
            return  # a process that the stop has ended cannot be released
        if process.matches(self.wanted_names) is None:
            self._add_warning(process, f"{process.description}: the command is unknown")
            return
        if not self.commands:
            self.outcomes[process] = True, process.description
            return
        try:
            has_ended = process.as_holder().end(self.by)
        except OSError as error:
            self._add_warning(process, f"{process.description}: could not be ended: {error_text(error)}")
            return
        if has_ended:
            self.outcomes[process] = True, f"{process.description}: ended, with its actuators at rest"
            self.replied_runs.add(process.run)
        else:
            self._add_warning(process, f"{process.description}: hangs (SIGTERM did not end it in {END_TIMEOUT:g} s)")


def stop_one(process: FoundProcess, by: str) -> Mapping[str, object]:
    """Stop one run, or end one command; return its answer. Empty if it has ended, or is this process."""
    asking = CommandBroadcast([{"do": "stop"}], by)
    asking.request(process)
    result = asking.results.get(process, {})
    if process not in asking.outcomes:
        return {}
    is_good, words = asking.outcomes[process]
    if not is_good:
        return {**result, "trouble": words}
    return result or {"ended": process.description}


def _is_still_found(process: FoundProcess, search: SearchResult) -> bool:
    """Return True if the new ``search`` still finds the process, or was incomplete, so that it may have missed it."""
    return bool(search.warnings) or any(
        each.run == process.run and each.identity == process.identity for each in search.processes
    )


def _run_key(link: RunConnection) -> object:
    """Return a key that identifies a run: its process number, name and start, from its first message."""
    return link.process, *(link.run_info.get(each) for each in ("pid", "run", "began"))


def _state_of(link: RunConnection) -> str:
    """Return the state of a run for people. Raises OSError if it does not reply."""
    state = link.scene_state()
    return str(state["stopped"]) or ("paused" if state["paused"] else "running")


def _description_of(link: RunConnection) -> str:
    """Return the description of a run from its first message."""
    run_info = link.run_info
    mission, robot, simulated = (str(run_info.get(name, "")) for name in ("mission", "robot", "simulated"))
    process = link.process or run_info.get("pid", 0)  # the kernel reports no number for a process in another container
    return RobotHolder(process, mission, robot, simulated, run=str(run_info.get("run", ""))).description
