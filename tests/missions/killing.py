"""Programs that move an arm or a head, ended at moments of chance, each in a process of its own; and what became of it.

``SIGKILL`` is what the out-of-memory killer sends. A stopped program is let go on once all is at rest.
"""

import random
import signal
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import partial
from math import degrees
from pathlib import Path
from subprocess import DEVNULL
from threading import Event

from drivers.clock import SystemClock
from tests.forked import Forked
from tests.missions.lone_limbs import FEETECH, JOINTS, SPEED, LoneLimbs, Seen, lone_limbs
from tests.waiting import wait_until

WAYS = {"kill": signal.SIGKILL, "stop": signal.SIGSTOP, "crash": signal.SIGSEGV}
"""How a program falls silent."""

WITHIN = 0.5
"""Seconds from the last that limbs hear to their rest."""

MAX_MOVING = 2.5
"""Seconds for which a program moves something, at most, before it is silenced."""

START_TIMEOUT = 180.0
"""Seconds within which all programs have moved something and are silenced: many of them start at once."""

SOON = 8.0
"""Seconds within which a program that was let go on moves something again, if it ever does."""

_ALL = "[" + ", ".join(JOINTS) + "]"


def _everywhere(angle: str) -> str:
    return "{" + ", ".join(f"{joint}: {angle}" for joint in JOINTS) + "}"


MISSIONS: Mapping[str, str] = {
    "move": f"""
  sequence:
    - move_joints: {{to: {_everywhere("80 deg")}, speed: 40 deg/s}}
    - move_joints: {{to: {_everywhere("-80 deg")}}}
    - move_joints: {{to: {_everywhere("0 deg")}, speed: 15 deg/s}}
  repeat: forever""",
    "gesture": """
  gesture: FOLDER/salute.yaml
  repeat: forever""",
    "play": """
  play: FOLDER/sheet.csv
  repeat: forever""",
    "sweep": f"""
  sweep: {{joints: {_ALL}, between: [-70 deg, 70 deg], period: 3 s}}""",
    "mirror": """
  mirror: {leader: [shoulder, hip], follower: [elbow, knee], scale: -1}""",
    "head sweep": """
  sweep_head: {amplitude: 60 deg, period: 3 s}""",
    "feetech sweep": f"""
  sweep: {{joints: {_ALL}, between: [-70 deg, 70 deg], period: 3 s}}""",
}
"""The trees of the missions that are ended, by what they do."""

COMMANDS: Mapping[str, Sequence[str]] = {
    "servo move": ("servo", "move", "shoulder", "ANGLE", "deg", "--speed", "50 deg/s"),
    "servo play": ("servo", "play", "FOLDER/sheet.csv"),
}
"""Other commands that are ended; ANGLE is now this, now that."""

KINDS = (*MISSIONS, *COMMANDS)


@dataclass(frozen=True)
class Silence:
    """What became of a program that fell silent.

    ``took`` is how long (s) the limbs moved on after they last heard anything, ``moving`` whether they did so when it
    was silenced. After a program that was let go on, ``fastest`` is the greatest speed of a joint (degrees a second),
    and ``step`` the longest way (degrees) that a servo of the head was sent at once.
    """

    kind: str
    way: str
    took: float
    moving: bool
    fastest: float = 0.0
    step: float = 0.0


class Campaign:
    """Limbs for each kind of program; ``rounds`` of silencing one of each, all at once."""

    def __init__(self, folder: Path, limbs: Mapping[str, LoneLimbs], seed: int) -> None:
        self._folder = folder
        self._limbs = limbs
        self._chance = random.Random(seed)  # noqa: S311 - chance, not a secret
        self._pause = Event()
        self._round = 0

    def round(self, way: str) -> Iterator[Silence]:
        """Let all programs run, silence each at a moment of its own, and see what becomes of its limbs."""
        self._round += 1
        for limbs in self._limbs.values():
            limbs.seen(forget=True)
        running = {kind: self._start(kind) for kind in self._limbs}
        try:
            moving = self._silence(running, WAYS[way])
            for kind, limbs in self._limbs.items():
                took = time_to_rest(limbs)
                after = self._let_go_on(limbs, running[kind]) if way == "stop" else Seen()
                fastest = degrees(after.fastest) if kind != "head sweep" else 0.0
                yield Silence(kind, way, took, moving[kind], fastest, after.step)
        finally:
            for process in running.values():
                process.kill()  # a stopped one too

    def _silence(self, running: dict[str, Forked], number: int) -> dict[str, bool]:
        """Silence each program some time after its limbs have begun to move; return which moved at that moment.

        On a busy machine servos seem to be missing now and then, and a program ends before anything moves: once more.
        """
        clock, due, moving = SystemClock(), dict[str, float](), dict[str, bool]()
        began = {kind: self._limbs[kind].seen().now for kind in running}
        while len(moving) < len(running):
            assert clock.now() < START_TIMEOUT, f"nothing moves of {running.keys() - due.keys()}"
            for kind in running.keys() - moving.keys():
                if kind in due and clock.now() >= due[kind]:
                    moving[kind] = self._limbs[kind].seen().moving
                    running[kind].send_signal(number)
                elif kind not in due and self._limbs[kind].seen().moved_at > began[kind]:
                    due[kind] = clock.now() + self._chance.uniform(0.0, MAX_MOVING)
                elif kind not in due and running[kind].poll() is not None:
                    running[kind] = self._start(kind)
            self._pause.wait(0.01)
        return moving

    def _let_go_on(self, limbs: LoneLimbs, process: Forked) -> Seen:
        """Let a stopped program go on; return what was seen of it until it moved, and a little longer."""
        self._pause.wait(self._chance.uniform(0.0, 1.5))
        limbs.seen(forget=True)
        process.send_signal(signal.SIGCONT)
        for _ in range(int(SOON / 0.05)):
            self._pause.wait(0.05)
            if limbs.seen().moving:
                break
        self._pause.wait(0.5)
        return limbs.seen()

    def _start(self, kind: str) -> Forked:
        return Forked("missions", *self._words(kind), stdin=DEVNULL, stdout=DEVNULL)

    def _words(self, kind: str) -> list[str]:
        limbs = limbs_of(kind)
        part = "head" if limbs == "head" else "arm"
        robot = ["--robot", str(self._folder / f"{limbs}.robot.yaml")]
        port = self._limbs[kind].port
        if kind in MISSIONS:
            return ["run", str(self._folder / f"{kind}.yaml"), *robot, "--port", f"{part}={port}"]
        angle = "80" if self._round % 2 else "-80"
        words = [word.replace("FOLDER", str(self._folder)).replace("ANGLE", angle) for word in COMMANDS[kind]]
        return [*words, *robot, "--port", port]


def limbs_of(kind: str) -> str:
    """Return which limbs a kind of program moves."""
    first = kind.split(maxsplit=1)[0]
    return first if first in ("head", "feetech") else "arm"


def time_to_rest(limbs: LoneLimbs) -> float:
    """Return the seconds from the last that the limbs heard to their rest, which follows by itself."""
    wait_until(partial(_quiet, limbs))
    seen = limbs.seen()
    return max(0.0, seen.moved_at - seen.heard_at)


def _quiet(limbs: LoneLimbs) -> bool:
    """Whether nothing moves, and has not for a while in which nothing was heard."""
    first = limbs.seen()
    Event().wait(0.5)
    second = limbs.seen()
    return (first.heard_at, first.moved_at) == (second.heard_at, second.moved_at)


@contextmanager
def campaign(folder: Path, kinds: Sequence[str] = KINDS, seed: int = 15) -> Iterator[Campaign]:
    """Run limbs for each of ``kinds``; their files are put into ``folder``."""
    _write(folder)
    with ExitStack() as lives:
        limbs = {kind: lives.enter_context(lone_limbs(limbs_of(kind))) for kind in kinds}
        yield Campaign(folder, limbs, seed)


def _write(folder: Path) -> None:
    def put(name: str, text: str) -> None:
        (folder / name).write_text(text.replace("FOLDER", str(folder)), encoding="utf-8")

    for kind, tree in MISSIONS.items():
        put(f"{kind}.yaml", f"mission: {kind.replace(' ', '_')}\ntree:{tree}\n")
    bounds = f"limits: [-100 deg, 100 deg], speed: {degrees(SPEED):.0f} deg/s"
    for limbs, driver, models in (("arm", "dynamixel", JOINTS), ("feetech", "feetech", FEETECH)):
        joints = "".join(
            f"    {name}: {{id: {number}, model: {model}, {bounds}}}\n"
            for number, (name, model) in enumerate(models.items(), 1)
        )
        told = f"robot: lone_{limbs}\narm:\n  driver: {driver}\n  port: /dev/none\n  joints:\n{joints}"
        put(f"{limbs}.robot.yaml", told)
    put(
        "head.robot.yaml",
        "robot: lone_head\nhead:\n  driver: arduino\n  port: /dev/none\n  boot: 0 s\n  speed: 120 deg/s\n"
        "  acceleration: 400 deg/s^2\n  pan: {servo: 0, limits: [-80 deg, 80 deg]}\n"
        "  tilt: {servo: 1, limits: [-60 deg, 20 deg], flip: true}\n",
    )
    frames = "".join(
        f"  - {{at: {at} s, {', '.join(f'{joint}: {angle} deg' for joint in JOINTS)}}}\n"
        for at, angle in ((1.5, 70), (3.0, -70), (4.5, 0))
    )
    put("salute.yaml", f"gesture: salute\nsummary: To and fro.\nkeyframes:\n{frames}")
    rows = [f"{at / 10:.1f}" + f",{1.2 * _triangle(at / 20):.3f}" * len(JOINTS) for at in range(60)]
    put("sheet.csv", "\n".join([",".join(["time", *JOINTS]), *rows, ""]))


def _triangle(turns: float) -> float:
    """Return a wave between -1 and 1 that begins at 0."""
    return 1 - abs((turns + 0.25) % 1.0 * 4 - 2)
