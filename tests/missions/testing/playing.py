"""Writing a mission and a case of its test into a folder, and playing it: what several tests of playing share."""

from collections.abc import Generator, Mapping, Sequence
from pathlib import Path

from missions.plugins.testing.case_runner import IN_PROCESS_LIMITS
from missions.plugins.testing.case_verdict import CaseVerdict, play
from missions.plugins.testing.suite import Case, load_suite

TRIES = "mission: m\ntree: {drive: 40 cm, retry: 2}\n"
DRIVES = "mission: m\ntree: {drive: 40 cm}\n"
LOOKS = "mission: m\ntree: {sequence: [{look: 40 deg}, {look: 0 deg}]}\n"
SPEAKS = "mission: m\ntree: {sequence: [{say: One}, {say: Two}]}\n"
WAVES = "mission: m\ntree: {gesture: hello}\n"
WAITS = "mission: m\ntree: {wait: 1 s}\n"
BLINKS = "mission: m\ntree:\n  sequence:\n    - look: 30 deg\n    - wait: 2 s\n    - face_seen: 500 ms\n"


def cases(folder: Path, mission: str, *bodies: str) -> tuple[Case, ...]:
    """Return the cases of a test file whose cases have these bodies, one line each, without their titles."""
    (folder / "m.yaml").write_text(mission, encoding="utf-8")
    lines = [f"  - {{case: case {number}, {body}}}\n" for number, body in enumerate(bodies, start=1)]
    file = folder / "m.test.yaml"
    file.write_text("tests: m\nwith: {eyes: truth}\ncases:\n" + "".join(lines), encoding="utf-8")
    return load_suite(file)


def played(folder: Path, mission: str, body: str) -> CaseVerdict:
    """Play one case in this process."""
    (case,) = cases(folder, mission, body)
    return play(case, limits=IN_PROCESS_LIMITS)


def play_here(cases: Sequence[Case], *, jobs: int) -> Generator[CaseVerdict]:
    """Play cases one by one in this process, where a test is not about the processes that ``mission test`` starts."""
    del jobs
    yield from (play(case, limits=IN_PROCESS_LIMITS) for case in cases)


def seen(verdict: CaseVerdict) -> list[str]:
    """Return what was seen instead of what was expected."""
    return [miss.message for miss in verdict.misses]


def write(folder: Path, files: Mapping[str, str]) -> None:
    """Write some files."""
    for name, text in files.items():
        (folder / name).write_text(text, encoding="utf-8")
