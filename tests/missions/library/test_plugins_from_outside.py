"""The plug-in of docs/plugins.md: installed into an environment of its own, and used there as the page shows."""

import re
from pathlib import Path

import pytest

from tests.missions.library.test_drivers_from_outside import SAMPLE, install, mission

pytestmark = pytest.mark.long

PAGE = Path(__file__).parents[3] / "docs" / "plugins.md"


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """MissionTree and the sample, installed beside each other, apart from this folder."""
    folder = tmp_path_factory.mktemp("site")
    install(folder, Path(__file__).parents[3], SAMPLE)
    return folder


def test_the_blocks_of_the_page_are_in_the_sample() -> None:
    sources = "\n".join(path.read_text(encoding="utf-8") for path in [*SAMPLE.rglob("*.py"), SAMPLE / "pyproject.toml"])
    blocks = re.findall(r"```(?:python|toml)\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    assert len(blocks) == 6
    for block in blocks:
        assert block.strip() in sources, block


def test_the_plug_in_adds_a_command_an_option_and_a_kind_of_file(site: Path, tmp_path: Path) -> None:
    ran = mission(site, "run", "greet", "--simulate", "fast", "--eyes", "truth", "--diary", "a.diary", folder=tmp_path)
    assert ran.returncode == 0, ran.stderr
    assert "wrote a.diary" in ran.stderr
    checked = mission(site, "check", "a.diary", folder=tmp_path)
    assert re.fullmatch(r"a\.diary: good \(\d+ lines\)\n", checked.stdout)
    printed = mission(site, "diary", "a.diary", folder=tmp_path)
    assert re.search(r"^ +\d+\.\d s  say success$", printed.stdout, re.MULTILINE)
    assert "Print the diary of a run." in mission(site, "--help").stdout
    assert "--diary FILE.diary" in mission(site, "run", "--help-all").stdout


def test_plugin_errors_are_reported_like_command_errors(site: Path, tmp_path: Path) -> None:
    refused = mission(site, "run", "greet", "--simulate", "fast", "--diary", "a.txt", folder=tmp_path)
    assert (refused.returncode, "the name must end in .diary" in refused.stderr) == (2, True)
    (tmp_path / "bad.diary").write_text("yesterday\n", encoding="utf-8")
    checked = mission(site, "check", "bad.diary", folder=tmp_path)
    assert checked.returncode == 2
    assert "bad.diary:1: a line must begin with a time" in checked.stderr
    unwritable = mission(site, "run", "greet", "--simulate", "fast", "--diary", "no/a.diary", folder=tmp_path)
    assert unwritable.returncode == 2
    assert "no/a.diary" in unwritable.stderr
