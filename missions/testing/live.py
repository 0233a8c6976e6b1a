"""Mishaps that are told a run while it goes on, or a storm before: the words of test files, without a file."""

from config.faults import Diagnostic, Mark, Source, one_of
from config.marked import Scalar
from missions.runner import Runner
from missions.testing.mishaps import JOINT, Mishap, read_mishap
from missions.testing.phrases import Phrase


def read_live(words: str, runner: Runner) -> Mishap:
    """Return what is to go wrong with a run. Raises ValueError, with what may have been meant."""
    faults: list[Diagnostic] = []
    phrase = Phrase(Source("", words), Scalar(Mark(1, 1, len(words)), words, words), faults)
    mishap = read_mishap(phrase, lambda _: "", runner.config.others)
    for fault in faults:
        raise ValueError(f"'{words}': {fault.message}" + (f"; {fault.suggestion}" if fault.suggestion else ""))
    section = runner.config.sections.get(mishap.part)
    joints = {} if section is None or mishap.state not in JOINT else section.keys.limits
    if mishap.state in JOINT and mishap.detail not in joints:
        raise ValueError(f"'{words}': no joint '{mishap.detail}'; {one_of(mishap.detail, joints)}")
    return mishap
