"""Several clients of the studio watch one run: it tells each thing once, and each client hears it at its own pace."""

import asyncio
import json
import os
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from functools import partial
from typing import Any

from drivers.clock import ManualClock
from missions.control import sockets
from missions.control.commands import WatchCommand
from missions.plugins.studio.run_feed import AsyncRunLink, FeedClient, RunFeed

PATIENCE = 60.0
RUN = str(os.getpid())


class ToldRun:
    """A control socket that answers `watch` with a scene, and tells what the test has it tell."""

    def __init__(self) -> None:
        self.asked: list[dict[str, Any]] = []
        self.watchers: list[asyncio.StreamWriter] = []
        self.gone = 0

    @asynccontextmanager
    async def served(self) -> AsyncIterator[None]:
        server = await asyncio.start_unix_server(self._serve, sock=sockets.listen(sockets.socket_path(RUN)))
        async with server:
            yield
            server.close()
        sockets.socket_path(RUN).unlink()

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self.watchers.append(writer)
        self.tell(say="run", run=RUN)
        while line := await reader.readline():
            self.asked.append(json.loads(line))
            if self.asked[-1]["do"] == "watch":
                self.tell(say="scene", run=RUN, number=len(self.asked))
                self.tell(say="answer", id=self.asked[-1]["id"], ok=True)
        self.gone += 1
        writer.close()

    def tell(self, **message: object) -> None:
        for each in self.watchers:
            each.write(json.dumps(message, separators=(",", ":")).encode() + b"\n")

    def of(self, word: str) -> list[dict[str, Any]]:
        """Return the commands of a word that it was asked, in order."""
        return [each for each in self.asked if each["do"] == word]

    def was_asked(self, word: str, number: int) -> bool:
        return len(self.of(word)) == number


class Looking:
    """A client that takes what comes."""

    def __init__(self, watching: RunFeed) -> None:
        self.hearer = FeedClient(watching)
        self.heard: list[dict[str, Any]] = []
        self.task = asyncio.create_task(self._take())

    async def _take(self) -> None:
        async for line in self.hearer.lines():
            self.heard.append(json.loads(line))

    def said(self, word: str) -> list[dict[str, Any]]:
        return [each for each in self.heard if each["say"] == word]

    def has(self, word: str, number: int) -> bool:
        return len(self.said(word)) == number


async def until(condition: Callable[[], object]) -> None:
    while not condition():
        await asyncio.sleep(0)


def watched(work: Callable[[ToldRun, RunFeed, ManualClock], Awaitable[None]]) -> Callable[[], None]:
    """Make a test of what is done with a run that is watched."""

    def tested() -> None:
        async def whole() -> None:
            run, clock = ToldRun(), ManualClock()
            async with run.served():
                watching = RunFeed(RUN, partial(AsyncRunLink.open, sockets.socket_path(RUN)), clock)
                await work(run, watching, clock)
                await watching.close()
                await until(lambda: run.gone == len(run.watchers))

        asyncio.run(asyncio.wait_for(whole(), PATIENCE))

    return tested


@watched
async def test_all_watchers_of_a_run_share_one_connection(run: ToldRun, watching: RunFeed, clock: ManualClock) -> None:
    del clock
    lookers = [Looking(watching) for _ in range(3)]
    for each in lookers:
        await watching.watch(each.hearer, WatchCommand(run=RUN))
    assert len(run.watchers) == 1
    run.tell(say="state", run=RUN, t=1.0)
    await until(lambda: all(each.said("state") for each in lookers))
    # Each began with a scene of its own, and nobody heard that of another.
    assert [[told["number"] for told in each.said("scene")] for each in lookers] == [[1], [2], [3]]
    assert [each.heard[0]["say"] for each in lookers] == ["scene"] * 3


@watched
async def test_slow_watcher_does_not_delay_others_and_gets_merged_states(
    run: ToldRun, watching: RunFeed, clock: ManualClock
) -> None:
    del clock
    quick, slow = Looking(watching), FeedClient(watching)
    await watching.watch(slow, WatchCommand(run=RUN))
    await watching.watch(quick.hearer, WatchCommand(run=RUN))
    for tick in range(100):
        run.tell(say="state", run=RUN, t=tick, changed={str(tick % 7): ["running", "", tick]})
        await until(partial(quick.has, "state", tick + 1))
    lines = [json.loads(line) for line in iter(slow.next_line, None)]
    assert [told["say"] for told in lines] == ["scene", "state"]
    assert (lines[1]["t"], len(lines[1]["changed"])) == (99, 7)


@watched
async def test_run_is_sent_the_combined_wishes_of_all_watchers(
    run: ToldRun, watching: RunFeed, clock: ManualClock
) -> None:
    del clock
    one, other = Looking(watching), Looking(watching)
    await watching.watch(one.hearer, WatchCommand(run=RUN))
    await watching.watch(other.hearer, WatchCommand(run=RUN, state=False, events=True, pictures=10.0))
    told = run.of("watch")[-1]
    assert (told["state"], told["events"], told["pictures"]) == (True, True, 10.0)
    watching.leave(other.hearer)
    await until(lambda: run.of("watch")[-1]["pictures"] == 0)
    run.tell(say="state", run=RUN, t=1.0)
    await until(lambda: one.said("state"))
    assert other.said("state") == []
    assert len(one.said("scene")) == 1  # that of the last question was for nobody
    watching.leave(one.hearer)
    await until(lambda: run.gone == 1)  # nobody watches: it is hung up


@watched
async def test_picture_counts_as_seen_by_the_first_watcher(run: ToldRun, watching: RunFeed, clock: ManualClock) -> None:
    quick, slow = Looking(watching), FeedClient(watching)
    await watching.watch(slow, WatchCommand(run=RUN, pictures=10.0))
    run.tell(say="picture", run=RUN, t=0.5, jpeg="")
    await until(lambda: run.of("watch") and slow._unseen_pictures)
    assert run.of("seen") == []  # one that is on its way is waited for
    await watching.watch(quick.hearer, WatchCommand(run=RUN, pictures=10.0))
    for number in range(1, 6):
        clock.advance(1.0)
        run.tell(say="picture", run=RUN, t=number, jpeg="")
        await until(partial(quick.has, "picture", number))
        watching.on_seen(quick.hearer, float(number))
        await until(partial(run.was_asked, "seen", number))
    watching.leave(quick.hearer)
    asked = len(run.of("seen"))
    clock.advance(1.0)
    run.tell(say="picture", run=RUN, t=6.0, jpeg="")
    await until(lambda: len(run.of("seen")) > asked)


@watched
async def test_watcher_of_a_dying_run_is_sent_that_the_run_is_over(
    run: ToldRun, watching: RunFeed, clock: ManualClock
) -> None:
    del clock
    looker = Looking(watching)
    await watching.watch(looker.hearer, WatchCommand(run=RUN))
    run.watchers[0].close()
    await looker.task
    assert looker.heard[-1]["say"] == "over"
    assert looker.heard[-1]["reason"] == "the run ended without a message"
