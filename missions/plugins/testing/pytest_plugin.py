"""Pytest plugin: collects mission tests, and offers fixtures for Python tests.

Pytest loads this module wherever MissionTree is installed. So it imports other modules only when they are used.
"""

import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from drivers.clock import ManualClock
    from drivers.sim.world import SimulatedWorld
    from missions.plugins.testing.case_verdict import CaseVerdict
    from missions.plugins.testing.mission_run import MissionRun
    from missions.plugins.testing.recorders import LeafTestBench
    from missions.plugins.testing.suite import Case

TESTS = ".test.yaml"
_BEGINS = re.compile(r"^(tests|cases)[ \t]*:", re.MULTILINE)


def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> "MissionFile | None":
    """Collect mission test files; ignore files of other tools with the same suffix."""
    if not file_path.name.endswith(TESTS):
        return None
    if _BEGINS.search(file_path.read_text(encoding="utf-8", errors="replace")) is None:
        return None
    found: MissionFile = MissionFile.from_parent(parent, path=file_path)
    return found


class MissionFile(pytest.File):
    """Test file of a mission."""

    def collect(self) -> Iterator["MissionCase"]:
        """Read the cases; an error in the file is a collection error."""
        from config.diagnostics import InvalidFileError  # noqa: PLC0415 - see the head of this module
        from missions.plugins.testing.suite import load_suite  # noqa: PLC0415

        try:
            cases = load_suite(self.path)
        except InvalidFileError as error:
            raise self.CollectError(str(error)) from None
        for case in cases:
            yield MissionCase.from_parent(self, name=case.title, case=case)


class MissionCase(pytest.Item):
    """Case of a test file, run in this process."""

    def __init__(self, *, case: "Case", **others: Any) -> None:
        super().__init__(**others)
        self.case = case

    def runtest(self) -> None:
        """Run the case. Raises MissionFailed if an expectation is not met."""
        from missions.plugins.testing.case_runner import IN_PROCESS_LIMITS  # noqa: PLC0415
        from missions.plugins.testing.case_verdict import play  # noqa: PLC0415

        verdict = play(self.case, limits=IN_PROCESS_LIMITS)
        if not verdict.passed:
            raise MissionFailed(verdict)

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: Any = None) -> Any:
        """Return the unmet expectations and the last events instead of a traceback."""
        from missions.plugins.testing.report import failure_text  # noqa: PLC0415

        if isinstance(excinfo.value, MissionFailed):
            return failure_text(excinfo.value.verdict)
        return super().repr_failure(excinfo, style)

    def reportinfo(self) -> tuple[Path, int, str]:
        """Return the file, the line (from 0) and the title of the case, for pytest's reports."""
        return self.path, self.case.mark.line - 1, self.case.title


class MissionFailed(Exception):
    """Failure of a case; ``verdict`` has the unmet expectations."""

    def __init__(self, verdict: "CaseVerdict") -> None:
        super().__init__(str(verdict.case))
        self.verdict = verdict


@pytest.fixture
def clock() -> "ManualClock":
    """Clock that stands still until the test advances it."""
    from drivers.clock import ManualClock  # noqa: PLC0415

    return ManualClock()


@pytest.fixture
def robot(clock: "ManualClock") -> "LeafTestBench":
    """Robot that records its commands: ``robot.put`` prepares and ``robot.tick`` ticks a leaf.

    Then ``robot.base.commands == [drive(0.2, 0.0), STOP]`` (see missions.plugins.testing.recorders).
    """
    from missions.plugins.testing.recorders import LeafTestBench  # noqa: PLC0415

    return LeafTestBench(clock)


@pytest.fixture
def world() -> "Callable[[str], SimulatedWorld]":
    """Function that loads simulated worlds by name or file: ``world("living_room")``."""
    from config.library import find_file  # noqa: PLC0415
    from config.world import load_world  # noqa: PLC0415
    from missions.library.worlds import build_world  # noqa: PLC0415

    return lambda name: build_world(load_world(find_file("worlds", name)))


@pytest.fixture
def run_mission() -> "Callable[..., MissionRun]":
    """Function that runs missions in simulated time: ``run_mission("greet", given=["arm unplugged at 3 s"])``.

    It is ``missions.plugins.testing.mission_run.run_mission``.
    """
    from missions.plugins.testing.mission_run import run_mission as run  # noqa: PLC0415

    return run
