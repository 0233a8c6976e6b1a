"""Commands that look through a camera in the network which stalls at any moment: none of them is ended by a signal."""

import os
import random
import signal
import sys
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from subprocess import DEVNULL, TimeoutExpired

import pytest

from drivers.clock import SystemClock
from tests.drivers.web_cameras import MJPEG, Connection, WebCamera, answer, jpeg, part
from tests.forked import Forked
from tests.tries import tries

ENDS = {"natural": None, "Ctrl-C": signal.SIGINT, "SIGTERM": signal.SIGTERM, "closed terminal": signal.SIGHUP}
"""How a command ends."""

GOOD = {0, 1, 3, 130}
"""The exit codes of success, failure, a device that is not there, and an interrupted command."""

LONGEST = 120.0
"""Seconds after which a command hangs that was to last for one, with a camera that it waits for at first."""

LOOK = """mission: look
tree:
  race:
    - wait: SECONDS s
    - face_seen: {}
      hold: 20 s
"""

API = """
import sys, missions
missions.run("look.yaml", robot="wifi.yaml")
if sys.argv[1] == "raise":
    raise ValueError("planted")
"""


def stalling(chance: random.Random) -> Callable[[Connection], None]:
    """Return a camera that falls silent at a moment of chance, or half a picture, or goes on after a while."""
    pictures, cut, kind = chance.randrange(25), chance.randrange(1200), chance.randrange(6)
    silence = chance.choice([0.3, 2.2, 60.0, 60.0])

    def behave(connection: Connection) -> None:
        if kind == 0:  # one picture at a time
            connection.pause(0.0 if connection.number % (pictures + 2) else silence)
            connection.send(answer(jpeg(90, (320, 240))))
            return
        connection.send(MJPEG[: cut if kind == 1 else None])
        while kind != 1:
            connection.stream(25.0, pictures)
            if kind == 2:
                return
            connection.send(part(jpeg(90))[: cut if kind == 3 else 0])
            connection.pause(silence)

    return behave


def commands(seconds: float, url: str) -> dict[str, Sequence[str]]:
    """Return the commands by what they do; each looks for so long."""
    look, run = ("--seconds", f"{seconds:.1f}"), ("missions", "run", "look.yaml", "--robot", "wifi.yaml")
    return {
        "see": ("missions", "see", url, *look),
        "see a robot": ("missions", "see", "--robot", "wifi.yaml", *look, "--json"),
        "run": run,
        "run on another camera": (*run, "--camera", url),
        "doctor": ("missions", "doctor", "--robot", "wifi.yaml"),
        "api": ("api", "end"),
        "api that raises": ("api", "raise"),
    }


def outcome(seed: int, folder: Path) -> tuple[str, str, int | None]:
    """Return a command that looked through a camera of chance, how it was ended, and its exit code; None if it hung."""
    chance = random.Random(seed)  # noqa: S311 - no secret
    folder.mkdir()
    with WebCamera(stalling(chance)) as web:
        url = f"{web.url}/stream"
        seconds = chance.uniform(0.2, 3.0)
        (folder / "look.yaml").write_text(LOOK.replace("SECONDS", f"{seconds:.2f}"))
        (folder / "api.py").write_text(API)
        robot = f"robot: wifi\ncamera: {{source: '{url}'}}\nvoice: {{driver: print}}\n"
        (folder / "wifi.yaml").write_text(robot)
        what, command = chance.choice(sorted(commands(seconds, url).items()))
        end = "natural" if chance.random() < 0.6 else chance.choice(sorted(ENDS))
        with (folder / "said").open("wb") as said:
            run = Forked(*command, folder=folder, stdin=DEVNULL, stdout=said.fileno(), stderr=said.fileno())
        try:
            number = ENDS[end]
            if number is not None:
                try:
                    run.wait(chance.uniform(0.5, 5.0))
                except TimeoutExpired:
                    run.send_signal(number)
            return what, end, run.wait(LONGEST)
        except TimeoutExpired:
            run.send_signal(signal.SIGABRT)  # it says where it hangs
            run.wait()
            return what, end, None


@pytest.mark.long
@pytest.mark.timeout(4 * 3600)
def test_stalling_network_camera_never_crashes_a_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """1000 of them: `TRIES=1000 pytest tests/missions/test_network_cameras.py`; SEED is the first."""
    monkeypatch.setenv("MISSION_WITHOUT_STOP", "yes")
    monkeypatch.setenv("PYTHONFAULTHANDLER", "1")
    clock, ended = SystemClock(), Counter[tuple[str, str, int | None]]()
    first = int(os.environ.get("SEED", "0"))
    for seed in range(first, first + tries(4, most=1000)):
        told = outcome(seed, tmp_path / str(seed))
        ended[told] += 1
        _, end, code = told
        with (tmp_path / "outcomes").open("a") as file:
            file.write(f"{seed}: {told}\n")
        number = ENDS[end]
        killed = number is not None and code == -number  # before it had begun
        assert code in GOOD or killed, (seed, told, (tmp_path / str(seed) / "said").read_text()[-2000:])
    lines = [f"{what}, {end}: exit {code}: {count}" for (what, end, code), count in sorted(ended.items(), key=str)]
    sys.stdout.write("\n".join([*lines, f"{clock.now():.0f} s", ""]))
