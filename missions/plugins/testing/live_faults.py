"""Fault injection into a run in simulated time, in the words of test files."""

import shlex
from collections.abc import Callable, Iterator, Mapping
from functools import partial

from config.diagnostics import Diagnostic, Mark, SourceText, suggest_from
from config.yaml_nodes import Scalar
from missions.control.commands import BadMessage
from missions.plugins.testing.case_history import CaseHistory
from missions.plugins.testing.fault_injector import FaultInjector
from missions.plugins.testing.fault_specs import (
    FAULT_STATES,
    JOINT_STATES,
    RUN,
    TEMPORARY_STATES,
    UNPLUGGED,
    FaultSpec,
    read_fault,
)
from missions.plugins.testing.phrases import Phrase
from missions.request import RunRequest
from missions.runner import Runner

# Faults injected into a live run, in the words of test files.

STATE_EXAMPLES = {
    "bumped": "bumped left", "cliff": "cliff centre", "battery": "battery at 5 %", "button": "button 0 pressed",
    "drifting": "drifting at 2 deg/s", "late": "late by 0.5 s",
    "turned": "turned {joint} to 30 deg", "pushed": "pushed {joint} to 30 deg",
}  # fmt: skip
"""Examples of the fault states that need a detail."""


def read_live_fault(words: str, runner: Runner) -> FaultSpec:
    """Return the fault to inject into a run. Raises ValueError, with a suggestion."""
    faults: list[Diagnostic] = []
    phrase = Phrase(SourceText("", words), Scalar(Mark(1, 1, len(words)), words, words), faults)
    mishap = read_fault(phrase, lambda _: "", runner.config.extra_parts)
    for fault in faults:
        raise ValueError(f"'{words}': {fault.message}" + (f"; {fault.suggestion}" if fault.suggestion else ""))
    section = runner.config.sections.get(mishap.part)
    joints = {} if section is None or not mishap.detail else getattr(section.keys, "limits", {})
    if mishap.is_joint_fault and mishap.detail not in joints:
        raise ValueError(f"'{words}': no joint '{mishap.detail}'; {suggest_from(mishap.detail, joints)}")
    return mishap


def examples(runner: Runner) -> Iterator[str]:
    """Yield an example of each possible fault of the parts that a run uses; none outside simulated time."""
    for part in () if runner.twins is None else (*runner.twins.parts, RUN):
        section = runner.config.sections.get(part)
        joints = tuple(getattr(section.keys, "limits", ())) if section is not None else ()
        kind = runner.config.extra_parts.get(part, part)
        for state in FAULT_STATES.get(kind, UNPLUGGED):
            one = kind == "arm" and state in JOINT_STATES
            if one and not joints:
                continue
            words = STATE_EXAMPLES.get(state, f"{state} {{joint}}" if one else state).format(
                joint=joints[0] if joints else ""
            )
            yield f"{part} {words}" + (" 2 s" if state in TEMPORARY_STATES else "")


def simulated_command(request: RunRequest) -> str:
    """Return the command that runs the same mission on the same robot in simulated time, where faults work."""
    robot = [] if request.robot is None else ["--robot", request.robot]
    params = (word for name, value in request.params.items() for word in ("--param", f"{name}={value}"))
    return shlex.join(["mission", "run", request.mission, *robot, *params, "--simulate", "fast", "--speed", "1"])


class LiveFaults:
    """Injects faults into the simulated devices of a ``runner``, in the words of test files. Thread-safe.

    ``in_world`` calls a function on the thread of the simulated world.
    """

    def __init__(self, runner: Runner, in_world: Callable[[Callable[[], None]], None]) -> None:
        self._runner, self._in_world = runner, in_world
        self._injector: FaultInjector | None = None

    def examples_answer(self) -> Mapping[str, object]:
        """Return the answer to the command `faulty`: examples of faults that can be injected into this run.

        Outside simulated time, also return the command that runs the same mission in simulated time.
        """
        found = {"examples": list(examples(self._runner))}
        return found if self._runner.twins else {**found, "command": simulated_command(self._runner.request)}

    def inject(self, words: str) -> None:
        """Inject a fault. Raises BadMessage for invalid words, and for faults that this run does not support."""
        twins, mission = self._runner.twins, self._runner.plan.mission
        if twins is None:
            what = f"'{words}' is unsupported: '{mission}' does not run in simulated time"
            raise BadMessage("unsupported", what, simulated_command(self._runner.request))
        try:
            mishap = read_live_fault(words, self._runner)
        except ValueError as error:
            raise BadMessage("bad_field", str(error)) from error
        if mishap.part not in {*twins.parts, "run"}:
            uses = ", ".join(sorted(twins.parts)) or "no part"
            raise BadMessage("unsupported", f"'{words}' is unsupported: '{mission}' uses {uses}")
        self._in_world(partial(self._schedule, mishap))

    def _schedule(self, mishap: FaultSpec) -> None:
        self._injector = self._injector or FaultInjector(self._runner, CaseHistory())
        self._injector.schedule([mishap])
