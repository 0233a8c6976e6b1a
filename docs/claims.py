"""What docs/reliability.md claims, the command that shows each, and its figures when it was last run.

``make claims`` runs all of them, and writes what came of it, with the day and the commit, into claims.json; the words
after ``python -m docs.claims`` choose some by their names.
"""

import json
import os
import re
import subprocess
import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple
from xml.etree import ElementTree as ET

from missions.plugins.schema.robots import code, table

ROOT = Path(__file__).parents[1]
KEPT = Path(__file__).with_suffix(".json")


class Claim(NamedTuple):
    """A claim: its ``name``, what is claimed, the ``words`` that show it, and what it does not cover.

    The words are those of a command, ``NAME=VALUE`` in front of them set in its environment. ``gap`` is what is not
    covered.
    """

    name: str
    what: str
    words: str
    gap: str


BROKEN = 8000
"""Characters that are told of what a command has said that does not hold."""

TESTS = "pytest -n 0 "
CLAIMS = (
    Claim(
        "storm",
        "all promises below hold, whatever a seed draws",
        "python -m tests.storm --seeds 2000",
        "twins in simulated time: no wire, no server, no page",
    ),
    Claim(
        "range guard",
        "among people and furniture, whoever drives: a base drives into nothing that was visible to its range finder "
        "in time ([defined before](base.md#visible-in-time)); 95 % of clean missions still finish, 10 % slower at most",
        f"TRIES=10000 {TESTS}tests/drivers/test_guard_campaign.py",
        "a simulated range finder, whose plane nothing is above or below; round bases",
    ),
    Claim(
        "run killed",
        "`kill -9` while it drives: the base is at rest 0.7 s after it last heard anything; at any moment since its "
        "start: its record can be read, no process, note or socket is left behind",
        f"TRIES=500 {TESTS}tests/missions/test_killed.py",
        "the virtual base's firmware, not a real one's",
    ),
    Claim(
        "stop anywhere",
        "a stop that is told has happened: 40 combinations of variables, sessions, containers, studios, and folders "
        "that are full, emptied, replaced or missing",
        f"TRIES=most {TESTS}tests/missions/studio/test_stop_anywhere.py",
        "two computers with one home; containers that share neither folders nor network, but for root outside of them",
    ),
    Claim(
        "processes",
        "a run, who records it, the studio and who drives by it, killed, frozen, cut off and stopped by chance: the "
        "base rests 0.7 s after it last heard anything, what was stopped stays so, nothing is left but a readable "
        "record",
        f"TRIES=200 {TESTS}tests/missions/test_process_storm.py",
        "arms and heads; two of them struck at the same instant",
    ),
    Claim(
        "wire of a base",
        "bytes lost, doubled, bent, a plug pulled, silence, a loop that stalls: the base rests 0.7 s after it was last "
        "commanded, and keeps its limits",
        f"TRIES=500 {TESTS}tests/drivers/test_wire_storm.py",
        "heads and arms, whose wires have tests of their own; whole missions",
    ),
    Claim(
        "limbs",
        "`kill -9`, SIGSTOP or a crash while arm and head move: at rest within 0.5 s; let go on, nothing leaps",
        f"{TESTS}tests/missions/test_killed_limbs.py",
        "virtual servos",
    ),
    Claim(
        "stalled loop",
        "a loop that stalls at any moment of driving: the base comes to rest",
        f"{TESTS}tests/missions/test_stalled.py",
        "virtual bases",
    ),
    Claim(
        "hanging leaf",
        "a leaf that hangs, in Python or in C: its name and line are told, the robot is kept still, signals end it",
        f"{TESTS}tests/missions/test_watchdog.py tests/missions/test_lifeline.py",
        "a kernel that hangs",
    ),
    Claim(
        "recorder killed",
        "`kill -9` of the run and of who writes its record: at most the last second is missing",
        f"TRIES=500 {TESTS}tests/missions/records/recording/test_recorder.py -k kill_at_any_moment",
        "pictures; a disk slower than a second",
    ),
    Claim(
        "server killed",
        "`kill -9` of the server of tasks: none lost, none completed twice",
        f"TRIES=500 {TESTS}tests/missions/service/test_killed_queue.py",
        "two servers on a network's disk",
    ),
    Claim(
        "power cut",
        "no task that was acknowledged is lost or falls back; a record has all up to its last sync, one in each 0.6 s "
        "and 0.3 s after what is told seldom, and everything once it is closed",
        f"CUTS=200 {TESTS}tests/missions/testing/test_power_cut.py",
        "a file system that changes the order of names; a disk that lies; the log of who did what in the studio",
    ),
    Claim(
        "network",
        "whatever the network does to who drives: the base stops",
        f"{TESTS}tests/missions/studio/test_link_lost.py tests/missions/studio/test_control.py",
        "real radios",
    ),
    Claim(
        "planted",
        "faults planted in a copy of the code are found",
        "python -m tests.planted --seeds 200",
        "faults that nobody thought of",
    ),
)


def shown(claim: Claim) -> Mapping[str, object]:
    """Run the command of a claim; return what came of it."""
    words = claim.words.split()
    given = dict(word.split("=", 1) for word in words if re.fullmatch(r"[A-Z]+=\w+", word))
    program, *rest = words[len(given) :]
    with TemporaryDirectory() as folder:
        results = Path(folder) / "results.xml"
        more = (
            ["-q", "--timeout", "0", "-o", "junit_family=xunit1", f"--junitxml={results}"]
            if program == "pytest"
            else []
        )
        command = [str(Path(sys.executable).with_name(program)), *rest, *more]
        ran = ran_in_root(command, given)
        if ran.returncode:
            sys.stdout.write(f"{ran.stdout[-BROKEN:]}\n{ran.stderr[-BROKEN:]}\n")
        figure = tests_told(results) if program == "pytest" else output_told(ran.stdout)
    commit = ran_in_root(["git", "rev-parse", "--short", "HEAD"], {}).stdout.strip()
    day = datetime.now(UTC).date().isoformat()
    return {"held": ran.returncode == 0, "figure": figure, "date": day, "commit": commit}


def ran_in_root(command: Sequence[str], given: Mapping[str, str]) -> "subprocess.CompletedProcess[str]":
    """Run a command, with more in its environment."""
    env = {**os.environ, **given}
    return subprocess.run(command, cwd=ROOT, env=env, capture_output=True, text=True, check=False)  # noqa: S603 - ours


def tests_told(results: Path) -> str:
    """Return what tests have told: each ``figure``, the largest ``most``, and how many there were."""
    suite = ET.parse(results).getroot()  # noqa: S314 - of our own writing
    cases = list(suite.iter("testcase"))
    bad = sum(each.find("failure") is not None or each.find("error") is not None for each in cases)
    skipped = sum(each.find("skipped") is not None for each in cases)
    told: dict[str, list[str]] = {}
    for each in suite.iter("property"):
        told.setdefault(each.attrib["name"], []).append(each.attrib["value"])
    most = [f"{len(each)} tries, {max(each)} at most" for name, each in told.items() if name == "most"]
    count = f"{len(cases) - bad - skipped} of {len(cases)} tests" if bad or skipped else f"{len(cases)} tests"
    return "; ".join([*told.get("figure", []), *most, count])


def output_told(output: str) -> str:
    """Return the figures of the storm, or of planted faults."""
    lines = output.strip().splitlines()
    if lines and " seeds, " in lines[0]:
        return lines[0]
    found = Counter("not found" in line for line in lines)
    return f"{found[False]} of {len(lines)} found"


def claims() -> str:
    """Return the table of the claims."""
    kept = json.loads(KEPT.read_text("utf-8")) if KEPT.exists() else {}
    return table(("claim", "shown by", "last figures", "does not cover"), (_row(each, kept) for each in CLAIMS))


def _row(claim: Claim, kept: Mapping[str, Mapping[str, object]]) -> Sequence[str]:
    last = kept.get(claim.name)
    told = "not run yet"
    if last is not None:
        told = f"{'' if last['held'] else '**broken**: '}{last['figure']} ({last['date']}, {last['commit']})"
    return claim.what, code(claim.words), told, claim.gap


def main(names: Sequence[str]) -> None:
    """Renew the figures of the claims of these names; of all for none."""
    for claim in CLAIMS:
        if not names or claim.name in names:
            kept = json.loads(KEPT.read_text("utf-8")) if KEPT.exists() else {}
            kept[claim.name] = shown(claim)
            KEPT.write_text(json.dumps(kept, indent=2, sort_keys=True) + "\n", "utf-8")
            sys.stdout.write(f"{claim.name}: {kept[claim.name]['figure']}\n")
            sys.stdout.flush()


if __name__ == "__main__":
    main(sys.argv[1:])
