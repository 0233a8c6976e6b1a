"""The README is true: each of its commands does what it says, and each of its files loads."""

import re
import shlex
import signal
from collections.abc import Iterator
from pathlib import Path

import cv2
import pytest
import skimage

from config.robot import load_robot
from missions.library import load_mission
from tests.missions.command import Process, command

README = (Path(__file__).parents[2] / "README.md").read_text(encoding="utf-8")


def commands() -> Iterator[str]:
    """Yield every `mission ...` line of the README's console blocks, without its comment."""
    for block in re.findall(r"```console\n(.*?)```", README, re.DOTALL):
        for line in block.splitlines():
            if line.startswith("$ mission "):
                yield line.removeprefix("$ mission ").split("  #")[0].strip()


def files() -> Iterator[tuple[str, str]]:
    """Yield the YAML files that the README shows, by the name it gives them."""
    for block in re.findall(r"```yaml\n(.*?)```", README, re.DOTALL):
        kind, name = block.split()[:2]
        yield name + (".test.yaml" if kind == "tests:" else ".yaml"), block


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with the files that the README speaks of: its own, a photo and a video of a person."""
    for name, text in files():
        (tmp_path / name).write_text(text)
    picture = cv2.cvtColor(skimage.data.astronaut(), cv2.COLOR_RGB2BGR)
    cv2.imwrite(str(tmp_path / "photo.jpg"), picture)
    scene = cv2.copyMakeBorder(picture, 0, 0, 64, 64, cv2.BORDER_REPLICATE)[:480]
    video = cv2.VideoWriter(str(tmp_path / "my_video.mp4"), cv2.VideoWriter.fourcc(*"mp4v"), 20.0, (640, 480))
    for _ in range(40):
        video.write(scene)
    video.release()
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_the_readme_has_commands_and_files() -> None:
    assert len(list(commands())) > 15
    assert {name for name, _ in files()} == {"greet.yaml", "greet.test.yaml", "my_robot.yaml", "to_and_fro.yaml"}


@pytest.mark.parametrize("line", [line for line in commands() if not line.startswith("simulate")])
def test_each_command_of_the_readme_works(line: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    outcome = command(capsys, *shlex.split(line))
    expected = 0
    if "--world empty" in line:
        expected = 1
        assert "no face found" in outcome.out
    elif line.startswith("run") and "--robot" in line:  # the metal, which is not here
        expected = 3
        assert "no such device" in outcome.err
    assert outcome.code == expected, outcome.err
    if "--annotate" in line:
        assert list((folder / "out").iterdir())


@pytest.mark.parametrize("line", [line for line in commands() if line.startswith("simulate")])
def test_the_virtual_devices_tell_their_ports(line: str, folder: Path) -> None:
    process = Process(*shlex.split(line), folder=folder)
    first = process.wait_for_line(lambda text: text.startswith("{"))
    assert '"ports"' in first
    assert process.end(signal.SIGINT) == 0


def test_the_files_that_the_readme_shows_load(folder: Path) -> None:
    assert load_robot(folder / "my_robot.yaml").parts == {"base", "voice"}
    shown, shipped = load_mission(str(folder / "greet.yaml")), load_mission("greet")
    assert [step.kind for step in shown.tree.walk()] == [step.kind for step in shipped.tree.walk()]
    assert shown.params == shipped.params


def test_the_tests_that_the_readme_shows_pass(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert command(capsys, "test", str(folder / "greet.test.yaml")).code == 0


def test_the_error_that_the_readme_shows_is_the_real_one(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shown = re.findall(r"```\n(my_mission.yaml.*?)```", README, re.DOTALL)[0]
    (folder / "my_mission.yaml").write_text("mission: mine\ntree:\n  sequence:\n    - trak_face\n")
    assert shown.strip() in command(capsys, "check", "my_mission.yaml").err
