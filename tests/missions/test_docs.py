"""The docs agree with the code: tables, missions, robots, worlds, tests and Python of each page."""

import json
import re
import shlex
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from py_trees.common import Status

import missions
from behaviours.catalogue import LEAVES
from behaviours.leaf import Leaf
from config.diagnostics import SourceText
from config.object import load_object
from config.world import parse_world
from config.yaml_nodes import compose
from docs.generate import TABLES, main, renewed
from missions.language.document import check_plan
from missions.library.drivers import load_robot
from missions.library.lookups import LOOKUPS
from missions.library.shipped import find_mission, load_mission
from missions.library.worlds import build_world
from missions.plugins.schema.mission import mission_schema, shipped_things
from missions.plugins.testing.case_runner import IN_PROCESS_LIMITS
from missions.plugins.testing.case_verdict import play
from missions.plugins.testing.recorders import LeafTestBench
from missions.plugins.testing.suite import load_suite
from tests.missions.command import Outcome, command
from tests.missions.test_schema import plain

ROOT = Path(__file__).parents[2]
PAGES = [*sorted((ROOT / "docs").glob("*.md")), ROOT / "README.md"]


@dataclass(frozen=True)
class Block:
    """A fenced block of a page."""

    page: Path
    language: str
    text: str
    line: int

    def __str__(self) -> str:
        return f"{self.page.name}:{self.line}"


def blocks(*languages: str) -> list[Block]:
    found = []
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        for match in re.finditer(r"^```(\S[^\n]*)?\n(.*?)^```$", text, re.DOTALL | re.MULTILINE):
            line = text[: match.start()].count("\n") + 2
            found.append(Block(page, match[1] or "", match[2], line))
    return [block for block in found if block.language in languages]


def leaves_of(page: Path) -> dict[str, type[Leaf]]:
    """The leaves that the code of a page declares."""
    names = namespace(page)
    own = [each for each in names.values() if isinstance(each, type) and issubclass(each, Leaf) and each.tag]
    return {leaf.tag: leaf for leaf in own}


def namespace(page: Path) -> dict[str, Any]:
    """All that the Python of a page defines, run from its first block to its last."""
    names: dict[str, Any] = {"__name__": f"docs_{page.stem}"}
    for block in blocks("python"):
        if block.page == page:
            exec(compile(block.text, str(block), "exec"), names)  # noqa: S102 - our own page, which has to run
    return names


def as_mission(block: Block) -> str:
    """A block as a whole mission: steps alone stand in a sequence, with the params that they read."""
    if not block.text.startswith("- "):
        return block.text
    return "mission: steps\nparams: {way: 1 m}\ntree:\n  sequence:\n" + "".join(
        f"    {line}\n" for line in block.text.splitlines()
    )


def kind_of(block: Block) -> str:
    """The first word of a block of YAML, behind its comments: what sort of file it is."""
    return next(line.split()[0] for line in block.text.splitlines() if line.strip() and not line.startswith("#"))


def of_kind(*kinds: str) -> list[Block]:
    return [block for block in blocks("yaml") if kind_of(block) in kinds]


MISSIONS = of_kind("mission:", "-")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with the files of the tutorial, under the names that it gives them."""
    for name, text in tutorial("mission:", "gesture:").items():
        (tmp_path / f"{name}.yaml").write_text(text, encoding="utf-8")
    for name, text in tutorial("tests:").items():
        (tmp_path / f"{name}.test.yaml").write_text(text, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def tutorial(*kinds: str) -> Mapping[str, str]:
    """The files of the tutorial of these kinds, by name."""
    return {block.text.split()[1]: block.text for block in of_kind(*kinds) if block.page.name == "tutorial.md"}


# Tables


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_tables_of_a_page_are_up_to_date(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert renewed(text) == text, "`make docs` renews the tables"


def test_every_table_and_every_leaf_is_on_a_page() -> None:
    text = "".join(page.read_text(encoding="utf-8") for page in PAGES)
    assert set(re.findall(r"<!-- (\w+): begin -->", text)) == TABLES.keys()
    catalogue = (ROOT / "docs" / "behaviours.md").read_text(encoding="utf-8")
    assert re.findall(r"^## (\w+)$", catalogue, re.MULTILINE) == list(LEAVES)


def test_stale_table_is_replaced_without_changing_the_text_around() -> None:
    page = "before\n<!-- units: begin -->\nold\n<!-- units: end -->\nafter\n"
    new = renewed(page)
    assert new.startswith("before\n<!-- units: begin -->\n| dimension |")
    assert new.endswith("|\n<!-- units: end -->\nafter\n")
    assert "old" not in new


def test_docs_generator_leaves_current_pages_unchanged(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    before = {page: page.read_bytes() for page in PAGES}
    monkeypatch.setattr("docs.dumps.write", list)  # the gallery has its own tests
    main()
    assert capsys.readouterr().out == ""
    assert {page: page.read_bytes() for page in PAGES} == before


def anchors(page: Path) -> set[str]:
    """The anchors that GitHub gives the headings of a page."""
    prose = re.sub(r"^```.*?^```$", "", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)
    headings = re.findall(r"^#+ (.*)$", prose, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def test_every_link_leads_to_a_file_and_a_heading() -> None:
    for page in (*PAGES, *ROOT.glob("*.md")):
        for link, anchor in re.findall(r"\]\(([^)#:]*)(?:#([^)]*))?\)", page.read_text(encoding="utf-8")):
            target = page.parent / link if link else page
            assert target.is_file(), f"{page.name}: {link}"
            assert not anchor or anchor in anchors(target), f"{page.name}: {link}#{anchor}"


def test_the_index_lists_every_page() -> None:
    index = (ROOT / "docs" / "README.md").read_text(encoding="utf-8")
    linked = re.findall(r"^- \[[^]]+\]\(([\w.]+)\):", index, re.MULTILINE)
    assert sorted(linked) == sorted(page.name for page in PAGES if page.name != "README.md")


def test_the_changelog_has_few_and_short_entries() -> None:
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    entries = re.findall(r"^- .*", text.partition("## Unreleased")[2].partition("\n## ")[0], re.MULTILINE)
    assert 50 < len(entries) <= 120
    assert [entry for entry in entries if len(entry) > 100] == []
    assert [line for line in text.splitlines() if line.startswith("  ")] == [], "an entry is one line"


# Missions


def test_every_yaml_block_in_the_docs_is_of_a_checked_kind() -> None:
    assert len(MISSIONS) > 15
    for block in blocks("yaml"):
        assert kind_of(block) in {"mission:", "-", "robot:", "world:", "object:", "tests:", "gesture:"}, block


@pytest.mark.parametrize("block", MISSIONS, ids=str)
def test_each_mission_of_the_docs_passes_the_checker(block: Block, folder: Path) -> None:
    del folder  # where its sub-missions are
    leaves = {**LEAVES, **leaves_of(block.page)}
    text = as_mission(block)
    check_plan(SourceText("docs.yaml", text), leaves, LOOKUPS, find_mission=find_mission)
    schema = mission_schema(leaves, shipped_things())
    jsonschema.Draft7Validator(schema).validate(plain(compose(SourceText("docs.yaml", text))))


@pytest.mark.parametrize("block", of_kind("robot:"), ids=str)
def test_each_robot_file_of_the_docs_loads(block: Block, tmp_path: Path) -> None:
    file = tmp_path / "robot.yaml"
    file.write_text(block.text, encoding="utf-8")
    assert load_robot(file).parts


@pytest.mark.parametrize("block", of_kind("object:"), ids=str)
def test_each_object_file_of_the_docs_loads(block: Block, tmp_path: Path) -> None:
    path = tmp_path / "object.yaml"
    path.write_text(block.text, encoding="utf-8")
    assert load_object(path).summary


@pytest.mark.parametrize("block", of_kind("world:"), ids=str)
def test_each_world_of_the_docs_loads(block: Block) -> None:
    world = build_world(parse_world(SourceText("docs.yaml", block.text)))
    assert world.room.length > 0


@pytest.mark.parametrize("block", of_kind("tests:"), ids=str)
def test_each_test_file_of_the_docs_passes(block: Block, tmp_path: Path) -> None:
    for mission in of_kind("mission:"):
        if mission.page == block.page:
            name = re.findall(r"^mission: (.*)", mission.text, re.MULTILINE)[0]
            (tmp_path / f"{name}.yaml").write_text(mission.text, encoding="utf-8")
    file = tmp_path / "docs.test.yaml"
    file.write_text(block.text, encoding="utf-8")
    for case in load_suite(file):
        assert play(case, limits=IN_PROCESS_LIMITS).misses == ()


# The tutorial


def test_tutorial_mission_matches_the_shipped_one() -> None:
    shown = check_plan(SourceText("greet.yaml", tutorial("mission:")["greet"]), LEAVES, LOOKUPS)
    shipped = load_mission("greet")
    assert [step.kind for step in shown.tree.walk()] == [step.kind for step in shipped.tree.walk()]
    assert shown.params == shipped.params


@pytest.mark.parametrize("name", ["hello", "anybody"])
def test_first_tutorial_missions_run(name: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    del folder
    outcome = command(capsys, "run", f"{name}.yaml", "--json")
    assert outcome.code == 0, outcome.err
    assert json.loads(outcome.out)["result"] == "success"


@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize("name", tutorial("mission:"))
def test_each_mission_of_the_tutorial_runs(name: str) -> None:
    result = missions.run(f"{name}.yaml", simulate="fast", eyes="truth")
    assert result.result == "success", result.reason


def test_each_command_of_the_tutorial_works(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    del folder
    lines = [line[2:] for block in blocks("console") for line in block.text.splitlines() if "tutorial" in str(block)]
    assert lines[0] == "source .venv/bin/activate"
    for line in lines[1:]:
        program, *words = shlex.split(line)
        if program in ("mkdir", "cd"):
            continue
        assert program == "mission"
        if words[0] != "studio":  # a test of the README starts and ends it
            fast = ["--simulate", "fast"] if words[0] == "run" else []
            outcome = command(capsys, *words, *fast)
            assert outcome.code == 0, f"{line}: {outcome.err}"


def test_the_failed_test_of_the_tutorial_is_the_real_one(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    greet = folder / "greet.yaml"
    greet.write_text(greet.read_text(encoding="utf-8").replace("Hello!", "Good day!"), encoding="utf-8")
    (shown,) = (block.text for block in blocks("text") if block.page.name == "tutorial.md")
    assert shown in command(capsys, "test", "greet").out


def test_the_gesture_of_the_tutorial_is_refused_beyond_a_limit(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cheer = folder / "cheer.yaml"
    cheer.write_text(cheer.read_text(encoding="utf-8").replace("80 deg", "179 deg"), encoding="utf-8")
    outcome = command(capsys, "check", "hooray.yaml", "--robot", "turtlebot2_arm")
    assert outcome.code == 2
    assert "shoulder_lift" in outcome.err


def test_the_error_of_the_tutorial_is_the_real_one(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    step = folder / "step.yaml"
    step.write_text(step.read_text(encoding="utf-8").replace("90 deg", "90"), encoding="utf-8")
    outcome: Outcome = command(capsys, "check", "step.yaml")
    assert outcome.code == 2
    (shown,) = (block.text for block in blocks("") if block.page.name == "tutorial.md")
    assert outcome.err == shown


# Leaves


def test_the_leaf_of_the_docs_bows_the_given_number_of_times() -> None:
    bench = LeafTestBench()
    bow = leaves_of(ROOT / "docs" / "leaves.md")["bow"]
    leaf = bench.put(bow(bow.tag), times=3)
    ticks = 0
    while bench.tick(leaf, after=0.1) is Status.RUNNING:
        ticks += 1
        assert ticks < 100
    down = [getattr(command, "tilt", 0.0) > 0 for command in bench.head.commands]
    assert sum(now and not before for before, now in zip([False, *down], down, strict=False)) == 3
    assert down[-1] is False


def test_leaf_example_of_the_docs_is_loaded_from_its_file(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, mission = (next(b for b in blocks(kind) if b.page.name == "leaves.md") for kind in ("python", "yaml"))
    (folder / "bow.py").write_text(code.text, encoding="utf-8")
    (folder / "greet_them.yaml").write_text(mission.text, encoding="utf-8")
    outcome = command(capsys, "check", "greet_them.yaml", "--behaviours", "bow.py")
    assert outcome.code == 0, outcome.err


def test_the_program_of_the_docs_runs_the_mission_of_the_docs(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    page = {kind: next(b for b in blocks(kind) if b.page.name == "leaves.md") for kind in ("python", "yaml", "py")}
    (folder / "bow.py").write_text(page["python"].text, encoding="utf-8")
    (folder / "greet_them.yaml").write_text(page["yaml"].text, encoding="utf-8")
    exec(page["py"].text, {})  # noqa: S102 - the docs are ours
    told = capsys.readouterr().out.splitlines()
    assert (told[0], told[-1].strip()) == ("Status.RUNNING", "success")


def test_example_test_of_the_docs_passes() -> None:
    names = namespace(ROOT / "docs" / "leaves.md")
    tests = [each for name, each in names.items() if name.startswith("test_")]
    assert tests
    for test in tests:
        test()


def test_every_attribute_of_the_leaf_page_exists() -> None:
    page = (ROOT / "docs" / "leaves.md").read_text(encoding="utf-8")
    told = re.findall(r"^\| `(\w+)` \|", page, re.MULTILINE)
    assert len(told) > 8
    assert [name for name in told if not hasattr(Leaf, name)] == []
