"""Missions with a planted fault each: what is found, at which line, and how short the run is that shows it."""

from functools import cache
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path

import pytest

import missions
from drivers.clock import ManualClock
from missions.library.shipped import load_mission, shipped_missions
from missions.library.vocabulary import load_leaves
from missions.plugins.verify.explore import PROVED, REFUTED, VerificationReport
from missions.plugins.verify.verdicts import verify

FOLDER = Path(__file__).parent / "faulty"

ENDS, REACHED, TIMES, CLEAN, SET = "it can end", "each of its", "its ", "after every halt", "every variable"

FAULTS: dict[str, tuple[str, int, str, int | None]] = {
    "retry_what_always_fails": (ENDS, 11, "'retry' goes on for ever", 1),
    "once_remembers_a_failure": (ENDS, 6, "'retry' goes on for ever", 1),
    "waits_for_what_never_comes": (ENDS, 6, "'pretend' goes on for ever", 0),
    "stuck_after_a_bump": (ENDS, 11, "'retry' goes on for ever", 1),
    "delay_longer_than_timeout": (REACHED, 6, "'say' is never reached", None),
    "second_try_out_of_time": (REACHED, 7, "'say' is never reached", None),
    "race_with_a_question": (REACHED, 6, "'look' is never reached", None),
    "case_that_never_comes": (REACHED, 13, "'say' is never reached", None),
    "left_rolling": (CLEAN, 6, "the base still moves: roll_away (line 6) leaves it to itself", 2),
    "gesture_while_driving": (
        "never: gesture while drive",
        12,
        "gesture (line 10) starts while drive (line 7) runs",
        1,
    ),
    "greets_nobody": ("never: gesture before find_face", 9, "find_face has not succeeded", 1),
    "drives_after_goodbye": ("never: drive after say", 9, "drive (line 5) starts, and say has succeeded before", 2),
    "waves_in_the_end": ("never: gesture after drive", 14, "gesture (line 10) starts, and drive has succeeded", 2),
    "speaks_without_moving": ("never: say without gesture", 8, "nothing of gesture does", 1),
    "never_stops": ("always eventually: base stopped", 8, "from here on it goes on moving", 1),
    "silent_end": ("always eventually: say", 9, "from here on say does not run", 1),
    "cannot_fail": ("can: fail", 9, "no run ends with failure", None),
    "wait_longer_than_timeout": (TIMES, 5, "'wait' of 10 s is never over", None),
    "waits_that_add_up": (TIMES, 6, "'wait' of 3 s is never over", None),
    "inner_timeout_never_fires": (TIMES, 6, "'timeout' of 20 s is never over", None),
    "inner_for_never_over": (TIMES, 6, "'for' of 20 s is never over", None),
    "says_after_too_short_a_time": (REACHED, 6, "'say' is never reached", None),
    "greets_too_early": (SET, 9, "'guest' is read here, but nothing has set it", 2),
    "asks_what_nobody_set": (SET, 9, "'guest' is read here, but nothing has set it", 1),
    "never_comes_to_rest": (CLEAN, 6, "after a halt, 'dither' never comes to rest", None),
    "holds_too_long": ("can: succeed", 8, "no run ends with success", None),
}
"""Of each file: the rule that is refuted, the line, words of the message, and the ticks of a shortest run, if any."""

ALSO = {
    "never_stops": {ENDS},
    "second_try_out_of_time": {TIMES},
    "holds_too_long": {TIMES},
    "says_after_too_short_a_time": {TIMES},
}
"""Rules that a fault breaks besides the one it was planted for."""


@cache
def report(name: str) -> VerificationReport:
    leaves = load_leaves([FOLDER / "rolling.py"])
    return verify(load_mission(str(FOLDER / f"{name}.yaml"), leaves=leaves), ManualClock())


def test_every_faulty_mission_is_in_the_table() -> None:
    assert {path.stem for path in FOLDER.glob("*.yaml")} == FAULTS.keys()
    assert len(FAULTS) >= 25


@pytest.mark.parametrize("name", list(FAULTS))
def test_planted_fault_is_found_at_its_line_with_a_shortest_run(name: str) -> None:
    rule, line, message, ticks = FAULTS[name]
    (verdict,) = (each for each in report(name).verdicts if each.rule.startswith(rule))
    assert verdict.outcome == REFUTED
    (finding,) = verdict.findings
    assert finding.fault.mark.line == line
    assert message in finding.fault.message
    assert (None if finding.run is None else len(finding.run)) == ticks


@pytest.mark.parametrize("name", list(FAULTS))
def test_faulty_mission_has_no_other_findings(name: str) -> None:
    refuted = [each.rule for each in report(name).verdicts if each.outcome != PROVED]
    expected = {FAULTS[name][0], *ALSO.get(name, ())}
    assert len(refuted) == len(expected)
    assert all(any(rule.startswith(start) for start in expected) for rule in refuted)


SMALLER = {"patrol": {"rounds": "1", "corners": "2"}, "patrol_and_report": {"corners": "2"}}
"""Params of missions that go round: each further corner takes as long again and shows nothing new."""


PROVERS = ("behaviours", "config", "drivers/api", "missions/executive", "missions/language", "missions/library",
           "missions/plugins/verify")  # fmt: skip
"""What a proof depends on, beside the missions."""


@cache
def inputs() -> str:
    """Return a digest of all that proofs depend on."""
    root = Path(missions.__file__).parents[1]
    files = [path for folder in PROVERS for path in (root / folder).rglob("*") if path.suffix in {".py", ".yaml"}]
    digest = sha256(version("py_trees").encode())
    for path in sorted([*files, *shipped_missions().values(), Path(__file__)]):
        digest.update(b"%s %s" % (str(path.relative_to(root)).encode(), sha256(path.read_bytes()).digest()))
    return digest.hexdigest()


@pytest.mark.parametrize("name", list(shipped_missions()))
def test_every_shipped_mission_is_proved(name: str, request: pytest.FixtureRequest) -> None:
    """Prove it, unless pytest's cache knows that it is proved for the same missions and code."""
    cache: pytest.Cache | None = getattr(request.config, "cache", None)
    key = f"proved/{name}"
    if cache is not None and cache.get(key, "") == inputs():
        return
    proved = verify(load_mission(name, params=SMALLER.get(name, {})), ManualClock())
    assert [each for each in proved.verdicts if each.outcome != PROVED] == []
    assert proved.left_out == ""
    assert proved.states > 3
    if cache is not None:
        cache.set(key, inputs())
