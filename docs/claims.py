"""The claims of docs/reliability.md, the command that shows each one, and the figures of its last run.

``make claims`` runs all of them, and writes figures, day and commit to claims.json. The arguments of ``python -m
docs.claims`` select claims by name.
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

from missions.plugins.schema.robots import markdown_code, markdown_table

ROOT = Path(__file__).parents[1]
FIGURES = Path(__file__).with_suffix(".json")


class ReliabilityClaim(NamedTuple):
    """A claim, its command and its gaps.

    ``words`` is the command; leading ``NAME=VALUE`` words set environment variables. ``gap`` is not covered by the
    command.
    """

    name: str
    what: str
    words: str
    gap: str


MAX_OUTPUT = 8000
"""Number of characters printed of the output of a failed command."""

TESTS = "pytest -n 0 "
CLAIMS = (
    ReliabilityClaim(
        "storm",
        "all promises of this page hold, for every seed",
        "python -m tests.storm --seeds 2000",
        "twins in simulated time: no wire, no server, no page",
    ),
    ReliabilityClaim(
        "range guard",
        "among people and furniture, whoever commands it: a base does not hit anything that its range finder saw "
        "in time ([definition](base.md#visible-in-time)); 95 % of clean missions still finish, 10 % slower at most",
        f"TRIES=10000 {TESTS}tests/drivers/test_guard_campaign.py",
        "a simulated range finder without obstacles above or below its plane; other than round bases",
    ),
    ReliabilityClaim(
        "run killed",
        "`kill -9` while it drives: the base is at rest 0.7 s after it last received data; at any moment since its "
        "start: its record can be read, and no process, note or socket is left behind",
        f"TRIES=500 {TESTS}tests/missions/test_killed.py",
        "the virtual base's firmware, not a real one's",
    ),
    ReliabilityClaim(
        "stop anywhere",
        "a stop that is reported has happened: 40 combinations of variables, sessions, containers, studios, and "
        "folders that are full, emptied, replaced or missing",
        f"TRIES=most {TESTS}tests/missions/studio/test_stop_anywhere.py",
        "two computers with one home; containers that share neither folders nor network, except for root outside",
    ),
    ReliabilityClaim(
        "processes",
        "a run, its recorder, the studio and its client, killed, frozen, cut off and stopped at random: the base is at "
        "rest 0.7 s after it last received data, a stop persists, and only a readable record is left",
        f"TRIES=200 {TESTS}tests/missions/test_process_storm.py",
        "arms and heads; two failures at the same instant",
    ),
    ReliabilityClaim(
        "wire of a base",
        "lost, doubled and damaged bytes, an unplugged cable, silence, a stalled loop: the base is at rest 0.7 s "
        "after its last command, and keeps its limits",
        f"TRIES=500 {TESTS}tests/drivers/test_wire_storm.py",
        "heads and arms, which have wire tests of their own; whole missions",
    ),
    ReliabilityClaim(
        "limbs",
        "`kill -9`, SIGSTOP or a crash while arm and head move: at rest within 0.5 s; resumed, nothing leaps",
        f"{TESTS}tests/missions/test_killed_limbs.py",
        "virtual servos",
    ),
    ReliabilityClaim(
        "stalled loop",
        "a loop that stalls at any time while it drives: the base comes to rest",
        f"{TESTS}tests/missions/test_stalled.py",
        "virtual bases",
    ),
    ReliabilityClaim(
        "hanging leaf",
        "a leaf that hangs, in Python or in C: its name and line are reported, the robot is kept still, signals end it",
        f"{TESTS}tests/missions/test_watchdog.py tests/missions/test_lifeline.py",
        "a kernel that hangs",
    ),
    ReliabilityClaim(
        "recorder killed",
        "`kill -9` of the run and of its recorder: at most the last second is missing",
        f"TRIES=500 {TESTS}tests/missions/records/recording/test_recorder.py -k kill_at_any_moment",
        "pictures; a disk slower than a second",
    ),
    ReliabilityClaim(
        "server killed",
        "`kill -9` of the task server: no task is lost, none is completed twice",
        f"TRIES=500 {TESTS}tests/missions/service/test_killed_queue.py",
        "two servers on a network disk",
    ),
    ReliabilityClaim(
        "power cut",
        "no acknowledged task is lost or reverted; a record has everything up to its last sync (every 0.6 s, and 0.3 s "
        "after a rare event), and everything after it is closed",
        f"CUTS=200 {TESTS}tests/missions/testing/test_power_cut.py",
        "a file system that reorders names; a disk that reports false syncs; the audit log of the studio",
    ),
    ReliabilityClaim(
        "network",
        "any failure of the driving person's network: the base stops",
        f"{TESTS}tests/missions/studio/test_link_lost.py tests/missions/studio/test_control.py",
        "real radios",
    ),
    ReliabilityClaim(
        "planted",
        "faults planted in a copy of the code are found",
        "python -m tests.planted --seeds 200",
        "faults that were not planted",
    ),
)


def run_claim(claim: ReliabilityClaim) -> Mapping[str, object]:
    """Run the command of a claim, and return its result, figures, day and commit."""
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
        ran = run_in_root(command, given)
        if ran.returncode:
            sys.stdout.write(f"{ran.stdout[-MAX_OUTPUT:]}\n{ran.stderr[-MAX_OUTPUT:]}\n")
        figure = summarise_tests(results) if program == "pytest" else summarise_output(ran.stdout)
    commit = run_in_root(["git", "rev-parse", "--short", "HEAD"], {}).stdout.strip()
    day = datetime.now(UTC).date().isoformat()
    return {"held": ran.returncode == 0, "figure": figure, "date": day, "commit": commit}


def run_in_root(command: Sequence[str], variables: Mapping[str, str]) -> "subprocess.CompletedProcess[str]":
    """Run a command in the root of the repository, with additional environment variables."""
    env = {**os.environ, **variables}
    return subprocess.run(command, cwd=ROOT, env=env, capture_output=True, text=True, check=False)  # noqa: S603 - ours


def summarise_tests(results: Path) -> str:
    """Return the figures of a JUnit file: each ``figure``, the largest ``most``, and the number of tests."""
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


def summarise_output(output: str) -> str:
    """Return the figures of the storm, or of planted faults."""
    lines = output.strip().splitlines()
    if lines and " seeds, " in lines[0]:
        return lines[0]
    found = Counter("not found" in line for line in lines)
    return f"{found[False]} of {len(lines)} found"


def claims() -> str:
    """Return the table of the claims."""
    kept = json.loads(FIGURES.read_text("utf-8")) if FIGURES.exists() else {}
    return markdown_table(
        ("claim", "shown by", "last figures", "does not cover"), (_row(each, kept) for each in CLAIMS)
    )


def _row(claim: ReliabilityClaim, kept: Mapping[str, Mapping[str, object]]) -> tuple[str, ...]:
    last = kept.get(claim.name)
    told = "not run yet"
    if last is not None:
        told = f"{'' if last['held'] else '**broken**: '}{last['figure']} ({last['date']}, {last['commit']})"
    return claim.what, markdown_code(claim.words), told, claim.gap


def main(names: Sequence[str]) -> None:
    """Renew the figures of the named claims, or of all claims without names."""
    for claim in CLAIMS:
        if not names or claim.name in names:
            kept = json.loads(FIGURES.read_text("utf-8")) if FIGURES.exists() else {}
            kept[claim.name] = run_claim(claim)
            FIGURES.write_text(json.dumps(kept, indent=2, sort_keys=True) + "\n", "utf-8")
            sys.stdout.write(f"{claim.name}: {kept[claim.name]['figure']}\n")
            sys.stdout.flush()


if __name__ == "__main__":
    main(sys.argv[1:])
