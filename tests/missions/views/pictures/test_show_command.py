"""``mission show``: every format, to a file and to the terminal; moments of records; differences; what is wrong."""

import json
import sys
from pathlib import Path

import pytest

from missions.cli.show import FORM_OF_SUFFIX, TREE_FORMS
from missions.executive.events import NodeChanged
from missions.library.shipped import load_mission
from missions.plugins.pictures.forms import PAIR_FORMS
from missions.plugins.records.recording.items import pack_items, unpack_items
from missions.plugins.records.recording.record_header import RecordContents, RecordHeader
from missions.plugins.records.recording.writer import ChunkSink, RecordWriter
from missions.trees.drawing import to_json
from missions.trees.drawing_builder import drawing_of
from tests.cases import each
from tests.missions.command import Outcome, command

HEAD = RecordHeader(
    "greet",
    "mission/greet.yaml",
    "turtlebot2",
    "living_room",
    {},
    0,
    "fast",
    "truth",
    20.0,
    "2026-11-21T14:03:00+00:00",
    ("mission", "run", "greet"),
    ("head", "camera"),
    {"missiontree": "0.1.0"},
)


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def show(capsys: pytest.CaptureFixture[str]) -> "Show":
    return Show(capsys)


class Show:
    """Runs ``mission show``."""

    def __init__(self, capsys: pytest.CaptureFixture[str]) -> None:
        self._capsys = capsys

    def __call__(self, *arguments: str) -> Outcome:
        return command(self._capsys, "show", *arguments)


@pytest.fixture
def record(folder: Path) -> Path:
    """A record of greet that looks for a face from 1 s on, and finds none at 4 s."""
    path = folder / "run.mcap"
    tree = json.dumps(to_json(drawing_of(load_mission("greet")))).encode()
    changes = [
        NodeChanged(1.0, 1, "1", "sequence", "sequence", 10, "running", ""),
        NodeChanged(1.0, 1, "1.1.1", "find_face", "find_face", 11, "running", "looking"),
        NodeChanged(4.0, 60, "1.1.1", "find_face", "find_face", 11, "failure", "no face found"),
        NodeChanged(4.0, 60, "1", "sequence", "sequence", 10, "failure", ""),
    ]
    with path.open("wb", buffering=0) as file:
        writer = RecordWriter(
            ChunkSink(file.fileno()), RecordContents(HEAD, {"mission/greet.yaml": b"mission: greet\n"}, tree)
        )
        writer.begin()
        for change in unpack_items(pack_items(changes)):
            writer.add(change)
        assert writer.close().counts["/nodes"] == len(changes)
    return path


@each("suffix", list(FORM_OF_SUFFIX))
def test_file_name_ending_selects_the_format(suffix: str, show: Show) -> None:
    outcome = show("greet", "-o", f"it{suffix}")
    assert outcome.code == 0, outcome.err
    assert outcome.err == f"wrote it{suffix}\n"
    dumped = TREE_FORMS[FORM_OF_SUFFIX[suffix]](drawing_of(load_mission("greet")))
    assert Path(f"it{suffix}").read_bytes() == (dumped if isinstance(dumped, bytes) else dumped.encode())


@each("form", [form for form in TREE_FORMS if form != "png"])
def test_texts_go_to_stdout(form: str, show: Show) -> None:
    outcome = show("greet", "--format", form)
    assert (outcome.code, outcome.err) == (0, "")
    assert "find_face" in outcome.out
    assert outcome.out.endswith("\n")
    assert not outcome.out.endswith("\n\n")


def test_text_is_the_default_format(show: Show) -> None:
    assert show("greet").out == show("greet", "--format", "text").out
    assert show("greet").out.startswith("→ sequence (line ")


def test_terminal_output_has_mission_and_time_of_a_moment(record: Path, show: Show) -> None:
    assert show(record.name, "--at", "4 s").out.startswith("greet at 4.00 s\n→ ✗ sequence (line ")


def test_the_format_is_stronger_than_the_name_of_the_file(show: Show) -> None:
    assert show("greet", "--format", "json", "-o", "tree.txt").code == 0
    assert json.loads(Path("tree.txt").read_text(encoding="utf-8"))["mission"] == "greet"


def test_a_terminal_is_not_given_bytes(show: Show, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(type(sys.stdout), "isatty", lambda _: True)
    outcome = show("greet", "--format", "png")
    assert outcome.code == 2
    assert outcome.out == ""
    assert "try: -o greet.png" in outcome.err


def test_record_shows_its_mission_as_recorded(record: Path, show: Show) -> None:
    assert show(record.name).out == show("greet").out


@each(
    ("time", "root", "leaf", "reason"),
    [
        ("0.5 s", "idle", "idle", ""),
        ("1s", "running", "running", "looking"),
        ("3999 ms", "running", "running", "looking"),
        ("4 s", "failure", "failure", "no face found"),
    ],
)
def test_moment_includes_all_events_up_to_its_time(
    time: str, root: str, leaf: str, reason: str, record: Path, show: Show
) -> None:
    outcome = show(record.name, "--at", time, "--format", "json")
    assert outcome.code == 0, outcome.err
    tree = json.loads(outcome.out)["tree"]
    found = tree["children"][0]
    assert (tree["status"], found["status"], found["reason"]) == (root, leaf, reason)


def test_time_after_the_end_shows_the_end_with_a_warning(record: Path, show: Show) -> None:
    outcome = show(record.name, "--at", "1 min", "--format", "svg")
    assert outcome.code == 0
    assert "run.mcap ends at 4.00 s" in outcome.err
    assert "at 4.00 s</text>" in outcome.out
    assert "✗" in outcome.out


def test_moment_of_a_mission_is_refused_with_a_record_hint(show: Show) -> None:
    outcome = show("greet", "--at", "3 s")
    assert outcome.code == 2
    assert "mission run greet --record greet.mcap" in outcome.err


@each("time", ["3", "soon", "-1 s", "1 m"])
def test_time_without_a_valid_unit_is_refused(time: str, record: Path, show: Show) -> None:
    outcome = show(record.name, "--at", time)
    assert outcome.code == 2
    assert "--at" in outcome.err


def test_invalid_record_is_refused(show: Show) -> None:
    Path("broken.mcap").write_bytes(b"mission: greet\n")
    outcome = show("broken.mcap")
    assert outcome.code == 2
    assert "broken.mcap: " in outcome.err
    assert "not a record" in outcome.err
    assert show("missing.mcap").code == 2


@each("form", list(PAIR_FORMS))
def test_two_missions_stand_side_by_side(form: str, show: Show) -> None:
    output = f"diff.{form}"
    outcome = show("motions/square", "--diff", "motions/triangle", "--format", form, "-o", output)
    assert outcome.code == 0, outcome.err
    data = Path(output).read_bytes()
    assert data.startswith(b"\x89PNG") if form == "png" else b"sides: 4 -" in data


def test_a_difference_is_as_wide_as_the_terminal(show: Show, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "60")
    outcome = show("motions/square", "--diff", "square_3m")
    assert outcome.code == 0
    assert max(map(len, outcome.out.splitlines())) <= 60
    assert outcome.out.endswith("3 changed, 3 added\n")


def test_record_is_compared_with_a_mission_at_the_given_time(record: Path, show: Show) -> None:
    outcome = show(record.name, "--diff", "greet", "--at", "2 s", "--format", "json")
    data = json.loads(outcome.out)
    assert (data["left"]["time"], data["right"]["time"], data["summary"]) == (2.0, None, "no difference")


def test_comparison_at_a_moment_shows_statuses(record: Path, show: Show) -> None:
    lines = show(record.name, "--diff", "greet", "--at", "4 s").out.splitlines()
    assert [half.strip() for half in lines[0].split("  ") if half] == ["greet at 4.00 s", "greet"]
    assert lines[1].split() == ["✗", "sequence", "=", "sequence"]
    assert any("✗ find_face -- no face found" in line for line in lines)
    ascii_lines = show(record.name, "--diff", "greet", "--at", "4 s", "--format", "ascii").out.splitlines()
    assert ascii_lines[1].split() == ["x", "sequence", "=", "sequence"]
    assert show(record.name, "--diff", "greet", "--at", "4 s", "-o", "diff.html").code == 0
    page = Path("diff.html").read_text(encoding="utf-8")
    assert page.count('<span class="word">failure</span>') == 2
    assert "greet.yaml at 4.00 s</b>" in page


def test_not_every_format_has_two_sides(show: Show) -> None:
    outcome = show("greet", "--diff", "wave", "--format", "dot")
    assert outcome.code == 2
    assert "text, unicode, ascii, svg, png, json, html" in outcome.err


def test_sub_missions_fold(show: Show) -> None:
    whole, folded = (json.loads(show("patrol", "--format", "json", *more).out) for more in ((), ("--fold", "0")))
    assert "track_face" in json.dumps(whole)
    assert "track_face" not in json.dumps(folded)
    assert json.loads(show("patrol", "--format", "json", "--fold", "1").out) == whole


def test_name_without_a_known_format_lists_the_formats(show: Show) -> None:
    outcome = show("greet", "-o", "greet.pdf")
    assert outcome.code == 2
    assert ".svg" in outcome.err
    assert "try: -o greet.png" in outcome.err
    assert not Path("greet.pdf").exists()


def test_unwritable_output_file_is_refused_with_a_hint(show: Show) -> None:
    outcome = show("greet", "-o", "nowhere/greet.svg")
    assert outcome.code == 2
    assert "nowhere/greet.svg: there is no folder nowhere\n  try: mkdir -p nowhere" in outcome.err


def test_png_without_its_extra_gives_the_install_command(show: Show, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "resvg_py", None)
    outcome = show("greet", "-o", "greet.png")
    assert outcome.code == 2
    assert "pip install 'missiontree[plots]', or -o greet.svg" in outcome.err
    assert show("greet", "-o", "greet.svg").code == 0


def test_invalid_mission_is_not_drawn(show: Show) -> None:
    Path("bad.yaml").write_text("mission: bad\ntree:\n  sequence: [{fly: 1 m}]\n")
    outcome = show("bad.yaml", "-o", "bad.svg")
    assert outcome.code == 2
    assert "bad.yaml:3:15: unknown behaviour 'fly'" in outcome.err
    assert not Path("bad.svg").exists()
