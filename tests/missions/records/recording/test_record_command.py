import csv
import json
from collections.abc import Iterator
from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from mcap.reader import make_reader

from missions.executive.events import Logged
from missions.plugins.records.commands.record import command
from missions.plugins.records.recording.info import record_lines
from missions.plugins.records.recording.run_record import open_record
from tests.missions.records.recording.small_record import FILES, JPEG, TREE, items, moments, write


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return write(tmp_path / "greet.mcap", items())


def run(*arguments: object) -> Result:
    return CliRunner().invoke(command, [str(each) for each in arguments])


def facts(output: str) -> dict[str, str]:
    """Return the first lines of what ``info`` says, by name."""
    return {line[:10].strip(): line[10:] for line in output.partition("\n\n")[0].splitlines()}


def test_info_shows_the_run_and_the_losses(path: Path) -> None:
    result = run("info", path)
    told = facts(result.output)
    assert result.exit_code == 0
    assert told["mission"] == "greet (mission/greet.yaml)"
    assert told["robot"] == "turtlebot2"
    assert told["world"] == "living_room, simulated (fast)"
    assert told["result"] == "success after 4.00 s"
    assert told["length"] == "4.00 s, 80 ticks"
    assert told["closed"] == "yes"
    assert told["lost"] == "3 messages: 3 on /camera"
    assert "damaged" not in told
    assert "mission/greet.yaml      15 bytes" in result.output
    assert f"mission show {path} --at 2.500s    the first failure of a node" in result.output


def test_info_counts_as_an_independent_reader_does(path: Path) -> None:
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    assert summary.statistics is not None
    counts = {
        summary.channels[number].topic: count for number, count in summary.statistics.channel_message_counts.items()
    }
    lines = [line.split() for line in record_lines(open_record(path))]
    assert {line[0]: int(line[1]) for line in lines if line and line[0].startswith("/")} == counts


def test_info_suggests_repair_of_an_unclosed_record(tmp_path: Path) -> None:
    path = write(tmp_path / "killed.mcap", items()[:-1], close=False)
    path.write_bytes(path.read_bytes()[:-1000])
    told = run("info", path).output
    assert "closed    no: complete up to " in told
    assert f"mission record repair {path}" in told
    mended = run("repair", path)
    assert mended.exit_code == 0
    assert mended.output.startswith(f"repaired {path}: complete up to ")
    assert "closed    yes" in run("info", path).output
    assert run("repair", path).output == f"{path} is closed already: nothing to repair\n"


def test_info_reports_damaged_ranges(path: Path) -> None:
    chunk = open_record(path).container.chunk_spans[5]
    with path.open("r+b") as file:
        file.seek(chunk.end - 40)
        file.write(bytes(20))
    assert "damaged   1 range of the file unreadable" in run("info", path).output


@pytest.mark.parametrize(
    "arguments", [("info",), ("repair",), ("export", "--jsonl", "x.jsonl"), ("cut", "1s", "2s", "-o", "x")]
)
def test_every_record_command_refuses_other_files(tmp_path: Path, arguments: tuple[str, ...]) -> None:
    text = tmp_path / "notes.txt"
    text.write_text("hello")
    name, *rest = arguments
    result = run(name, text, *rest)
    assert result.exit_code != 0
    assert result.output == f"Error: {text}: not a record: not an MCAP file\n"
    assert [each.name for each in tmp_path.iterdir()] == ["notes.txt"]


def rows(path: Path) -> Iterator[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        yield from csv.DictReader(file)


def test_tables_have_a_column_for_each_member_and_the_time_first(path: Path, tmp_path: Path) -> None:
    assert run("export", path, "--csv", tmp_path / "tables").exit_code == 0
    nodes = list(rows(tmp_path / "tables" / "nodes.csv"))
    assert [(row["t"], row["node"], row["status"]) for row in nodes][2] == ("2.5", "1.1", "failure")
    poses = list(rows(tmp_path / "tables" / "base_pose.csv"))
    assert float(poses[-1]["pose.position.x"]) == pytest.approx(0.4)
    assert next(iter(poses[0])) == "t"
    assert not (tmp_path / "tables" / "camera.csv").exists()
    assert list(next(rows(tmp_path / "tables" / "moments.csv"))) == ["t", "kind", "tick", "late", "spent", "overheld"]


@pytest.mark.parametrize("option", ["--csv", "--folder"])
def test_a_folder_is_not_called_as_a_file_is(option: str, path: Path, tmp_path: Path) -> None:
    result = run("export", path, option, tmp_path / "a.csv")
    assert result.exit_code == 2
    assert f"would become a folder, but ends in .csv\n  try: {option} {tmp_path / 'a'}" in result.output
    assert not (tmp_path / "a.csv").exists()
    (tmp_path / "a.csv").mkdir()  # somebody wants it so
    assert run("export", path, option, tmp_path / "a.csv").exit_code == 0


def test_lines_hold_every_message(path: Path, tmp_path: Path) -> None:
    assert run("export", path, "--jsonl", tmp_path / "all.jsonl").exit_code == 0
    lines = [json.loads(line) for line in (tmp_path / "all.jsonl").read_text().splitlines()]
    assert len(lines) == sum(1 for _ in open_record(path).container.messages())
    assert lines[0]["topic"] == "/mission"
    assert [line["t"] for line in lines if line["topic"] == "/moments"] == [moment.t for moment in moments()]


def test_lone_surrogates_are_exported_as_json_escapes(tmp_path: Path) -> None:
    path = write(tmp_path / "odd.mcap", [Logged(0.1, "voice", "half \ud800 a letter")])
    assert run("export", path, "--jsonl", tmp_path / "all.jsonl", "--csv", tmp_path / "tables").exit_code == 0
    lines = [json.loads(line) for line in (tmp_path / "all.jsonl").read_text(encoding="utf-8").splitlines()]
    assert [line["message"]["message"] for line in lines if line["topic"] == "/log"] == ["half \ud800 a letter"]
    assert [row["message"] for row in rows(tmp_path / "tables" / "log.csv")] == ["half \\ud800 a letter"]


def test_a_folder_holds_pictures_files_and_tables(path: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert (
        run("export", path, "--folder", out).output
        == f"wrote 4 pictures, 3 files and 15 tables to {out} (only you can read it)\n"
    )
    assert (out / "pictures" / "000002.000.jpg").read_bytes() == JPEG
    assert {name: (out / "files" / name).read_bytes() for name in FILES} == FILES
    assert (out / "tables" / "nodes.csv").exists()


def test_no_name_in_a_record_leads_out_of_the_folder(
    path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(FILES, "../../outside", b"1")
    monkeypatch.setitem(FILES, "/absolute", b"2")
    monkeypatch.setitem(FILES, "..", b"3")
    write(path, items())
    assert run("export", path, "--folder", tmp_path / "a" / "b").exit_code == 0
    small = [each for each in tmp_path.rglob("*") if each.is_file() and each.stat().st_size == 1]
    names = {str(each.relative_to(tmp_path)) for each in small}
    assert names == {"a/b/files/outside", "a/b/files/absolute", "a/b/files/unnamed"}


def test_nothing_is_written_over_without_force(path: Path, tmp_path: Path) -> None:
    (tmp_path / "full").mkdir()
    there = tmp_path / "full" / "there.txt"
    there.write_text("mine")
    for arguments in (("export", path, "--jsonl", there), ("cut", path, "1s", "2s", "-o", there)):
        result = run(*arguments)
        assert (result.exit_code, there.read_text()) == (1, "mine")
        assert "already exists\n  try: another name, or --force to overwrite it" in result.output
    assert "is not empty" in run("export", path, "--csv", tmp_path / "full").output
    assert "is not empty" in run("export", path, "--folder", tmp_path / "full").output
    assert run("export", path, "--jsonl", there, "--force").exit_code == 0
    assert there.read_text() != "mine"
    assert [each.name for each in (tmp_path / "full").iterdir()] == ["there.txt"]


def test_export_without_a_format_lists_the_formats(path: Path) -> None:
    assert f"mission record export {path} --csv tables" in run("export", path).output


def test_cut_record_begins_with_the_state_at_its_start(path: Path, tmp_path: Path) -> None:
    out = tmp_path / "piece.mcap"
    assert run("cut", path, "2.6 s", "3.5s", "-o", out).exit_code == 0
    piece = open_record(out)
    assert (piece.is_complete, piece.cut_start, piece.end_time) == (True, 2.6, 3.5)
    assert piece.drawing() == TREE
    assert [repr(moment) for moment in piece.tick_records] == [repr(each) for each in moments() if 2.6 <= each.t <= 3.5]
    assert {key: change.status for key, change in piece.statuses(2.6).items()} == {"1": "running", "1.1": "failure"}
    assert [stamp for stamp, _ in piece.frames()] == [3.0]
    assert piece.run_end() is None
    told = facts(run("info", out).output)
    assert told["result"] == "not recorded: this record was cut"
    assert told["length"] == "0.90 s, cut at 2.6 s, 19 ticks"
    with out.open("rb") as file:
        first = min(
            message.log_time for _, channel, message in make_reader(file).iter_messages() if channel.topic != "/mission"
        )
    with path.open("rb") as file:
        began = min(message.log_time for _, _, message in make_reader(file).iter_messages())
    assert (first - began) / 1e9 == pytest.approx(2.6)


def test_record_cut_from_its_start_can_be_rerun(path: Path, tmp_path: Path) -> None:
    run("cut", path, "0s", "1s", "-o", tmp_path / "piece.mcap")
    assert open_record(tmp_path / "piece.mcap").cut_start is None


@pytest.mark.parametrize(
    ("start", "end", "words"),
    [
        ("3s", "2s", "the range ends before it begins: from 3 s to 2 s"),
        ("5s", "6s", "ends at 4.00 s, before 5 s"),
        ("1", "2s", "'1' has no unit (units: s, ms, min, h)"),
    ],
)
def test_invalid_cut_range_is_refused(path: Path, start: str, end: str, words: str) -> None:
    result = run("cut", path, start, end, "-o", path.with_name("piece.mcap"))
    assert result.exit_code == 2
    assert words in result.output


def test_record_is_not_cut_into_itself(path: Path) -> None:
    before = path.read_bytes()
    assert "is the record itself" in run("cut", path, "1s", "2s", "-o", path, "--force").output
    assert path.read_bytes() == before
