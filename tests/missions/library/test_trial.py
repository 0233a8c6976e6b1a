"""Python of other people that ends, hangs or upsets whoever imports it: named and skipped, and the rest goes on."""

import subprocess
import sys
from importlib.metadata import EntryPoint, EntryPoints
from pathlib import Path

import pytest

from drivers.api.driver import BrokenDriver
from missions.library import drivers, import_trial, vocabulary
from tests.missions.command import command

GOOD = "from behaviours.leaf import Leaf\n\n\nclass Hop(Leaf):\n    tag = 'hop'\n"
MISSION = "mission: m\ntree:\n  log: hello\n"

DOINGS = {
    "class Odd(BaseException): pass\nraise Odd": "Odd",
    "raise KeyboardInterrupt": "cannot be imported: KeyboardInterrupt",
    "raise SystemExit(0)": "cannot be imported: SystemExit: 0",
    "raise GeneratorExit": "GeneratorExit",
    "class E(Exception):\n    def __str__(self): raise ValueError\nraise E": "cannot be imported: E",
    "def f(): f()\nf()": "RecursionError",
    "import os; os._exit(0)": "its import ends the process with exit code 0",
    "import os; os._exit(3)": "its import ends the process with exit code 3",
    "import os, signal; os.kill(os.getpid(), signal.SIGSEGV)": "its import ends the process by SIGSEGV",
    "import os; os.kill(0, 9)": "its import ends the process by SIGKILL",
    "import os; os.chdir('/')": "its import changes the current folder",
    "from threading import Event, Thread\nThread(target=Event().wait).start()": "its import starts a thread (Thread-1",
    "import time\ntime.sleep(1e6)": "its import takes more than 1 s",
    "while True:\n    try: __import__('time').sleep(1)\n    except BaseException: pass": "takes more than 1 s",
    "def": "SyntaxError: invalid syntax",
}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    Path("m.yaml").write_text(MISSION)
    Path("behaviours").mkdir()
    Path("behaviours/hop.py").write_text(GOOD)
    vocabulary._warn.cache_clear()
    import_trial._try_import.cache_clear()
    monkeypatch.delitem(sys.modules, "odd_package", raising=False)
    return tmp_path


def hurry(words: str, patch: pytest.MonkeyPatch) -> None:
    """Give what takes for ever a short time; all others have theirs, whatever else the machine does."""
    if "takes more than" in words:
        patch.setattr(import_trial, "IMPORT_TIMEOUT", 1.0)


@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize("text", DOINGS)
def test_a_file_beside_a_mission_is_named_and_skipped(
    text: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    hurry(DOINGS[text], monkeypatch)
    Path("behaviours/bad.py").write_text(f"{text}\n")
    Path("m.yaml").write_text("mission: m\ntree:\n  hop\n")
    checked = command(capsys, "check", "m.yaml")
    assert (checked.code, checked.out) == (0, "m.yaml: good (m, 1 node)\n")
    assert "behaviours/bad.py:" in checked.err
    assert DOINGS[text] in checked.err
    assert "Traceback" not in checked.err
    given = command(capsys, "check", "m.yaml", "--behaviours", "behaviours/bad.py")
    assert given.code == 2  # what is asked for by name must be there
    assert DOINGS[text] in given.err


@pytest.mark.usefixtures("folder")
def test_circular_link_beside_a_mission_is_reported_and_skipped(capsys: pytest.CaptureFixture[str]) -> None:
    Path("behaviours/bad.py").symlink_to("bad.py")
    Path("m.yaml").write_text("mission: m\ntree:\n  hop\n")
    checked = command(capsys, "check", "m.yaml")
    assert (checked.code, checked.out) == (0, "m.yaml: good (m, 1 node)\n")
    assert "behaviours/bad.py:1:1: cannot be read: Too many levels of symbolic links" in checked.err


@pytest.mark.usefixtures("folder")
def test_unknown_behaviour_error_names_the_skipped_file(capsys: pytest.CaptureFixture[str]) -> None:
    Path("behaviours/bad.py").write_text("raise KeyboardInterrupt\n")
    Path("m.yaml").write_text("mission: m\ntree:\n  wobble\n")
    checked = command(capsys, "check", "m.yaml")
    assert checked.code == 2
    assert "it may be defined in a file that could not be loaded: behaviours/bad.py" in checked.err


ODD = {
    "class A:\n    def __repr__(self): raise ValueError\nthing = A()": "a A",
    "class A:\n    __class__ = property(lambda self: 1 / 0)\nthing = A()": "",
    "class M(type):\n    __module__ = property(lambda self: 1 / 0)\nclass thing(metaclass=M): pass": "",
    "raise KeyboardInterrupt": "cannot be imported: KeyboardInterrupt",
    "import os; os._exit(0)": "its import ends the process with exit code 0",
    "import time\ntime.sleep(1e6)": "its import takes more than 1 s",
}


@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize("text", ODD)
@pytest.mark.parametrize("of", ["odd_package:thing", "odd_package"])
def test_an_installed_package_is_named_and_skipped(
    of: str, text: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    hurry(ODD[text], monkeypatch)
    Path("odd_package.py").write_text(f"{text}\n")
    points = EntryPoints(
        [EntryPoint("mine", of, vocabulary.ENTRY_POINT_GROUP), EntryPoint("base.mine", of, drivers.ENTRY_POINT_GROUP)]
    )
    for module in (vocabulary, drivers):
        monkeypatch.setattr(module, "entry_points_of", lambda group: points.select(group=group))
    checked = command(capsys, "check", "m.yaml")
    assert (checked.code, checked.out) == (0, "m.yaml: good (m, 1 node)\n")
    assert f"entry point mine = {of}" in checked.err
    assert ODD[text] in checked.err or of == "odd_package"
    broken = {name: found for kind, name, found in drivers.DriverTable().iter_drivers() if kind == "base"}
    assert isinstance(broken["mine"], BrokenDriver)
    assert f"base.mine = {of}" in str(broken["mine"])
    assert not isinstance(broken["kobuki"], BrokenDriver)
    listed = command(capsys, "list", "drivers")
    assert (listed.code, "Traceback" in listed.err) == (0, False)


def test_output_of_an_import_is_kept_out_of_the_answer(folder: Path) -> None:
    (folder / "behaviours/loud.py").write_text(f"import sys\nprint('loud')\nsys.stdout.buffer.write(b'\\xff')\n{GOOD}")
    (folder / "behaviours/hop.py").unlink()
    asked = [sys.executable, "-m", "missions", "check", "m.yaml", "--json"]
    ended = subprocess.run(asked, cwd=folder, capture_output=True, check=True)
    assert ended.stdout == b"[]\n"
