"""``mission record report``: what it writes where, and what it says when it cannot."""

import io
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import cv2
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from missions.cli.root import run_guarded
from missions.plugins.records.commands.report import report as command
from missions.plugins.records.recording.run_record import RunRecord
from tests.missions.views.pictures.test_document import Reader


@pytest.fixture(scope="module", autouse=True)
def fonts() -> None:
    """Have Matplotlib open its fonts before the tests: it keeps their files open."""
    FigureCanvasAgg(figure := Figure())
    figure.suptitle("…")
    figure.savefig(io.BytesIO())


@dataclass(frozen=True)
class Told:
    """What a command left behind."""

    exit_code: int
    output: str


Report = Callable[..., Told]


@pytest.fixture
def report(capsys: pytest.CaptureFixture[str]) -> Report:
    """Run the command with arguments, as ``mission`` does."""

    def run(*arguments: object) -> Told:
        words = [str(each) for each in arguments]
        code = run_guarded(lambda: command.main(words, standalone_mode=False))
        printed = capsys.readouterr()
        return Told(code, printed.out + printed.err)

    return run


def images(path: Path) -> int:
    """Return how many pictures a page has; the newest stands beside the tree too."""
    return sum(tag == "img" for tag, _ in Reader(path.read_text(encoding="utf-8")).tags)


def test_report_is_written_to_the_given_path(report: Report, record: RunRecord, tmp_path: Path) -> None:
    told = report(record.path, "-o", tmp_path / "report.html")
    assert (told.exit_code, told.output) == (0, f"wrote {tmp_path / 'report.html'} (only you can read it)\n")
    assert images(tmp_path / "report.html") == 5 + 1


def test_report_is_written_beside_the_record_by_default(report: Report, record: RunRecord, tmp_path: Path) -> None:
    path = tmp_path / "m.mcap"
    path.write_bytes(record.path.read_bytes())
    assert report(path).exit_code == 0
    assert (tmp_path / "m_report.html").read_text(encoding="utf-8").startswith("<!doctype html>")
    assert not (tmp_path / "m.html").exists()  # what mission show m.yaml -o m.html has written may be there


@pytest.mark.parametrize(
    ("option", "name", "words"),
    [("-o", "m.pdf", "not the name of an HTML page\n  try: -o "), ("--plots", "m.png", "would become a folder")],
)
def test_report_name_with_another_ending_is_refused(
    report: Report, record: RunRecord, tmp_path: Path, option: str, name: str, words: str
) -> None:
    told = report(record.path, option, tmp_path / name)
    assert told.exit_code == 2
    assert words in told.output
    assert not (tmp_path / name).exists()


@pytest.mark.parametrize(("most", "there"), [(0, 0), (2, 3)])
def test_number_of_pictures_is_limited(
    report: Report, record: RunRecord, tmp_path: Path, most: int, there: int
) -> None:
    assert report(record.path, "-o", tmp_path / "report.html", "--pictures", most).exit_code == 0
    assert images(tmp_path / "report.html") == there


def test_plots_are_written_without_the_page(report: Report, record: RunRecord, tmp_path: Path) -> None:
    told = report(record.path, "--plots", tmp_path / "plots")
    assert told.exit_code == 0
    names = ["battery", "pan", "route", "speed", "timeline", "tracking"]
    assert sorted(path.name for path in tmp_path.rglob("*")) == sorted(["plots", *(f"{name}.png" for name in names)])
    for name in names:
        image = cv2.imread(str(tmp_path / "plots" / f"{name}.png"))
        assert image is not None
        assert image.shape[1] == 1890  # 6.3 inches at 300 dpi
        assert image.std() > 5
        assert f"{name}.png" in told.output


def test_missing_plots_extra_gives_the_install_command(
    report: Report, record: RunRecord, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib.axes", None)
    monkeypatch.delitem(sys.modules, "missions.plugins.records.report.plots", raising=False)
    told = report(record.path, "--plots", tmp_path / "plots")
    assert told.exit_code == 2
    assert "pip install 'missiontree[plots]'" in told.output


def test_file_that_is_not_a_record_is_refused_with_a_hint(report: Report, tmp_path: Path) -> None:
    (tmp_path / "m.yaml").write_text("mission: m\n")
    told = report(tmp_path / "m.yaml")
    assert told.exit_code == 2
    assert "not a record" in told.output
    assert "try: mission " in told.output
    assert report(tmp_path / "none.mcap").exit_code == 2


def test_unwritable_output_path_is_named(report: Report, record: RunRecord, tmp_path: Path) -> None:
    told = report(record.path, "-o", tmp_path / "no" / "report.html")
    assert told.exit_code == 2
    assert str(tmp_path / "no" / "report.html") in told.output
    (tmp_path / "file").write_text("")
    assert report(record.path, "--plots", tmp_path / "file" / "plots").exit_code == 2
