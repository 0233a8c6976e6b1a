"""The records that these tests read: each is made once."""

import pytest

from missions.executive.tick_record import TickRecord
from missions.plugins.records.recording.run_record import RunRecord
from missions.request import RunRequest
from missions.runner import Runner
from tests.missions.records.replay.written import record_of

ENOUGH = 4.5
"""Seconds of a run with pictures, which take long to draw."""


@pytest.fixture(scope="session")
def greeted(tmp_path_factory: pytest.TempPathFactory) -> RunRecord:
    """A run of greet that has gone well, without pictures."""
    path = tmp_path_factory.mktemp("records") / "greeted.mcap"
    return record_of(RunRequest("greet", simulate="fast", eyes="truth"), path)


@pytest.fixture(scope="session")
def alone(tmp_path_factory: pytest.TempPathFactory) -> RunRecord:
    """A run of greet that has failed: nobody was there."""
    path = tmp_path_factory.mktemp("records") / "alone.mcap"
    return record_of(RunRequest("greet", {"patience": "2 s"}, simulate="fast", world="empty", eyes="truth"), path)


@pytest.fixture(scope="session")
def pictured(tmp_path_factory: pytest.TempPathFactory) -> RunRecord:
    """A run of greet with pictures, which was stopped while it looked at somebody."""

    def stop(runner: Runner, moment: TickRecord) -> None:
        if moment.t >= ENOUGH:
            runner.executive.stop("enough")

    return record_of(
        RunRequest("greet", simulate="fast"), tmp_path_factory.mktemp("records") / "pictured.mcap", act=stop
    )
