"""Each command of the README and of the pages that continue it works, and each of their files loads."""

import fcntl
import os
import pty
import re
import shlex
import shutil
import signal
import subprocess
import sys
import termios
import wave
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import cv2
import PIL.Image
import pytest
import skimage
from _pytest.mark import ParameterSet

from docs import film
from missions.cli.root import mission, run_guarded
from missions.library.drivers import load_robot
from missions.library.shipped import load_mission
from missions.trees.drawing_builder import drawing_of
from tests.missions.command import Process, command
from tests.perception.people_drawn import pictures

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")

PAGES = ("README.md", "docs/running.md", "docs/missions.md", "docs/editor.md")
"""The README, and the pages that continue it."""

TEXT = "".join((ROOT / page).read_text(encoding="utf-8") for page in PAGES)

MAX_WORDS = 800
"""The length of the README."""

MAX_FILM_BYTES = 1_500_000


def commands() -> Iterator[str]:
    """Yield every `mission ...` line of the pages' console blocks, without its comment."""
    for block in re.findall(r"```console\n(.*?)```", TEXT, re.DOTALL):
        for line in block.splitlines():
            if line.startswith("$ mission "):
                yield line.removeprefix("$ mission ").split(" #")[0].strip()


def files() -> Iterator[tuple[str, str]]:
    """Yield the YAML files that the pages show, by the name that they give them."""
    for block in re.findall(r"```yaml\n(.*?)```", TEXT, re.DOTALL):
        yield f"{block.split()[1]}.yaml", block


@pytest.fixture(scope="module")
def record(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The record that the pages mention."""
    path = tmp_path_factory.mktemp("records") / "monday.mcap"
    asked = ("run", "greet", "--simulate", "fast", "--eyes", "truth", "--record", str(path))
    assert run_guarded(lambda: mission.main(list(asked), standalone_mode=False)) == 0
    return path


@pytest.fixture(scope="module")
def files_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the files that the pages mention: missions, a robot, photos and a video of people."""
    folder = tmp_path_factory.mktemp("made")
    for name, text in files():
        (folder / name).write_text(text)
    testing = (ROOT / "docs" / "testing.md").read_text(encoding="utf-8")
    (folder / "greet.test.yaml").write_text(re.findall(r"```yaml\n(# greet.test.yaml.*?)```", testing, re.DOTALL)[0])
    picture = cv2.cvtColor(skimage.data.astronaut(), cv2.COLOR_RGB2BGR)
    cv2.imwrite(str(folder / "photo.jpg"), picture)
    scene = cv2.copyMakeBorder(picture, 0, 0, 64, 64, cv2.BORDER_REPLICATE)[:480]
    video = cv2.VideoWriter(str(folder / "my_video.mp4"), cv2.VideoWriter.fourcc(*"mp4v"), 20.0, (640, 480))
    for _ in range(40):
        video.write(scene)
    video.release()
    (folder / "photos").mkdir()
    for number, photo in enumerate(pictures("anna", (1.0, 1.3), each=2)):
        cv2.imwrite(str(folder / f"photos/anna{number}.jpg"), photo)
    with wave.open(str(folder / "quiet.wav"), "wb") as sound:
        sound.setparams((1, 2, 16000, 0, "NONE", "not compressed"))
        sound.writeframes(bytes(32000))
    return folder


@pytest.fixture
def folder(files_folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of that folder, as the current folder of one test."""
    shutil.copytree(files_folder, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def words(line: str) -> list[str]:
    """Return the words of a command line as a shell passes them on."""
    found = ([str(path) for path in sorted(Path().glob(word))] if "*" in word else [word] for word in shlex.split(line))
    return [word for several in found for word in several]


@pytest.mark.usefixtures("folder")
def test_readme_commands_are_split_like_in_a_shell() -> None:
    photos = [f"photos/anna{number}.jpg" for number in range(4)]
    assert words('person add "Anna B" photos/anna*.jpg') == ["person", "add", "Anna B", *photos]


def test_the_pages_have_commands_and_files() -> None:
    assert len(list(commands())) > 50
    names = {"greet.yaml", "first.yaml", "my_robot.yaml", "there_and_back.yaml", "say_it_to_somebody.yaml"}
    assert {name for name, _ in files()} == names


def test_the_readme_is_short_and_names_the_first_chores() -> None:
    assert len(README.split()) <= MAX_WORDS
    assert "make demo" in README
    assert "make test" in README


def test_the_film_shows_every_node_of_greet() -> None:
    rows = list(film.tree_rows(drawing_of(load_mission("greet")).root))
    picture = PIL.Image.new("RGB", (1600, 480))
    frame = film.frame(picture, rows, [], time=0.0)
    with PIL.Image.open(film.FILM) as shown:
        assert shown.size == frame.size == film.SIZE
    bottom = frame.crop((film.LEFT, 62 + (len(rows) - 1) * film.ROW, frame.width, frame.height))
    assert bottom.getextrema() != PIL.Image.new("RGB", (1, 1), film.PAPER).getextrema(), "the last row is empty"


def test_the_film_is_animated_and_small() -> None:
    path = ROOT / "docs" / "studio" / "greet.webp"
    assert path.stat().st_size < MAX_FILM_BYTES
    assert f"docs/studio/{path.name}" in README
    assert b"ANIM" in path.read_bytes()[:64]


def of_kind(line: str) -> str:
    """Return the stand-in that a test of this command needs."""
    kinds = {"simulate": "devices", "hear": "microphone", "studio": "page"}
    return "terminal" if line.endswith("--view") else kinds.get(line.split(maxsplit=1)[0], "nothing")


PACED = "run there_and_back.yaml --json"
"""The run that is tested in real time, as a user sees it; the one with `--view` is another."""


def with_simulated_time(line: str) -> list[str]:
    """Return the words of a command, in simulated time unless it chooses its time or names a robot.

    A run with params, or with a film, gets `--eyes truth`, which needs no pictures.
    """
    simulated = line.startswith(("run ", "motion ")) and not line.startswith(PACED)
    own = {"--simulate", "--speed", "--eyes", "--robot", "--camera", "--film"} & set(line.split())
    hurry = ["--simulate", "fast"] if simulated and not own else []
    truth = ["--eyes", "truth"] if "--film" in line or (simulated and "--param" in line) else []
    return [*words(line), *hurry, *truth]


def as_parameter(line: str) -> ParameterSet:
    """Return a command as a test parameter, marked if it runs in real time."""
    real = line.startswith(("run ", "motion ", "servo ")) and not {"fast", "truth"} & set(with_simulated_time(line))
    return pytest.param(line, marks=[pytest.mark.real_time] if real else [])


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("line", [as_parameter(line) for line in commands() if of_kind(line) == "nothing"])
def test_each_command_works(line: str, folder: Path, record: Path, capsys: pytest.CaptureFixture[str]) -> None:
    if "--record" not in line:
        shutil.copy(record, folder)
    outcome = command(capsys, *with_simulated_time(line.replace("--runs 40", "--runs 4")))  # the others are like these
    expected = 0
    if "--world empty" in line:
        expected = 1
        assert "no face found" in outcome.out
    elif line.startswith("run") and "--robot" in line and "--simulate" not in line:  # hardware, which is not here
        expected = 3
        assert "no such device" in outcome.err
    assert outcome.code == expected, outcome.err
    if "--annotate" in line:
        assert list((folder / "out").iterdir())


@pytest.mark.parametrize("line", [line for line in commands() if of_kind(line) == "microphone"])
def test_hear_takes_a_recording_instead_of_a_microphone(
    line: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    del folder
    assert command(capsys, *words(line), "--wav", "quiet.wav").code == 0


@pytest.mark.parametrize("line", [line for line in commands() if of_kind(line) == "terminal"])
def test_view_shows_the_run_on_a_terminal(line: str, folder: Path) -> None:
    master, slave = pty.openpty()
    fcntl.ioctl(slave, termios.TIOCSWINSZ, b"\x28\x00\x78\x00\x00\x00\x00\x00")  # 40 lines of 120 characters
    screen = subprocess.Popen(
        [sys.executable, "-m", "missions", *words(line)],
        stdin=slave,
        stdout=slave,
        stderr=slave,
        cwd=folder,
        env={**os.environ, "TERM": "xterm-256color"},
        start_new_session=True,
    )
    os.close(slave)
    shown = b""
    with suppress(OSError):  # everybody has gone
        while piece := os.read(master, 1 << 16):
            shown += piece
    os.close(master)
    assert screen.wait() == 0, shown[-2000:]
    assert b"greet the person" in shown


@pytest.mark.parametrize("line", [line for line in commands() if of_kind(line) == "devices"])
def test_simulate_prints_the_ports_of_its_devices(line: str, folder: Path) -> None:
    process = Process(*shlex.split(line), folder=folder)
    first = process.wait_for_line(lambda text: text.startswith("{"))
    assert '"ports"' in first
    assert process.end(signal.SIGINT) == 0


@pytest.mark.parametrize("line", [line for line in commands() if of_kind(line) == "page"])
def test_studio_prints_its_link_and_ends_on_ctrl_c(line: str, folder: Path) -> None:
    process = Process(*shlex.split(line), "--port", "0", folder=folder)
    process.wait_for_line(lambda text: "http://127.0.0.1:" in text)
    assert process.end(signal.SIGINT) == 0


def test_files_shown_in_the_pages_load(folder: Path) -> None:
    assert load_robot(folder / "my_robot.yaml").parts == {"base", "voice"}
    shown, shipped = load_mission(str(folder / "greet.yaml")), load_mission("greet")
    assert [step.kind for step in shown.tree.walk()] == [step.kind for step in shipped.tree.walk()]
    assert shown.params == shipped.params


def test_the_error_of_the_readme_is_the_real_one(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shown = re.findall(r"```\n(my_mission.yaml.*?)```", README, re.DOTALL)[0]
    (folder / "my_mission.yaml").write_text("mission: mine\ntree:\n  sequence:\n    - trak_face\n")
    assert shown.strip() in command(capsys, "check", "my_mission.yaml").err
