"""Plants faults in a copy of the code, one at a time, and tells with how many seeds the storm finds each.

``python -m tests.planted --seeds 300`` plants all of them; names after that, those alone. A fault that its own command
finds instead (a power cut is no storm) says so.
"""

import argparse
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import click

ROOT = Path(__file__).parent.parent
PACKAGES = ("behaviours", "config", "docs", "drivers", "missions", "perception", "tests")

PLAYS = """
import sys
from tests.storm.play import play_seed
first, seeds = map(int, sys.argv[1:])
for seed in range(first, first + seeds):
    broken = play_seed(seed).broken
    if broken:
        print(seed - first + 1, *broken)
        sys.exit(1)
"""


class Planted(NamedTuple):
    """A fault: its name, the file, what stands there, and what is put in its place.

    ``by`` is a test that is to find it, where the storm is not.
    """

    name: str
    file: str
    old: str
    new: str
    by: str = ""


STOPPING, LEAF = "behaviours/haltable_node.py", "behaviours/leaf.py"
LATCH, EXECUTIVE = "missions/executive/stop_latch.py", "missions/executive/executive.py"
POWER = "tests/missions/testing/test_power_cut.py"

FAULTS = (
    Planted("speed limit of the base not applied", "drivers/base/limits.py", "if excess == 1.0:", "if True:"),
    Planted(
        "speed limit of a joint not applied",
        "drivers/servos/twin.py",
        "min(max(speed, 0.0), joint.limits.speed)",
        "9.0",
    ),
    Planted("head's goals not clamped", "drivers/head/twin.py", "self.limits.clamp(target)", "target"),
    Planted(
        "joints' goals not clamped",
        "drivers/servos/servo_joints.py",
        "accepted[name] = joint.clamp(goal)",
        "accepted[name] = goal",
    ),
    Planted(
        "nan let through to the base", "drivers/base/limits.py", "if not (isfinite(", "if False and not (isfinite("
    ),
    Planted("a velocity lives for 30 s", "drivers/api/steering.py", "COMMAND_TIMEOUT = 0.3", "COMMAND_TIMEOUT = 30.0"),
    Planted(
        "a driver's error swallowed",
        LEAF,
        "return self.fail(message_of(error) or type(error).__name__)",
        "return SUCCESS",
    ),
    Planted(
        "a failure without a reason", LEAF, "self.feedback_message = reason\n        return FAILURE", "return FAILURE"
    ),
    Planted("tree not halted at the end", EXECUTIVE, "            self._halt_all()\n", ""),
    Planted("chance without a seed", "behaviours/run.py", "random.Random(seed)", "random.Random()"),
    Planted(
        "stop latch refuses nothing",
        LATCH,
        "        if self.reason:\n            raise",
        "        if False:\n            raise",
    ),
    Planted(
        "stop does not reach head and arm", LATCH, "            self._safe_stop(frozenset({part}))", "            pass"
    ),
    Planted("stop does not reach the base", LATCH, "            self._base.latch(self.reason)", "            pass"),
    Planted(
        "pause does not hold",
        EXECUTIVE,
        "self.run.safe_stop(self.root.claims - SOUND_KINDS)",
        "pass",
    ),
    Planted(
        "leaf not stopped after its second",
        STOPPING,
        "                return False\n            self._stop_safely()",
        "                return False",
    ),
    Planted(
        "leaf that raises at its end not stopped",
        STOPPING,
        'log.exception("%s raised while it stopped", self.label)\n            self._stop_safely()',
        'log.exception("%s raised while it stopped", self.label)',
    ),
    Planted(
        "leaf without a terminate not stopped",
        STOPPING,
        "            self._stop_safely()\n            return\n",
        "            return\n",
    ),
    Planted(
        "arm not held at the end",
        "drivers/servos/twin.py",
        "self._hold_or_relax(self._servos, stiff=self._stiff_at_rest), stiff=self._stiff_at_rest",
        "(), stiff=self._stiff_at_rest",
    ),
    Planted(
        "head goes on after a halt", "behaviours/head.py", "            self.robot.head.stop()", "            pass"
    ),
    Planted(
        "lower branch not waited for",
        "behaviours/run.py",
        "at_rest &= node.halt()",
        "node.halt()",
    ),
    Planted("battery ends nothing", "missions/executive/guard.py", "if battery.critical else", "if False else"),
    Planted(
        "what was decided before an absence goes on",
        "missions/executive/proxied_robot.py",
        "leaf.started_at < returned:",
        "leaf.started_at < returned - 1e9:",
    ),
    Planted("nobody looks at the base during a pause", EXECUTIVE, "                self._guard_paused(due)\n", ""),
    Planted(
        "tasks not synced",
        "missions/plugins/tasks/queue_database.py",
        "synchronous = FULL",
        "synchronous = OFF",
        by=POWER,
    ),
    Planted(
        "record not synced",
        "missions/plugins/records/recording/writer.py",
        "os.fdatasync(self._fd)",
        "pass",
        by=POWER,
    ),
    Planted(
        "a record loses an answer",
        "missions/executive/tick_cache.py",
        "            if answers.is_recording:\n",
        "            if answers.is_recording and len(answers.answers) != 3:\n",
    ),
    Planted(
        "a thread left behind",
        "missions/runner.py",
        "            self.executive.emit_end(result)\n            self.stream.close()\n        return",
        "            self.executive.emit_end(result)\n            self.stream.close()\n"
        "            __import__('threading').Thread(target=__import__('time').sleep, args=(99,), daemon=True).start()\n"
        "        return",
    ),
    Planted(
        "an open file left behind",
        "missions/runner.py",
        "            self.executive.emit_end(result)\n            self.stream.close()\n        return",
        "            self.executive.emit_end(result)\n            self.stream.close()\n"
        "            __import__('os').open('/dev/null', 0)\n"
        "        return",
    ),
)


def copied(folder: Path, fault: Planted) -> None:
    """Copy the code into ``folder``, with the fault in it."""
    for package in PACKAGES:
        shutil.copytree(ROOT / package, folder / package, ignore=shutil.ignore_patterns("__pycache__", "*.png"))
    path = folder / fault.file
    text = path.read_text("utf-8")
    if fault.old not in text:
        raise SystemExit(f"{fault.name}: {fault.file} has no such line any more: {fault.old}")
    path.write_text(text.replace(fault.old, fault.new, 1), "utf-8")


def found(fault: Planted, first: int, seeds: int) -> str:
    """Return what found the fault, and with how many seeds."""
    with TemporaryDirectory(prefix="planted-") as name:
        copied(Path(name), fault)
        plays = [sys.executable, "-c", PLAYS, str(first), str(seeds)]
        test = [sys.executable, "-m", "pytest", "-q", "-n", "0", fault.by]
        tried = subprocess.run(test if fault.by else plays, cwd=name, capture_output=True, check=False, text=True)
        if tried.returncode == 0:
            return ""
        told = tried.stdout.strip() or tried.stderr.strip()
        return f"by {fault.by}" if fault.by else told.splitlines()[-1]


def wanted(names: list[str]) -> Iterator[Planted]:
    """Yield the faults of these names; all for none."""
    return (fault for fault in FAULTS if not names or fault.name in names)


def main() -> None:
    """Plant them."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--seeds", type=int, default=300)
    options.add_argument("--first", type=int, default=500_000)
    options.add_argument("names", nargs="*")
    given = options.parse_args()
    for fault in wanted(given.names):
        what = found(fault, given.first, given.seeds)
        click.echo(f"{fault.name}: {what or f'not found within {given.seeds} seeds'}")


if __name__ == "__main__":
    main()
