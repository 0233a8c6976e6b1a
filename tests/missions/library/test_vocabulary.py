"""More leaves: from files, from installed packages, from plain py_trees; and what can be wrong with them."""

import subprocess
import sys
from importlib.metadata import EntryPoint, EntryPoints
from pathlib import Path
from typing import Any

import py_trees
import pytest
from py_trees.common import Status

import missions
from behaviours.leaf import REQUIRED
from behaviours.py_trees_leaf import leaf_of, tag_of
from config.diagnostics import InvalidFileError
from missions.language.claims import TargetRobot
from missions.library import vocabulary as module
from missions.library.shipped import load_mission
from missions.library.vocabulary import load_leaves
from tests.missions.command import command

COUNTER = '''
from py_trees.behaviour import Behaviour
from py_trees.common import Status

class CountTo(Behaviour):
    """Count.

    Running until the limit, then succeeds.
    """

    def __init__(self, name: str, limit: int, step: int = 1, *, shout: bool = False, word: str | None = None) -> None:
        super().__init__(name)
        self.limit, self.step, self.made = limit, step, 0

    def initialise(self) -> None:
        self.count = 0

    def update(self) -> Status:
        self.count += self.step
        self.feedback_message = f"{self.count} of {self.limit}"
        return Status.SUCCESS if self.count >= self.limit else Status.RUNNING
'''

BLINK = '''
from behaviours.leaf import SUCCESS, Leaf, argument

class _Light(Leaf):
    times: int = argument("count", "how often", default=1, principal=True)

class Blink(_Light):
    """Blink."""
    tag = "blink"
    def update(self):
        return SUCCESS
'''


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def wrong(text: str) -> str:
    """Return the message for a file that cannot be used."""
    Path("wrong.py").write_text(text)
    with pytest.raises(InvalidFileError) as caught:
        load_leaves([Path("wrong.py")])
    return str(caught.value)


@pytest.mark.usefixtures("folder")
def test_a_leaf_is_one_class_in_one_file() -> None:
    Path("blink.py").write_text(BLINK)
    words = load_leaves([Path("blink.py"), Path("./blink.py")])
    assert words["blink"].arguments["times"].principal
    assert set(words) - set(load_leaves()) == {"blink"}
    assert not Path("__pycache__").exists()


@pytest.mark.usefixtures("folder")
def test_plain_behaviour_runs_in_a_mission() -> None:
    Path("counter.py").write_text(COUNTER)
    Path("m.yaml").write_text(
        "mission: m\nparams: {many: 2}\ntree:\n  sequence: [{count_to: 2}, {count_to: {limit: '${many}', step: 2}}]\n"
    )
    mission = missions.load("m.yaml", behaviours=["counter.py"])
    assert [mission.tick() for _ in range(2)] == [Status.RUNNING, Status.SUCCESS]
    assert [mission.tick() for _ in range(2)] == [Status.RUNNING, Status.SUCCESS]
    first = mission.root.children[0]
    assert (first.name, first.feedback_message) == ("count_to", "2 of 2")


@pytest.mark.usefixtures("folder")
def test_behaviour_is_reused_until_its_arguments_change() -> None:
    Path("counter.py").write_text(COUNTER)
    Path("m.yaml").write_text(
        "mission: m\ntree:\n  sequence:\n    - set: {many: 1}\n    - sequence:\n"
        "        - count_to: '${many}'\n        - count_to: 1\n        - set: {many: '${many + 1}'}\n      repeat: 3\n"
    )
    mission = missions.load("m.yaml", behaviours=["counter.py"])
    mission.tick()
    moving, same = [node for node in mission.root.iterate() if getattr(node, "kind", "") == "count_to"]
    made: list[tuple[Any, Any]] = []
    for _ in range(12):
        made.append((moving.children[0], same.children[0]))
        if mission.status is not Status.RUNNING:
            break
        mission.tick()
    assert len({id(a) for a, _ in made}) == 3
    assert len({id(b) for _, b in made}) == 1


@pytest.mark.parametrize(
    ("name", "word"),
    [("CountTo", "count_to"), ("LEDBlink", "led_blink"), ("Say2Words", "say2_words"), ("Go", "go"), ("ABC", "abc")],
)
def test_a_class_name_becomes_a_word(name: str, word: str) -> None:
    assert tag_of(type(name, (), {})) == word


def test_parameters_become_arguments_by_their_annotations() -> None:
    class Many(py_trees.behaviour.Behaviour):
        """Much."""

        def __init__(
            self,
            name: str,
            a: float,
            b: int = 3,
            c: str = "x",
            d: bool = True,
            e: Any = None,
            f: float | None = 1.5,
            g: list[int] | None = None,
            *more: int,
        ) -> None:
            super().__init__(name)
            self.given = (a, b, c, d, e, f, g, more)

        def update(self) -> Status:
            return Status.SUCCESS

    leaf = leaf_of(Many)
    assert {name: each.kind for name, each in leaf.arguments.items()} == {
        "a": "number",
        "b": "count",
        "c": "text",
        "d": "flag",
        "e": "value",
        "f": "number",
    }
    assert leaf.arguments["a"].default is REQUIRED
    assert leaf.arguments["a"].principal
    assert leaf.arguments["b"].default == 3
    assert (leaf.tag, leaf.__doc__) == ("many", "Much.")


def test_behaviour_with_unsupported_argument_is_refused() -> None:
    with pytest.raises(TypeError, match=r"Inverter needs 'child' \(Behaviour\), which a mission cannot give"):
        leaf_of(py_trees.decorators.Inverter)


@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x = 1\n\n1 / 0\n", "wrong.py:3:1: cannot be imported: ZeroDivisionError: division by zero"),
        ("def f():\n    raise SystemExit(4)\nf()\n", "wrong.py:2:1: cannot be imported: SystemExit: 4"),
        ("import nowhere_to_be_found\n", "wrong.py:1:1: cannot be imported: ModuleNotFoundError: No module named"),
        ("class X(:\n", "wrong.py:1:9: cannot be imported: SyntaxError: invalid syntax"),
        ("x = 1\n", "wrong.py:1:1: it contains no behaviour"),
        (BLINK.replace('tag = "blink"', ""), "wrong.py:1:1: it contains no behaviour"),
        (
            BLINK.replace('"blink"', '"drive"'),
            "wrong.py:7:7: Blink: the word 'drive' is taken by DriveLeaf of behaviours.driving.motion",
        ),
        (BLINK.replace('"blink"', '"sequence"'), "Blink: the word 'sequence' is reserved in missions"),
        *(
            (BLINK.replace('"blink"', f'"{word}"'), f"Blink: the word '{word}' must be lower-case letters")
            for word in ("Blink it", "Blink", "blink-it", "_blink", "9blink", "Äuge", "blink\N{COMBINING ACUTE ACCENT}")
        ),
        (BLINK.replace('"count"', '"cuont"'), "Blink: 'times' has an unknown kind: did you mean 'count'?"),
        (
            BLINK + '    far: float = argument("length", "x", default="1 m")\n',
            "wrong.py:7:7: Blink: the default of 'far' must be a number, in SI units",
        ),
        (BLINK + '    senses = frozenset({"face"})\n', "Blink: unknown sense 'face': did you mean 'faces'?"),
        (
            BLINK + '    more: int = argument("count", "x", principal=True)\n',
            "wrong.py:7:7: Blink: only one argument can be the principal one, not times and more",
        ),
        (
            BLINK + "    def __init__(self, name, colour):\n        super().__init__(name)\n",
            (
                "wrong.py:7:7: Blink: a leaf must be constructible with its name alone: "
                "missing a required argument: 'colour'"
            ),
        ),
        (COUNTER.replace("limit: int", "limit: list[int]"), "wrong.py:5:7: CountTo needs 'limit' (list"),
        (COUNTER.replace("limit: int", "limit: Nothing"), "NameError: name 'Nothing' is not defined"),
        (COUNTER.replace("limit: int", "status: int"), "CountTo needs 'status' (a name that leaves use themselves)"),
    ],
)
def test_faults_of_a_behaviour_file_are_reported_at_their_line(text: str, message: str) -> None:
    assert message in wrong(text)


@pytest.mark.usefixtures("folder")
def test_leaf_that_drives_an_unknown_part_is_refused() -> None:
    Path("blink.py").write_text(BLINK + '    drives = frozenset({"haed"})\n')
    Path("m.yaml").write_text("mission: m\ntree:\n  blink\n")
    with pytest.raises(InvalidFileError, match="'blink' drives 'haed', which is not a part of a robot") as caught:
        load_mission("m.yaml", leaves=load_leaves([Path("blink.py")]), robot=TargetRobot("r2", frozenset({"head"})))
    assert caught.value.diagnostics[0].suggestion == "did you mean 'head'?"


@pytest.mark.usefixtures("folder")
def test_all_faults_of_all_files_come_at_once() -> None:
    Path("one.py").write_text(BLINK)
    Path("two.py").write_text(BLINK)
    Path("three.py").write_text("1 / 0\n")
    with pytest.raises(InvalidFileError) as caught:
        load_leaves([Path("one.py"), Path("two.py"), Path("three.py"), Path("four.py")])
    assert [fault.place for fault in caught.value.diagnostics] == ["four.py:1:1", "three.py:1:1", "two.py:7:7"]
    assert "taken by Blink of one" in str(caught.value)


def test_installed_packages_offer_classes_and_modules(monkeypatch: pytest.MonkeyPatch) -> None:
    points = [
        EntryPoint("periodic", "py_trees.behaviours:Periodic", module.ENTRY_POINT_GROUP),
        EntryPoint("probes", "tests.conformance.probes", module.ENTRY_POINT_GROUP),
    ]
    monkeypatch.setattr(module, "entry_points_of", lambda group: EntryPoints(points).select(group=group))
    assert set(load_leaves()) >= {"periodic", "probe", "base_probe", "echo", "drive"}
    assert load_leaves()["periodic"].arguments["n"].kind == "count"


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ("nowhere:Leaf", "cannot be imported: ModuleNotFoundError: No module named 'nowhere'"),
        ("json:dumps", "names neither a behaviour nor a module"),
        ("json", "it contains no behaviour"),
    ],
)
def test_faults_of_an_entry_point_are_reported_by_its_name(
    value: str, message: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    points = EntryPoints([EntryPoint("mine", value, module.ENTRY_POINT_GROUP)])
    monkeypatch.setattr(module, "entry_points_of", lambda group: points.select(group=group))
    module._warn.cache_clear()
    leaves = load_leaves()
    assert "drive" in leaves  # the rest goes on
    assert capsys.readouterr().err.startswith(f"skipped: entry point mine = {value}:1:1: {message}")


# --- on the command line ----------------------------------------------------------------------------------------------


@pytest.mark.usefixtures("folder")
def test_behaviours_option_works_in_every_mission_command(capsys: pytest.CaptureFixture[str]) -> None:
    Path("blink.py").write_text(BLINK)
    Path("counter.py").write_text(COUNTER)
    Path("m.yaml").write_text("mission: m\ntree:\n  sequence: [{blink: 2}, {count_to: 2}]\n")
    files = ("--behaviours", "blink.py", "--behaviours", "counter.py")
    assert command(capsys, "check", "m.yaml").code == 2
    assert command(capsys, "check", "m.yaml", *files).code == 0
    assert "count_to" in command(capsys, "show", "m.yaml", *files).out
    assert "limit: count" in command(capsys, "show", "behaviour", "count_to", *files).out
    assert "blink" in command(capsys, "list", "behaviours", *files).out
    assert command(capsys, "run", "m.yaml", *files).code == 0


@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize("words", [("check",), ("show", "greet"), ("list", "behaviours"), ("run", "greet")])
def test_a_broken_file_is_a_mistake_of_the_user_and_no_traceback(
    words: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    Path("bad.py").write_text("1 / 0\n")
    outcome = command(capsys, *words, "--behaviours", "bad.py")
    assert outcome.code == 2
    assert "bad.py:1:1: cannot be imported: ZeroDivisionError" in outcome.err
    assert "Traceback" not in outcome.err


def test_imports_of_package_and_help_stay_light() -> None:
    heavy = {"py_trees", "cv2", "yaml", "numpy"}
    look = f"import sys, missions, missions.cli.root; print(sorted({heavy} & set(sys.modules)))"
    shown = subprocess.run([sys.executable, "-c", look], capture_output=True, text=True, check=True, timeout=60)
    assert shown.stdout.strip() == "[]"
