"""What a part costs behind its proxy: each member, asked or commanded by a leaf, against the bare device.

``python -m tests.benchmarks.proxies FOLDER`` measures against another version instead: the one in ``FOLDER``, a working
tree of this repository. A process of each version takes its turn, round after round.
"""

import json
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from importlib import import_module
from operator import attrgetter
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from behaviours.basics import Succeed
from behaviours.robot import Robot
from behaviours.run import RunState
from drivers.api import ZERO_VELOCITY, BaseLimits, Coupling, HeadPose, Mood, Velocity
from drivers.clock import ManualClock
from missions.executive.proxied_robot import with_proxies
from missions.executive.tick_cache import TickCache
from tests.benchmarks.table import Row, compare

CALLS_TIMED = 500
"""Calls of a member in a round."""

ROUNDS = 21
"""Rounds in which two versions take turns."""

CALLS: Mapping[str, Mapping[str, tuple[Any, ...] | None]] = {
    "base": {
        "drive": (Velocity(0.2, 0.1),),
        "stop": (),
        "latch": ("enough",),
        "enable": (),
        "rest": (),
        "state": (),
        "steering": (),
        "health": (),
        "heading_at": (1.5,),
        "limits": None,
        "latched": None,
    },
    "head": {"look": (HeadPose(0.1, 0.2),), "stop": (), "pose": (), "pose_at": (1.5,), "limits": None},
    "arm": {
        "move": ({"elbow": 0.5},),
        "hold": (),
        "relax": (("elbow",),),
        "follow": ((Coupling("elbow", "wrist"),),),
        "recover": (),
        "states": (),
        "limits": None,
    },
    "ranger": {"scan": (), "place": None},
    "voice": {"say": ("Hello!",), "play": (Path("bell.wav"),), "speaking": ()},
    "sight": {"looked": (), "faces": (), "things": (), "markers": (), "scene": ()},
    "hearing": {"listened": (), "words": (), "refused": (), "level": ()},
    "screen": {"mood": (Mood.HAPPY,), "show": ("Hello",), "mouth": (0.5,), "content": ()},
}
"""The members of each part with the arguments that they are called with; None for a property."""

ANSWERS: Mapping[str, object] = {
    "drive": ZERO_VELOCITY,
    "look": HeadPose(0.1, 0.2),
    "move": {"elbow": 0.5},
    "recover": (),
    "limits": BaseLimits(1.0, 1.0, 1.0, 1.0),
    "say": SimpleNamespace(done=lambda: True),
    "play": SimpleNamespace(done=lambda: True),
}
"""What the device answers; the rest is None."""


class Still:
    """A device that does nothing and answers at once."""

    def __init__(self, part: str) -> None:
        self.name = part
        for member, arguments in CALLS[part].items():
            answer = ANSWERS.get(member)
            setattr(self, member, answer if arguments is None else self._answering(answer))
        self.sounds = self.lights = self.legs = None
        for member in ("open", "close", "rest", "health"):
            if not hasattr(self, member):
                setattr(self, member, self._answering(None))

    def _answering(self, answer: object) -> Callable[..., object]:
        return lambda *_, **__: answer


class Asker:
    """A leaf's robot, and the ``devices`` behind its parts."""

    def __init__(self) -> None:
        self.devices: dict[str, Any] = {part: Still(part) for part in CALLS}
        self._answers = TickCache()
        parts: Any = {f"{part}_part": device for part, device in self.devices.items()}
        leaf = Succeed("succeed")
        leaf.kind = leaf.key = "succeed"
        leaf.run = RunState(ManualClock())
        leaf.run.active_leaf = leaf
        self.robot = robot_for()(leaf, with_proxies(Robot(**parts), self._answers, lambda *_: None), lambda *_: None)

    def calls(self) -> Iterator[tuple[str, Callable[[], object], Callable[[], object]]]:
        """Yield each member with what calls it on the part, and on the bare device."""
        for part, members in CALLS.items():
            proxy = getattr(self.robot, f"{part}_part")
            for member, arguments in members.items():
                bare = called(self.devices[part], member, arguments)
                yield f"{part}.{member}", called(proxy, member, arguments), bare

    def seconds(self, call: Callable[[], object], *, recorded: bool) -> float:
        """Return what a call takes: each in a recorded moment of its own, or all in one moment without a record."""
        answers, times = self._answers, range(CALLS_TIMED)
        answers.is_recording = answers.is_open = recorded
        start = time.process_time()
        if recorded:
            for _ in times:
                answers.is_open = True
                call()
                answers.take_answers()
        else:
            answers.is_open = True
            for _ in times:
                call()
        seconds = time.process_time() - start
        answers.take_answers()
        return seconds / CALLS_TIMED


def robot_for() -> Any:
    """Return what makes a leaf's robot, in this version or in one of before."""
    try:
        return import_module("missions.executive.proxied_robot").robot_for
    except AttributeError:
        return import_module("missions.executive.commands").robot_for


def called(part: Any, member: str, arguments: tuple[Any, ...] | None) -> Callable[[], object]:
    """Return what asks or commands a part once."""
    return partial(attrgetter(member), part) if arguments is None else partial(getattr(part, member), *arguments)


def rows() -> Iterator[Row]:
    """Yield what each member costs within a moment, against the bare device."""
    asker = Asker()
    for name, ours, theirs in asker.calls():
        yield compare(f"proxy, {name}", ours, theirs, calls=CALLS_TIMED)


def serve() -> None:
    """For each line that comes in, time every member once and write that as a line of JSON."""
    asker = Asker()
    calls = [(name, call) for name, call, _ in asker.calls()]
    for _ in sys.stdin:
        found = {
            f"{name}{', recorded' if recorded else ''}": asker.seconds(call, recorded=recorded)
            for name, call in calls
            for recorded in (False, True)
        }
        print(json.dumps(found), flush=True)


def against(folder: str) -> None:
    """Print what each member costs here and in the version in ``folder``: the least of all rounds, and the ratio."""
    here, there = (_worker(each) for each in (str(Path(__file__).parents[2]), folder))
    rounds = [(_timings(here), _timings(there)) for _ in range(ROUNDS)]
    for worker in (here, there):
        worker.communicate()
    for name in rounds[0][0]:
        ours, theirs = (min(timings[turn][name] for timings in rounds) for turn in (0, 1))
        print(Row(f"proxy, {name}", ours, theirs, ours / theirs))


def _worker(folder: str) -> "subprocess.Popen[str]":
    return subprocess.Popen(
        [sys.executable, __file__, "--serve"],
        env={"PYTHONPATH": folder},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )


def _timings(worker: "subprocess.Popen[str]") -> dict[str, float]:
    if worker.stdin is None or worker.stdout is None:
        raise ValueError("a worker has pipes")
    worker.stdin.write("now\n")
    worker.stdin.flush()
    found: dict[str, float] = json.loads(worker.stdout.readline())
    return found


if __name__ == "__main__":
    if sys.argv[1:] == ["--serve"]:
        serve()
    else:
        against(sys.argv[1])
