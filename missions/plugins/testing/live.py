"""Mishaps that are told a run while it goes on: the words of test files, without a file."""

from collections.abc import Iterator

from config.faults import Diagnostic, Mark, Source, one_of
from config.marked import Scalar
from missions.plugins.testing.mishaps import JOINT, PASSING, RUN, STATES, UNPLUGGED, Mishap, read_mishap
from missions.plugins.testing.phrases import Phrase
from missions.runner import Runner

DETAILS = {
    "bumped": "bumped left", "cliff": "cliff centre", "battery": "battery at 5 %", "button": "button 0 pressed",
    "drifting": "drifting at 2 deg/s", "late": "late by 0.5 s",
    "turned": "turned {joint} to 30 deg", "pushed": "pushed {joint} to 30 deg",
}  # fmt: skip
"""Examples of the states that say more than their word."""


def read_live(words: str, runner: Runner) -> Mishap:
    """Return what is to go wrong with a run. Raises ValueError, with what may have been meant."""
    faults: list[Diagnostic] = []
    phrase = Phrase(Source("", words), Scalar(Mark(1, 1, len(words)), words, words), faults)
    mishap = read_mishap(phrase, lambda _: "", runner.config.others)
    for fault in faults:
        raise ValueError(f"'{words}': {fault.message}" + (f"; {fault.suggestion}" if fault.suggestion else ""))
    section = runner.config.sections.get(mishap.part)
    joints = {} if section is None or not mishap.detail else getattr(section.keys, "limits", {})
    if mishap.of_joint and mishap.detail not in joints:
        raise ValueError(f"'{words}': no joint '{mishap.detail}'; {one_of(mishap.detail, joints)}")
    return mishap


def examples(runner: Runner) -> Iterator[str]:
    """Yield the words of each thing that can go wrong with the parts that a run uses; none but in simulated time."""
    for part in () if runner.twins is None else (*runner.twins.parts, RUN):
        section = runner.config.sections.get(part)
        joints = tuple(getattr(section.keys, "limits", ())) if section is not None else ()
        kind = runner.config.others.get(part, part)
        for state in STATES.get(kind, UNPLUGGED):
            one = kind == "arm" and state in JOINT
            if one and not joints:
                continue
            words = DETAILS.get(state, f"{state} {{joint}}" if one else state).format(joint=joints[0] if joints else "")
            yield f"{part} {words}" + (" 2 s" if state in PASSING else "")
