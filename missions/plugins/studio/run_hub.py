"""Connections of the studio to all runs of this user on this computer, to watch and stop them.

The runs are found by their control sockets.
"""

import asyncio
from collections.abc import Awaitable, Callable, Container, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from itertools import chain, count
from math import inf
from typing import Any, Self

from config.file_io import parse_object
from drivers.clock import Clock, SystemClock
from missions.control.command_broadcast import GONE_ERRORS, stop_one
from missions.control.commands import BadMessage
from missions.control.notes import stamp_stop
from missions.control.run_search import FoundProcess, SearchResult, may_be_alive, search_runs
from missions.plugins.studio.connections import SpareDescriptors
from missions.plugins.studio.run_feed import AsyncRunLink, OnLine, RunFeed

SEARCH_INTERVAL = 0.25
"""Seconds between two searches for new runs on this computer."""

COMMAND_END_TIMEOUT = 0.7
"""Seconds for which a stop waits until commands such as teleop have ended, before it is answered.

These commands have no control socket, so they cannot confirm the stop.
"""

MAX_STOP_THREADS = 32
"""Maximum number of threads that stop runs and commands to which the studio has no connection."""

RETRY_INTERVAL = 2.0
"""Seconds before a run that could not be reached is tried again."""

UNKNOWN_RUN = "unknown"
"""Name of an entry in the list of runs if a search has failed, so that there may be a run that was not found."""

MAX_PENDING_PRESSES = 3
"""Maximum number of STOP presses for one run that wait to be sent one by one.

All further presses that arrive meanwhile are combined into one stop.
"""


class RunHub:
    """Connections to all runs of this user on this computer, kept open so that a stop need not connect first.

    Use it as a context manager. ``on_change`` is called when a run has come, gone, been stopped or been released; it
    must return at once.
    """

    def __init__(self, on_change: Callable[[], None], *, clock: Clock | None = None) -> None:
        self._on_change, self._clock = on_change, clock or SystemClock()
        self._links: dict[str, AsyncRunLink] = {}
        self._feeds: dict[str, RunFeed] = {}
        # By key, since two containers may have runs of one name: run, error, time of the last attempt.
        self._unreached: dict[object, tuple[str, str, float]] = {}
        self._doubts: list[str] = []
        self._tasks: set[asyncio.Task[None]] = set()
        self._search_lock = asyncio.Lock()
        self._next_refresh: asyncio.Task[None] | None = None
        self._next_search: asyncio.Task[SearchResult] | None = None
        self._next_stamp: asyncio.Future[str] | None = None
        self._next_stops: dict[AsyncRunLink, tuple[asyncio.Task[Mapping[str, object]], list[str]]] = {}
        self._stopping: dict[object, asyncio.Future[Mapping[str, object]]] = {}
        self._spare = SpareDescriptors(0)
        self._pool = ThreadPoolExecutor(
            MAX_STOP_THREADS, "stop"
        )  # of its own, so that hanging runs block no other work

    async def __aenter__(self) -> Self:
        self._spare = SpareDescriptors()
        self._start_task(self._search_repeatedly())
        return self

    async def __aexit__(self, *_: object) -> None:
        for task in list(self._tasks):
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        await asyncio.gather(*(each.close() for each in self._links.values()))
        await asyncio.gather(*(each.close() for each in self._feeds.values()))
        self._spare.close()
        self._pool.shutdown(wait=False)

    def runs(self) -> list[Mapping[str, object]]:
        """Return an entry for each run, the newest first, as in the message `runs`.

        The entry of an unreachable run has a text `trouble`.
        """
        found = [{**link.about, "run": run} for run, link in self._links.items()]
        found.sort(key=lambda about: float(about.get("began", 0.0)), reverse=True)
        runs: dict[str, Mapping[str, object]] = {
            str(each["run"]): {name: value for name, value in each.items() if name != "say"} for each in found
        }
        for run, error, _ in self._unreached.values():
            name = unique_name(run, runs)
            runs[name] = {"run": name, "trouble": error}
        return [*runs.values(), *({"run": UNKNOWN_RUN, "trouble": error} for error in self._doubts)]

    async def search(self) -> None:
        """Search for new runs. All calls that arrive during a search wait for one further search."""
        if self._next_refresh is None:
            self._next_refresh = asyncio.ensure_future(self._run_search())
        await asyncio.shield(self._next_refresh)

    async def _run_search(self) -> None:
        async with self._search_lock:
            self._next_refresh = None
            found = await asyncio.to_thread(partial(search_runs, thorough=False))
            before = self._unreached, self._doubts, [*self._links]
            new = [each for each in found.processes if not each.is_command and not _is_linked(each, self._links)]
            why = await asyncio.gather(*(self._open(each) for each in new))
            troubles = zip(new, why, strict=True)
            self._unreached = {each.key: (each.run, *trouble) for each, trouble in troubles if trouble[0]}
            self._doubts = [each.message for each in found.warnings]
            if before != (self._unreached, self._doubts, [*self._links]):
                self._on_change()

    async def _open(self, found: FoundProcess) -> tuple[str, float]:
        """Connect to a run; return the error text, empty on success, and the time of the attempt."""
        _, why, tried = self._unreached.get(found.key, ("", "", -inf))
        if self._clock.now() - tried < RETRY_INTERVAL:
            return why, tried
        why, is_gone, now = "no control socket", True, self._clock.now()
        for where in found.addresses:
            try:
                link = await AsyncRunLink.open(where)
            except (OSError, ValueError) as error:
                why = "it does not answer" if isinstance(error, TimeoutError) else str(error)
                is_gone = is_gone and isinstance(error, GONE_ERRORS)
            else:
                if any(link.run_identity == each.run_identity for each in self._links.values()):
                    await link.close()  # while its note is not written, a search finds a run by each of its sockets
                    return "", now
                link.on_line = partial(self._on_line, link)
                run = unique_name(found.run, self._links)
                self._links[run] = link
                self._start_task(self._wait_closed(run, link))
                return "", now
        if is_gone and not await asyncio.to_thread(may_be_alive, found):
            return "", now  # the run was killed or has ended
        return why, now

    async def stop(self, run: str, by: str, press: str = "") -> Mapping[str, object]:
        """Stop a run, or all for an empty name; return the results by run. Raises BadMessage for an unknown run.

        ``by`` names the person who stops; ``press`` identifies the press of STOP, so that it counts once if it arrives
        twice. A result has a text `trouble` if the run may not have stopped. Stopping all also ends the commands that
        hold a robot and have no control socket, such as teleop. An unreachable run gets SIGTERM. If a search failed,
        the result of ``UNKNOWN_RUN`` has the reason.
        """
        if run in self._links:
            return await self._stop_connected({run: self._links[run]}, by, press)
        with self._spare.lend():
            links = dict(self._links)
            stopping = asyncio.ensure_future(self._stop_connected({} if run else links, by, press))
            unstamped = "" if run else await self._stamp_shared()
            found = await self._search_shared()
            # Connections opened since then are not included.
            others = [each for each in found.processes if not _is_linked(each, links)]
            others = [each for each in others if not run or _has_name(each, run)]
            if run and not others:
                await self.search()
                self.about_run(run)
            unconnected = await self._stop_unconnected(others, by)
            results = await stopping
            if lost := {
                name: links[name] for name in results if "trouble" in results[name] and links[name].closed.is_set()
            }:
                results |= await self._stop_disconnected(lost, by)
            for each, result in unconnected:
                results[unique_name(run or each.run, results)] = result
        if found.warnings and not run:
            results[UNKNOWN_RUN] = {"trouble": "\n".join(each.message for each in found.warnings)}
        elif unstamped and not results:
            results[UNKNOWN_RUN] = {"trouble": unstamped}
        return results

    async def _stamp_shared(self) -> str:
        """Store the time of a stop, so that runs that are just starting stop too; return a warning, empty on success.

        Concurrent calls share one time stamp.
        """
        if self._next_stamp is None:
            self._next_stamp = asyncio.ensure_future(self._stamp_next())
        return await asyncio.shield(self._next_stamp)

    async def _stamp_next(self) -> str:
        self._next_stamp = None
        return await asyncio.to_thread(stamp_stop)

    async def _search_shared(self) -> SearchResult:
        """Return the runs found now. Calls that arrive during a search wait for one further search."""
        if self._next_search is None:
            self._next_search = asyncio.ensure_future(self._search_next())
        return await asyncio.shield(self._next_search)

    async def _search_next(self) -> SearchResult:
        self._next_search = None
        return await asyncio.to_thread(search_runs)

    async def _stop_disconnected(self, lost: Mapping[str, AsyncRunLink], by: str) -> dict[str, Mapping[str, object]]:
        """Stop again the runs in ``lost``, whose connection broke during their stop; return the results by run.

        ``by`` names the person who stops. A run that has ended counts as stopped.
        """
        found = await self._search_shared()
        retried = await self._stop_unconnected([each for each in found.processes if _is_linked(each, lost)], by)
        merged = dict[str, Mapping[str, object]]()
        for run, link in lost.items():
            results = [result for each, result in retried if _is_linked(each, {run: link})]
            if results:
                merged[run] = next((each for each in results if "trouble" in each), results[0])
            elif not found.warnings and link.has_ended():
                merged[run] = {"ended": f"{run}: has ended"}
        return merged

    async def _stop_connected(
        self, links: Mapping[str, AsyncRunLink], by: str, press: str
    ) -> dict[str, Mapping[str, object]]:
        results = await asyncio.gather(*(self._stop(link, by, press) for link in links.values()))
        return dict(zip(links, results, strict=True))

    async def _stop(self, link: AsyncRunLink, by: str, press: str) -> Mapping[str, object]:
        """Stop one run; return its answer. All calls that arrive during a stop wait for one further stop.

        So many calls cannot fill the connection. But each press of STOP (``press``) is sent by itself: otherwise the
        release of one press could also release a later press.
        """
        if link not in self._next_stops:
            presses = [press]
            self._next_stops[link] = asyncio.ensure_future(self._stop_next(link, by, presses)), presses
        following, presses = self._next_stops[link]
        if press not in presses:
            presses.append(press if len(presses) < MAX_PENDING_PRESSES else "")
        return await asyncio.shield(following)

    async def _stop_next(self, link: AsyncRunLink, by: str, presses: list[str]) -> Mapping[str, object]:
        async with link.stopping:
            del self._next_stops[link]
            result: Mapping[str, object] = {}
            for press in dict.fromkeys(presses):
                result = await link.stop(by, press)
                if "trouble" in result:
                    break
            return result

    async def _stop_unconnected(
        self, others: Sequence[FoundProcess], by: str
    ) -> list[tuple[FoundProcess, Mapping[str, object]]]:
        """Stop the runs and commands to which the studio has no connection; return each with its result.

        If a process is already being stopped, the call waits for the result of that stop.
        """
        asking = {}
        for each in others:
            if (key := each.key) not in self._stopping:
                asking_one = asyncio.get_running_loop().run_in_executor(self._pool, stop_one, each, by)
                self._stopping[key] = task = asyncio.ensure_future(asking_one)
                task.add_done_callback(partial(self._forget_stop, key))
            asking[each] = self._stopping[key]
        if asking:
            await asyncio.wait(asking.values(), timeout=COMMAND_END_TIMEOUT)
        return [(each, result) for each, task in asking.items() if (result := _stop_result(each, task))]

    def _forget_stop(self, key: object, _: asyncio.Future[Mapping[str, object]]) -> None:
        del self._stopping[key]

    def about_run(self, run: str) -> Mapping[str, object]:
        """Return the status of a run, as in its first message. Raises BadMessage if there is no such run."""
        if run not in self._links:
            known = ", ".join(self._links) or "none"
            raise BadMessage("no_such_run", f"there is no run '{run}' (there is: {known})")
        return self._links[run].about

    async def ask(self, run: str, command: Mapping[str, object]) -> Mapping[str, Any]:
        """Send a command to a run, and return the run's answer.

        Raises BadMessage if the run does not exist or does not answer.
        """
        self.about_run(run)
        try:
            answer = await self._links[run].request(command)
        except OSError as error:  # a TimeoutError is one
            raise BadMessage("no_answer", f"run {run} does not answer: {error}") from error
        return answer.get("result") or {}

    def feed_of(self, run: str) -> RunFeed:
        """Return the feed of a run. Raises BadMessage if there is no such run."""
        self.about_run(run)
        return self._feeds.setdefault(run, RunFeed(run, self._links[run].open_another))

    async def connect(self, run: str, on_line: OnLine) -> AsyncRunLink:
        """Return a new connection to a run. Raises OSError, ValueError; BadMessage if there is no such run."""
        self.about_run(run)
        return await self._links[run].open_another(on_line)

    async def _search_repeatedly(self) -> None:
        while True:
            try:
                await self.search()
            except Exception as error:  # report any error; the next search may succeed
                self._doubts = [f"the studio cannot search for runs: {type(error).__name__}: {error}"]
                self._on_change()
            await asyncio.sleep(SEARCH_INTERVAL)

    async def _on_line(self, link: AsyncRunLink, line: bytes) -> None:
        """Handle a message from a run that it was stopped or released."""
        if line.startswith(b'{"say":"run"'):
            link.about = parse_object(line)
            self._on_change()

    async def _wait_closed(self, run: str, link: AsyncRunLink) -> None:
        await link.closed.wait()
        if self._links.get(run) is link:
            del self._links[run]
            self._feeds.pop(run, None)
        self._on_change()

    def _start_task(self, work: Awaitable[None]) -> None:
        task = asyncio.ensure_future(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)


def unique_name(run: str, taken: Container[str]) -> str:
    """Return a unique name of a run: with "@" and a number if it is taken, for example by another container."""
    names = (f"{run}{more}" for more in chain([""], (f"@{number}" for number in count(2))))
    return next(name for name in names if name not in taken)


def _has_name(found: FoundProcess, run: str) -> bool:
    """Return whether a run has this name, ignoring the number added by ``unique_name``."""
    return found.run == run.partition("@")[0]


def _is_linked(found: FoundProcess, links: Mapping[str, AsyncRunLink]) -> bool:
    """Return whether one of the connections ``links`` leads to the run ``found``."""
    return any(_has_name(found, run) and link.is_connected_to(found) for run, link in links.items())


def _stop_result(found: FoundProcess, task: asyncio.Future[Mapping[str, object]]) -> Mapping[str, object]:
    """Return the result of ``task``, which stops a process without a connection.

    The result has a text `trouble` if the task is not done or has failed; it is empty if the process had already ended.
    """
    if not task.done():
        why = f"it has not {'ended' if found.is_command else 'answered'} yet"
        return {"trouble": f"{found.description}: {why}\n  try: {found.end_hint()}"}
    error = task.exception()
    return task.result() if error is None else {"trouble": f"{found.description}: {type(error).__name__}: {error}"}
