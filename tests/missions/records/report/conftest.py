"""The record that most tests of reports read: it is made once."""

import pytest

from missions.plugins.records.recording.read import Record, open_record
from missions.plugins.records.report.summary import Study, study
from tests.missions.records.report.told_record import items, write


@pytest.fixture(scope="session")
def record(tmp_path_factory: pytest.TempPathFactory) -> Record:
    return open_record(write(tmp_path_factory.mktemp("records") / "m.mcap", items()))


@pytest.fixture(scope="session")
def found(record: Record) -> Study:
    return study(record, most_pictures=3)
