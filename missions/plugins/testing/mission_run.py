"""Runs a mission from a Python test in simulated time, and returns its events."""

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from config.cases import Eyes
from config.diagnostics import SourceText
from config.fields import Fields
from config.yaml_nodes import compose
from drivers.api import Pose2D
from missions.executive.events import Event
from missions.plugins.testing.case_history import CaseHistory, NodeRecord
from missions.plugins.testing.case_runner import IN_PROCESS_LIMITS, CaseRunner
from missions.plugins.testing.suite import read_suite

GivenItem = str | Mapping[str, object]
"""A fault or a mock as in a test file: ``"arm unplugged at 3 s"``, ``{"gesture": "fails twice"}``."""


@dataclass(frozen=True, slots=True)
class MissionRun:
    """A finished run of a mission: its result, its duration in simulated ``seconds``, and its events.

    ``said`` are the robot's utterances, ``pose`` the true final pose of its base (in the world frame; None without a
    base), ``returns`` the mission's results, ``nodes`` the record of each node.
    """

    result: str
    reason: str
    seconds: float
    events: Sequence[Event]
    said: Sequence[str]
    pose: Pose2D | None
    returns: Mapping[str, object]
    nodes: Sequence[NodeRecord]
    history: CaseHistory

    def starts(self, name: str) -> int:
        """Return how often nodes started that have ``name`` as their name or as their word, such as ``drive``."""
        return self.history.starts(name)

    def ends(self, name: str) -> list[str]:
        """Return the ends, in order, of nodes that have ``name`` as their name or word: success or failure."""
        words = {"succeeds": "success", "fails": "failure"}
        found = [each for each in self.history.observed_events if name in each.names]
        return [words[each.verb] for each in found if each.verb in words]


def run_mission(
    mission: str | Path,
    *,
    params: Mapping[str, object] | None = None,
    robot: str | Path | None = None,
    world: str | Path | None = None,
    seed: int = 0,
    eyes: Eyes = "pixels",
    physics: bool = False,
    timeout: str = "120 s",
    given: Iterable[GivenItem] = (),
    behaviours: Iterable[str | Path] = (),
) -> MissionRun:
    """Run a mission on twins as fast as the machine allows, and return the finished run.

    All values are written as in a test file; paths are relative to the working directory. A run is interrupted after
    ``timeout`` of simulated time. Raises InvalidFileError with all errors in the arguments.
    """
    case: dict[str, object] = {
        "case": "run_mission",
        "params": {name: _text(value) for name, value in (params or {}).items()},
        "seed": seed,
        "eyes": eyes,
        "physics": physics,
        "timeout": timeout,
        "given": list(given),
    }
    case |= {key: str(value) for key, value in (("robot", robot), ("world", world)) if value is not None}
    suite = {"tests": str(mission), "behaviours": [str(file) for file in behaviours], "cases": [case]}
    # JSON is YAML: so Python and files go one way, and have the same mistakes explained.
    source = SourceText(f"run_mission('{mission}')", json.dumps(suite, indent=1, ensure_ascii=False))
    fields = Fields(source, compose(source), [], subject="run_mission")
    (read,) = read_suite(fields, Path(), with_expectations=False)
    stage = CaseRunner(read, IN_PROCESS_LIMITS)
    runner = stage.run()
    history = stage.history
    result = history.result
    return MissionRun(
        "error" if result is None else result.result,
        "" if result is None else result.reason,
        0.0 if result is None else result.seconds,
        history.events,
        history.said,
        history.pose,
        history.returns,
        history.nodes(runner.root, runner.plan.tree),
        history,
    )


def _text(value: object) -> str:
    """Return the value of a param as a mission file would write it."""
    return str(value).lower() if isinstance(value, bool) else str(value)
