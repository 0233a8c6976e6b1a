"""``mission controller`` and ``mission controller tune``: what they print, draw and write, and what they refuse."""

import io
import json
import os
import signal
import sys
from collections.abc import Sequence
from itertools import count
from pathlib import Path
from typing import Any

import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from config.controller import load_controller
from config.library import shipped_files
from missions.cli.root import SUCCESS, USAGE
from missions.plugins.testing.controllers.tuning import ControllerTuning
from tests.missions.command import command

PNG = b"\x89PNG"

SMALL = "controller: small\nsummary: Small.\npredict: false\nturn: {p: 1.2, d: 0.1}\n"


@pytest.fixture(scope="module", autouse=True)
def fonts() -> None:
    """Have Matplotlib open its fonts before the tests: it keeps their files open."""
    FigureCanvasAgg(figure := Figure())
    figure.text(0.1, 0.1, "plain")
    figure.text(0.1, 0.5, "bold", fontweight="bold")
    figure.savefig(io.BytesIO())


@pytest.fixture
def small(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A controller file in the folder where the command runs."""
    monkeypatch.chdir(tmp_path)
    file = tmp_path / "small.yaml"
    file.write_text(SMALL, encoding="utf-8")
    return file


def test_list_contains_every_controller_with_its_summary(capsys: pytest.CaptureFixture[str]) -> None:
    found = command(capsys, "list", "controllers")
    assert found.code == SUCCESS
    for (name, path), line in zip(shipped_files("controllers").items(), found.out.splitlines()[1:], strict=True):
        assert line.split(maxsplit=1) == [name, load_controller(path).summary]


def test_controller_is_described_in_words(capsys: pytest.CaptureFixture[str]) -> None:
    face = command(capsys, "controller", "show", "face").out
    assert "pan: 25 rules, Sugeno\n  error (deg): far_right -6, right -2, centred 0, left 2, far_left 6\n" in face
    assert "if error is left and rate is still then slow_left" in face
    assert "acts on the prediction" in face
    assert "base: 5 rules, Mamdani" in command(capsys, "controller", "show", "mamdani").out
    pd = command(capsys, "controller", "show", "pd").out
    assert "acts on the latest picture" in pd
    assert "turn: 4.7 times the error and 0.4 times its rate, at most 110 deg/s" in pd


MIXED = """\
controller: mixed
turn: {p: 1.2, d: 0.1}
base:
  method: mamdani
  inputs: {pan: {right: -30 deg, ahead: 0 deg, left: 30 deg}}
  output: {turn: {rightwards: -60 deg/s, stay: 0 deg/s, leftwards: 60 deg/s}}
  rules:
    - if pan is right then turn is rightwards
    - if pan is ahead then turn is stay
    - if pan is left then turn is leftwards
"""


@pytest.mark.parametrize("name", ["face", "mixed.yaml"])
def test_a_controller_can_be_drawn(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("mixed.yaml").write_text(MIXED, encoding="utf-8")
    found = command(capsys, "controller", "show", name, "-o", "surface.png")
    assert (found.code, found.err) == (SUCCESS, "drew surface.png\n")
    assert Path("surface.png").read_bytes().startswith(PNG)


def test_controller_of_the_docs_is_valid(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    page = (Path(__file__).parents[4] / "docs" / "tracker.md").read_text(encoding="utf-8")
    Path("mine.yaml").write_text(page[page.index("controller: mine") :].partition("```")[0], encoding="utf-8")
    assert "pan: 9 rules, Sugeno" in command(capsys, "controller", "show", "mine.yaml").out
    assert [f"| `{name}` |" in page for name in shipped_files("controllers")] == [True] * len(
        shipped_files("controllers")
    )


def test_invalid_controller_is_refused_with_the_place(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "bad.yaml"
    file.write_text("controller: bad\nturn: {p: 2}\n", encoding="utf-8")
    found = command(capsys, "controller", "show", str(file))
    assert found.code == USAGE
    assert "bad.yaml': turn: a PD controller needs 'd'" in found.err
    unknown = command(capsys, "controller", "show", "fase")
    assert unknown.code == USAGE
    assert "did you mean 'face'?" in unknown.err


def test_controller_picture_must_be_a_png_in_an_existing_folder(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name, what in (("a.svg", "must end in .png"), ("gone/a.png", "there is no folder ")):
        found = command(capsys, "controller", "show", "pd", "-o", str(tmp_path / name))
        assert found.code == USAGE
        assert what in found.err


def test_controllers_are_benched_as_figures_and_as_a_picture(small: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = command(capsys, "controller", "bench", small.name, "--json", "-o", "bench.png")
    assert found.code == SUCCESS
    rows: list[dict[str, Any]] = json.loads(found.out)
    assert {(row["scenario"], row["body"]) for row in rows} >= {
        ("step of 25 deg", "head"),
        ("walk at 20 deg/s", "both"),
    }
    assert len(rows) == 18
    assert {row["controller"] for row in rows} == {"small"}
    assert (small.parent / "bench.png").read_bytes().startswith(PNG)


def test_tuning_writes_a_new_file_and_shows_before_and_after(
    small: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ControllerTuning, "cost", lambda _, factors: abs(factors[0] - 0.5))
    found = command(capsys, "controller", "tune", small.name, "--evaluations", "10")
    assert found.code == SUCCESS
    assert "  before" in found.out
    assert "  after" in found.out
    assert found.out.endswith("wrote small_tuned.yaml; to use it: track_face: small_tuned.yaml\n")
    assert small.read_text(encoding="utf-8") == SMALL
    new = load_controller(small.parent / "small_tuned.yaml")
    assert (new.name, new.summary) == ("small_tuned", "Small. Tuned.")
    assert new.values != load_controller(small).values


def test_tuning_writes_over_nothing_unless_forced(
    small: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ControllerTuning, "cost", lambda _, factors: abs(factors[0] - 0.5))
    other = small.parent / "other.yaml"
    other.write_text("mine", encoding="utf-8")
    wish = ("controller", "tune", small.name, "-o", other.name, "--evaluations", "10")
    refused = command(capsys, *wish)
    assert refused.code == USAGE
    assert "'other.yaml' exists: name another file with --output, or add --force" in refused.err
    assert other.read_text(encoding="utf-8") == "mine"
    assert command(capsys, *wish, "--force").code == SUCCESS
    assert load_controller(other).name == "other"


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP, signal.SIGINT])
def test_interrupted_tuning_keeps_the_best_numbers(
    small: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, number: signal.Signals
) -> None:
    asked = count(1)

    def cost(_: ControllerTuning, factors: Sequence[float]) -> float:
        if next(asked) > 12:
            os.kill(os.getpid(), number)
        return abs(factors[0] - 0.5)

    monkeypatch.setattr(ControllerTuning, "cost", cost)
    found = command(capsys, "controller", "tune", small.name, "--evaluations", "100")
    assert (found.code, found.out) == (130, "")
    assert found.err == "mission: interrupted; small_tuned.yaml has the best numbers so far\n"
    assert load_controller(small.parent / "small_tuned.yaml").values != load_controller(small).values


def test_missing_rules_cannot_be_tuned(small: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = command(capsys, "controller", "tune", small.name, "--rules", "pan")
    assert found.code == USAGE
    assert "small.yaml: has no numbers under 'pan' to tune" in found.err
    assert not (small.parent / "small_tuned.yaml").exists()


@pytest.mark.parametrize(
    ("library", "ours", "arguments", "cure"),
    [
        ("matplotlib.figure", "plots", ("controller", "show", "pd", "-o", "a.png"), "'missiontree[plots]'"),
        ("scipy.optimize", "tuning", ("controller", "tune"), "'missiontree[tune]'"),
    ],
)
def test_missing_extra_is_named(
    library: str,
    ours: str,
    arguments: tuple[str, ...],
    cure: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setitem(sys.modules, library, None)
    monkeypatch.delitem(sys.modules, f"missions.plugins.testing.controllers.{ours}", raising=False)
    found = command(capsys, *arguments)
    assert found.code == USAGE
    assert f"pip install {cure}" in found.err
