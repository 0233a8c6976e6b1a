"""What speaking costs a mission: ``python -m tests.benchmarks.saying`` (about a minute) prints it as a table.

espeak-ng speaks and miniaudio's null backend plays, in real time. A tree of one leaf is ticked at 20 Hz, first with
a recorder in the place of the voice, then aloud: a new text every quarter of a second, for which the one before is
halted. How late ticks come and how long they take is compared. Then words are halted, until their player says that
they have ended; and halted with the player stopped (SIGSTOP), until it has been killed.
"""

import os
import signal
import statistics
import threading
import time
from collections.abc import Callable, Sequence

from behaviours.robot import Robot
from behaviours.voice import Say
from drivers.api import SpeechStyle
from drivers.clock import SystemClock
from drivers.sound.engines import EspeakEngine
from drivers.sound.player import SoundPlayer, SoundState
from drivers.voice.speech import SpeechVoice
from missions.plugins.testing.recorders import LeafTestBench
from tests.waiting import wait_until

PERIOD = 0.05
TEXTS = 60
HALTS = 20
LONG = "this is a sentence that takes its time and is broken off before it has come to its end"


def row(name: str, seconds: Sequence[float]) -> str:
    """Return the quantiles of some times, in milliseconds."""
    ordered = sorted(seconds)
    found = (statistics.median(ordered), ordered[int(0.99 * (len(ordered) - 1))], ordered[-1])
    return f"| {name} | " + " | ".join(f"{1000 * each:.2f}" for each in found) + f" | {len(ordered)} |"


class Trial:
    """A voice, and the clock on which it is watched."""

    def __init__(self) -> None:
        self.clock = SystemClock()
        self.player = SoundPlayer(self.clock, backend="null")
        self.voice = SpeechVoice(self.clock, EspeakEngine(self.clock, default_manner=SpeechStyle()), self.player, print)

    def timed(self, work: Callable[[], object]) -> float:
        """Return how long something takes."""
        begin = self.clock.now()
        work()
        return self.clock.now() - begin

    def ticks(self, texts: int, *, aloud: bool) -> tuple[list[float], list[float]]:
        """Say a new text every quarter of a second, ``aloud`` or to a recorder; return how late ticks are, and take."""
        bench = LeafTestBench()
        if aloud:
            bench.robot = Robot(voice_part=self.voice)
        late, took, quarter = list[float](), list[float](), round(0.25 / PERIOD)
        begin = self.clock.now()
        leaf = bench.put(Say("say"), text="")
        for number in range(texts * quarter):
            due = begin + (number + 1) * PERIOD
            threading.Event().wait(max(0.0, due - self.clock.now()))
            late.append(self.clock.now() - due)
            before = time.thread_time()
            self.tick(bench, leaf, f"{LONG} {number}", new=number % quarter == 0)
            took.append(time.thread_time() - before)
        self.voice.rest()
        return late, took

    @staticmethod
    def tick(bench: LeafTestBench, leaf: Say, text: str, *, new: bool) -> None:
        """Tick once; with a new text, halt the old one first."""
        if new:
            bench.halt(leaf)
            leaf.text = text
        bench.tick(leaf)

    def begin(self) -> None:
        """Say something, and wait until it is heard."""
        words = self.voice.say(LONG)
        wait_until(lambda: words.started is not None)

    def halted(self) -> float:
        """Return how long it takes from a halt to the word of the player that all is silent."""
        self.begin()

        def halt() -> None:
            self.voice.rest()
            with self.player._condition:
                self.player._condition.wait_for(lambda: self.player._sound_state is SoundState.ENDED, 1.0)

        return self.timed(halt)

    def killed(self) -> float:
        """Return how long it takes from a halt to the end of a player that does not listen."""
        wait_until(lambda: self.player._is_ready)  # again
        self.begin()
        process = self.player._worker._process
        if process is None:
            raise RuntimeError("there is no player")
        os.killpg(process.pid, signal.SIGSTOP)

        def halt() -> None:
            self.voice.rest()
            process.wait()

        return self.timed(halt)


def main() -> None:
    """Print the table."""
    trial = Trial()
    trial.voice.open()
    trial.begin()
    trial.voice.rest()
    print("| ms | median | 99 % | most | times |\n|---|---|---|---|---|")
    for name, aloud in (("silent", False), ("speaking", True)):
        late, took = trial.ticks(TEXTS, aloud=aloud)
        print(row(f"a tick comes late, {name}", late), row(f"a tick takes of the processor, {name}", took), sep="\n")
    print(row("`say` returns", [trial.timed(lambda: trial.voice.say(LONG)) for _ in range(200)]))
    print(row("`cancel` of 200 returns", [trial.timed(trial.voice.rest)]))
    print(row("from a halt to silence", [trial.halted() for _ in range(HALTS)]))
    print(row("the same, of a player that hangs", [trial.killed() for _ in range(3)]))
    trial.voice.close()


if __name__ == "__main__":
    main()
