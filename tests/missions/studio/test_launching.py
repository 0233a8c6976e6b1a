"""A run that the studio starts and that cannot begin, or not as it should, says why as on the command line."""

import resource
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from missions.plugins.records.retention import list_records, records_folder
from tests.missions.studio.running import run_of
from tests.missions.studio.serving import Client, Served, studio

SHORT = "mission: short\ntree:\n  succeed:\n"


@pytest.fixture
def served(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Served]:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "short.yaml").write_text(SHORT, encoding="utf-8")
    with studio() as found:
        yield found


def ended(client: Client, run: str) -> str:
    """Watch a run until it is over, or is not there any more, and return its result and the reason."""
    told = client.ask("watch", run=run)
    if "message" in told:
        return str(told["message"])
    over = client.hear(lambda each: each["say"] == "over")
    return f"{over['result']} {over['reason']}"


def test_run_is_recorded_or_continues_with_a_warning(served: Served) -> None:
    with served.client(served.operator) as client:

        def said_at_its_start() -> str:
            answer = client.ask("start", mission="short.yaml", simulate="fast")
            assert "result" in answer, answer
            told = answer["result"]
            why = ended(client, told["run"])
            assert "success" in why, (why, told)
            return str(told["message"])

        assert said_at_its_start() == ""
        (record,) = list_records(records_folder())
        assert record.name.startswith("short-")
        process = served.process.process.pid
        before = resource.prlimit(process, resource.RLIMIT_FSIZE)
        resource.prlimit(process, resource.RLIMIT_FSIZE, (3000, before[1]))  # as on a disk that is full
        assert "mission: not recorded: " in (said := said_at_its_start())
        assert "File too large" in said
        resource.prlimit(process, resource.RLIMIT_FSIZE, before)
        shutil.rmtree(records_folder())
        records_folder().write_bytes(b"in the place of the folder")
        assert said_at_its_start() == f"mission: not recorded: {records_folder()}: File exists"


def test_robot_in_use_is_reported_with_the_other_process(served: Served, tmp_path: Path) -> None:
    with run_of(tmp_path) as (first, base), served.client(served.operator) as client:
        port = f"port: {base.port}"
        (tmp_path / "mine.yaml").write_text(f"robot: mine\nbase:\n  driver: kobuki\n  {port}\n", encoding="utf-8")
        told = client.ask("start", mission="mission.yaml", robot="mine.yaml", sure=True)
        why = told.get("message") or ended(client, told["result"]["run"])
        assert base.port in why
        assert str(first.process.pid) in why
