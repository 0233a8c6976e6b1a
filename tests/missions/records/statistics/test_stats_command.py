import csv
import io
import json
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from missions.plugins.records.commands.stats import stats as command
from tests.missions.records.recording.small_record import items, write


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return write(tmp_path / "greet.mcap", items())


def run(*arguments: object) -> Result:
    return CliRunner().invoke(command, [str(each) for each in arguments], standalone_mode=False)


def test_stats_command_prints_nodes_and_durations(path: Path) -> None:
    result = run(path)
    lines = result.output.splitlines()
    assert result.return_value == 0
    assert lines[:2] == ["greet on turtlebot2, simulated (fast): 1 record (1 success)", "4.0 s, 80 ticks"]
    assert lines[3].startswith("node        line  ticks")
    assert lines[4].split() == ["sequence", "3", "80", "1", "1", "0", "0", "3.95", "3.95", "3.95"]
    assert lines[5].split() == ["look_for", "4", "51", "2", "1", "1", "0", "2.45", "1.23", "2.33"]
    assert ["tick:", "at", "work", "80", "0.10", "0.10", "0.10", "0.10"] in [line.split() for line in lines]


def test_several_records_are_one_table(path: Path, tmp_path: Path) -> None:
    other = write(tmp_path / "again.mcap", items()[:-1])
    assert "2 records (2 success)\n8.0 s, 160 ticks\n" in run(path, other).output


def test_json_has_everything_in_seconds(path: Path) -> None:
    (found,) = json.loads(run(path, path, "--json").output)
    assert (found["mission"], found["robot"], found["records"], found["ticks"]) == ("greet", "turtlebot2", 2, 160)
    assert found["results"] == {"success": 2}
    assert [(node["key"], node["title"], node["runs"]) for node in found["nodes"]] == [
        ("1", "sequence", 2),
        ("1.1", "look_for", 4),
    ]
    assert found["nodes"][0]["lasted"]["longest"] == pytest.approx(3.95)
    assert found["delays"]["tick: at work"]["count"] == 160


def test_csv_is_a_line_for_each_node(path: Path) -> None:
    rows = list(csv.DictReader(io.StringIO(run(path, "--csv").output)))
    assert [(row["mission"], row["key"], row["node"], row["line"], row["failure"]) for row in rows] == [
        ("greet", "1", "sequence", "3", "0"),
        ("greet", "1.1", "look_for", "4", "1"),
    ]
    assert float(rows[0]["seconds"]) == pytest.approx(3.95)


def test_file_that_is_not_a_record_is_reported_and_skipped(path: Path, tmp_path: Path) -> None:
    broken = tmp_path / "notes.txt"
    broken.write_text("hello")
    result = run(broken, path)
    assert result.return_value == 2
    assert f"mission: {broken}: not a record" in result.stderr
    assert "1 record (1 success)" in result.stdout
