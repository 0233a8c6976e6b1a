"""The record that most tests of reports read: it is made once."""

import pytest

from missions.plugins.records.recording.run_record import RunRecord, open_record
from missions.plugins.records.report.summary import RecordStudy, study_record
from tests.missions.records.report.told_record import items, write


@pytest.fixture(scope="session")
def record(tmp_path_factory: pytest.TempPathFactory) -> RunRecord:
    return open_record(write(tmp_path_factory.mktemp("records") / "m.mcap", items()))


@pytest.fixture(scope="session")
def found(record: RunRecord) -> RecordStudy:
    return study_record(record, max_pictures=3)
