"""The runs of this machine, as the studio knows them: found by their control sockets, and stopped through them."""

import asyncio
import json
from collections.abc import Awaitable, Callable, Mapping
from contextlib import suppress
from functools import partial
from typing import Any, Self

from missions.studio import sockets
from missions.studio.form import BadMessage
from missions.studio.holders import Holder, commands
from missions.studio.link import Link
from missions.studio.watching import Watching

PERIOD = 0.25
"""Seconds from one look for new runs to the next."""

ENDING = 0.7
"""Seconds for which the answer to a stop waits for commands to end, which a page waits for a second for."""


PRESSES = 3
"""Presses that wait for one run, and are told it each by itself; all further ones are one more stop."""


class Hub:
    """Keeps a connection to each run while it is entered, so that a stop has nothing to wait for.

    ``changed`` is called whenever a run has come, has gone, is stopped or released; it must return at once.
    """

    def __init__(self, changed: Callable[[], None]) -> None:
        self._changed = changed
        self._links: dict[str, Link] = {}
        self._watched: dict[str, Watching] = {}
        self._troubles: dict[str, str] = {}
        self._tasks: set[asyncio.Task[None]] = set()
        self._looking = asyncio.Lock()
        self._following: dict[Link, tuple[asyncio.Task[Mapping[str, object]], list[str]]] = {}
        self._ending: dict[Holder, asyncio.Task[bool]] = {}

    async def __aenter__(self) -> Self:
        self._begin(self._look_on())
        return self

    async def __aexit__(self, *_: object) -> None:
        for task in list(self._tasks):
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        await asyncio.gather(*(each.close() for each in self._links.values()))
        await asyncio.gather(*(each.close() for each in self._watched.values()))

    def runs(self) -> list[Mapping[str, object]]:
        """Return what there is, as `runs` tells it: the newest first."""
        found = [{name: value for name, value in link.about.items() if name != "say"} for link in self._links.values()]
        found.sort(key=lambda about: float(about.get("began", 0.0)), reverse=True)
        return [*found, *({"run": run, "trouble": why} for run, why in self._troubles.items())]

    async def look(self) -> None:
        """Look for runs that have come."""
        async with self._looking:
            paths = {sockets.run_of(path): path for path in sockets.sockets()}
            new = [run for run in paths if run not in self._links and run not in self._troubles]
            self._troubles = {run: why for run, why in self._troubles.items() if run in paths}
            for run in new:
                try:
                    self._links[run] = link = await Link.open(paths[run], self._heard)
                except TimeoutError:
                    self._troubles[run] = "it does not answer"
                except (OSError, ValueError):
                    continue
                else:
                    self._begin(self._attend(run, link))
            if new:
                self._changed()

    async def stop(self, run: str, by: str, press: str = "") -> Mapping[str, object]:
        """Stop a run, or all for no name; return what was latched, by run. Raises BadMessage for one not there.

        Who stops all ends the commands that hold a robot and have no control socket, too: teleop, and those of heads.
        """
        if run and run not in self._links:
            await self.look()
            self.known(run)
        if run:
            return await self._stop_these({run: self._links[run]}, by, press)
        links = dict(self._links)
        ended = asyncio.ensure_future(self._end_commands(by))
        told = await self._stop_these(links, by, press)
        await self.look()  # one that has come meanwhile, too
        new = {run: link for run, link in self._links.items() if links.get(run) is not link}
        return {**told, **await self._stop_these(new, by, press), **await ended}

    async def _stop_these(self, links: Mapping[str, Link], by: str, press: str) -> dict[str, Mapping[str, object]]:
        told = await asyncio.gather(*(self._stop(link, by, press) for link in links.values()))
        return dict(zip(links, told, strict=True))

    async def _stop(self, link: Link, by: str, press: str) -> Mapping[str, object]:
        """Stop one run. Who asks while a stop is on its way shares the next one: so that many do not clog the link.

        Another press is another stop all the same: else it would go with the release of the one that it shares.
        """
        if link not in self._following:
            presses = [press]
            self._following[link] = asyncio.ensure_future(self._stop_next(link, by, presses)), presses
        following, presses = self._following[link]
        if press not in presses:
            presses.append(press if len(presses) < PRESSES else "")
        return await asyncio.shield(following)

    async def _stop_next(self, link: Link, by: str, presses: list[str]) -> Mapping[str, object]:
        async with link.stopping:
            del self._following[link]
            told: Mapping[str, object] = {}
            for press in dict.fromkeys(presses):
                told = await _stop(link, by, press)
                if "trouble" in told:
                    break
            return told

    async def _end_commands(self, by: str) -> dict[str, Mapping[str, object]]:
        """End them, each once, however many ask for it; return what became of each, by its process."""
        held = commands()
        for each in held:
            if each not in self._ending:
                self._ending[each] = task = asyncio.ensure_future(asyncio.to_thread(each.end, by))
                task.add_done_callback(partial(self._ended, each))
        ending = {each: self._ending[each] for each in held}
        if ending:
            await asyncio.wait(ending.values(), timeout=ENDING)
        return {str(each.process): _end_of(each, task) for each, task in ending.items()}

    def _ended(self, holder: Holder, _: asyncio.Task[bool]) -> None:
        del self._ending[holder]

    def known(self, run: str) -> Mapping[str, object]:
        """Return what is known of a run. Raises BadMessage for one that is not there."""
        if run not in self._links:
            known = ", ".join(self._links) or "none"
            raise BadMessage("no_such_run", f"there is no run '{run}' (there is: {known})")
        return self._links[run].about

    async def ask(self, run: str, command: Mapping[str, object]) -> Mapping[str, Any]:
        """Return the result of a command that a run answers. Raises BadMessage for one not there, or silent."""
        self.known(run)
        try:
            answer = await self._links[run].ask(command)
        except OSError as error:  # a TimeoutError is one
            raise BadMessage("no_answer", f"run {run} does not answer: {error}") from error
        return answer.get("result") or {}

    def watching(self, run: str) -> Watching:
        """Return what is watched of a run. Raises BadMessage for one that is not there."""
        self.known(run)
        return self._watched.setdefault(run, Watching(run))

    async def _look_on(self) -> None:
        while True:
            with suppress(OSError):
                await self.look()
            await asyncio.sleep(PERIOD)

    async def _heard(self, line: bytes) -> None:
        """A run tells of itself: it was stopped, or released."""
        if line.startswith(b'{"say":"run"'):
            about = json.loads(line)
            if about["run"] in self._links:
                self._links[about["run"]].about = about
                self._changed()

    async def _attend(self, run: str, link: Link) -> None:
        await link.closed.wait()
        if self._links.get(run) is link:
            del self._links[run]
            self._watched.pop(run, None)
        self._changed()

    def _begin(self, work: Awaitable[None]) -> None:
        task = asyncio.ensure_future(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)


def _end_of(holder: Holder, task: asyncio.Task[bool]) -> Mapping[str, object]:
    """Return what is told of a command that was to end."""
    if task.done() and not task.exception() and task.result():
        return {"ended": holder.words}
    return {
        "trouble": f"{holder.words}: SIGTERM was sent, and it has not ended yet; `kill -9 {holder.process}` ends it"
    }


async def _stop(link: Link, by: str, press: str) -> Mapping[str, object]:
    """Stop one run; where it does not answer, end it by a signal."""
    try:
        answer = await link.ask({"do": "stop", "by": by, "press": press})
    except TimeoutError:
        link.terminate()
        return {"trouble": "it does not answer: SIGTERM was sent, which ends it"}
    except ConnectionError as error:
        return {"trouble": str(error)}
    result: Mapping[str, object] = answer.get("result") or {"trouble": str(answer.get("message", ""))}
    return result
