"""``mission record replay``: what it says, what it writes, and with which exit code."""

import os
import pty
import re
import select
import subprocess
import sys
from pathlib import Path

import click
import cv2
import pytest
from click.testing import CliRunner, Result

from missions.library.shipped import shipped_missions
from missions.plugins.records.commands import replay as commands
from missions.plugins.records.recording.run_record import RunRecord
from missions.plugins.records.recording.validation import InvalidRecordError
from missions.request import RunRequest
from tests.missions.records.replay.written import record_of
from tests.waiting import wait_until

GREET = shipped_missions()["greet"].read_text()

RUN = "import sys; from missions.plugins.records.commands.replay import replay as c; sys.exit(c(standalone_mode=False))"
"""The command as a process of its own."""


def replay(*arguments: object) -> Result:
    return CliRunner().invoke(commands.replay, [str(each) for each in arguments], standalone_mode=False)


def rerun(*arguments: object) -> Result:
    return CliRunner().invoke(commands.rerun, [str(each) for each in arguments], standalone_mode=False)


def refused(command: click.Command, *arguments: object) -> str:
    """Return why the command does not even begin."""
    return str(CliRunner().invoke(command, [str(each) for each in arguments]).output)


def test_an_unchanged_mission_exits_with_0(greeted: RunRecord) -> None:
    result = rerun(greeted.path)
    assert result.return_value == 0
    assert result.output == f"{len(greeted.tick_records)} ticks decided again, 15 nodes compared: no difference\n"


def test_a_changed_threshold_exits_with_1_and_names_the_place(greeted: RunRecord, tmp_path: Path) -> None:
    mission = tmp_path / "greet.yaml"
    mission.write_text(GREET.replace("within: 5 deg", "within: 2 deg"))
    result = rerun(greeted.path, "--mission", mission)
    assert result.return_value == 1
    assert re.search(r"first difference in tick \d+, at \d+\.\d+ s\n  face_centred \(1\.2\.2\.1\)", result.output)
    assert "then  greet.yaml:17  success" in result.output
    assert re.search(r"now   \S+/greet\.yaml:17  failure \(the face is .* deg off\)", result.output)
    assert "not recorded" in result.output


def test_changed_mission_file_is_named_and_the_recorded_one_available(tmp_path: Path) -> None:
    mission = tmp_path / "mine.yaml"
    mission.write_text(GREET)
    record = record_of(RunRequest(str(mission), simulate="fast", eyes="truth"), tmp_path / "mine.mcap")
    mission.write_text(GREET.replace("within: 5 deg", "within: 2 deg"))
    result = rerun(record.path)
    assert result.output.splitlines()[0] == f"{mission} has changed since the run"
    assert result.return_value == 1
    assert rerun(record.path, "--recorded").return_value == 0
    mission.unlink()
    result = rerun(record.path)
    assert result.output.splitlines()[0] == f"{mission} no longer exists"
    assert result.return_value == 0


def test_recorded_python_is_listed_and_runs_only_if_trusted(tmp_path: Path) -> None:
    mark, leaf, mission = tmp_path / "RUN", tmp_path / "mine.py", tmp_path / "mine.yaml"
    plain = "from behaviours.leaf import SUCCESS, Leaf\n\nclass Mine(Leaf):\n    tag = 'mine'\n"
    leaf.write_text(f"{plain}    def update(self):\n        return SUCCESS\n")
    mission.write_text("mission: mine\ntree: {sequence: [mine, wait: 1 s]}\n")
    order = RunRequest(str(mission), simulate="fast", eyes="truth", behaviours=[leaf])
    path = record_of(order, tmp_path / "mine.mcap").path
    size = leaf.stat().st_size
    leaf.write_text(f"open({str(mark)!r}, 'w').close()\n{leaf.read_text()}")
    said = refused(commands.rerun, path)
    assert f"holds Python code that would be run:\n  behaviours/mine.py, {size} bytes, from {leaf}\n" in said
    assert f"try: mission record export {path} --folder FOLDER" in said
    result = rerun(path, "--trust-code")
    assert f"running the Python code of {path}:\n  behaviours/mine.py, {size} bytes" in result.output
    assert result.return_value == 0
    assert not mark.exists()
    assert rerun(path, "--behaviours", leaf).return_value == 0
    assert mark.exists()


def test_rerun_without_a_recorded_reply_exits_with_2(tmp_path: Path) -> None:
    record = record_of(RunRequest("look_around", simulate="fast", eyes="truth"), tmp_path / "look_around.mcap")
    mission = tmp_path / "wave.yaml"
    mission.write_text("mission: wave\ntree:\n  sequence:\n    - gesture: hello\n")
    result = rerun(record.path, "--mission", mission)
    assert result.return_value == 2
    assert "gesture (line 4) queries arm.limits, which has no recorded reply" in result.output


def test_rerun_of_an_unrelated_mission_exits_with_2(greeted: RunRecord, tmp_path: Path) -> None:
    mission = tmp_path / "wave.yaml"
    mission.write_text("mission: wave\ntree:\n  drive: {distance: 1 m}\n")
    result = rerun(greeted.path, "--mission", mission)
    assert result.return_value == 2
    assert "nothing to compare" in result.output


def test_fault_of_the_current_mission_is_reported(greeted: RunRecord, tmp_path: Path) -> None:
    mission = tmp_path / "greet.yaml"
    mission.write_text(GREET.replace("find_face", "find_fase"))
    assert "did you mean 'find_face'?" in str(rerun(greeted.path, "--mission", mission).exception)


@pytest.mark.parametrize(
    ("command", "arguments", "words"),
    [
        (commands.replay, ["--recorded"], "No such option"),
        (commands.replay, ["--at", "12"], "has no unit"),
        (commands.replay, ["--frames", "out.mp4"], "has no pictures"),
        (commands.rerun, ["--see"], "has no pictures"),
        (commands.replay, ["--frames", "no/such/folder/out.mp4"], "no such folder"),
        (commands.replay, ["--frames", "out.gif"], "would become a folder, but ends in .gif\n  try: --frames out.webm"),
    ],
)
def test_invalid_replay_arguments_are_refused(
    command: click.Command,
    greeted: RunRecord,
    arguments: list[str],
    words: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert words in refused(command, greeted.path, *arguments)


def test_file_that_is_not_a_record_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "greet.mcap"
    path.write_text("mission: greet\n")
    with pytest.raises(InvalidRecordError, match="not a record"):
        CliRunner().invoke(commands.rerun, [str(path)], catch_exceptions=False)


def test_replay_without_terminal_prints_lines(greeted: RunRecord) -> None:
    result = replay(greeted.path, "--at", "1 s")
    assert result.return_value == 0
    assert any("✓ success  find_face" in line for line in result.output.splitlines())


def test_annotated_frames_become_a_film_of_the_same_length(pictured: RunRecord, tmp_path: Path) -> None:
    out = tmp_path / "out.webm"
    assert replay(pictured.path, "--frames", out).return_value == 0
    stamps = [stamp for stamp, _ in pictured.frames()]
    film = cv2.VideoCapture(str(out))
    try:
        count, rate = film.get(cv2.CAP_PROP_FRAME_COUNT), film.get(cv2.CAP_PROP_FPS)
        seen, picture = film.read()
    finally:
        film.release()
    assert seen
    assert count / rate == pytest.approx(stamps[-1] - stamps[0], abs=0.2)
    assert picture.shape[0] > 480  # the strip below


def test_frames_become_pictures_in_a_folder(pictured: RunRecord, tmp_path: Path) -> None:
    assert replay(pictured.path, "--frames", tmp_path / "out").return_value == 0
    assert len(list((tmp_path / "out").glob("*.jpg"))) == len(list(pictured.frames()))


def test_see_option_finds_the_recorded_percepts_again(pictured: RunRecord) -> None:
    result = rerun(pictured.path, "--see")
    assert result.return_value == 0
    assert re.search(r"\d+ pictures searched again: 1 found as before, 0 lost, 0 new\n  found  face", result.output)


def test_keys_control_replay_in_a_terminal(greeted: RunRecord) -> None:
    master, slave = pty.openpty()
    environment = {**os.environ, "TERM": "xterm", "COLUMNS": "120", "LINES": "40"}
    process = subprocess.Popen(
        [sys.executable, "-c", RUN, str(greeted.path)], stdin=slave, stdout=slave, stderr=slave, env=environment
    )
    os.close(slave)
    text = ""

    def shows(words: str) -> bool:
        nonlocal text
        while select.select([master], [], [], 0.0)[0]:
            try:
                text += os.read(master, 4096).decode(errors="replace")
            except OSError:  # it has ended
                break
        return words in text

    try:
        wait_until(lambda: shows("find_face"))
        os.write(master, b"/")
        wait_until(lambda: shows("search: _"))
        os.write(master, b"gesture\r")
        wait_until(lambda: shows("gesture: ${gesture}"))
        os.write(master, b"q")
        wait_until(lambda: not shows("no such words") and process.poll() is not None)
        assert process.returncode == 0
    finally:
        process.kill()
        process.wait()
        os.close(master)
