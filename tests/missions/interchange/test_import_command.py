"""``mission import`` writes missions, stubs and a report, and nothing over existing files."""

from collections.abc import Callable
from os import mkfifo
from pathlib import Path

import pytest

from tests.missions.command import Outcome, command
from tests.missions.interchange.trees import tree_text

Mission = Callable[..., Outcome]


@pytest.fixture
def mission(capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Mission:
    monkeypatch.chdir(tmp_path)
    return lambda *words: command(capsys, *words)


GRASP = '<Sequence><Sleep msec="50"/><Grasp force="3"/></Sequence>'


def test_an_imported_mission_is_checked_shown_and_mocked_but_not_run(mission: Mission, tmp_path: Path) -> None:
    (tmp_path / "tree.xml").write_text(tree_text(GRASP))
    done = mission("import", "tree.xml", "-o", "made")
    assert done.code == 0
    assert "tree.xml:1: Grasp: the stub leaf 'grasp'" in done.out
    assert "wrote 1 mission and 1 stub leaf to made" in done.out
    assert "the stub leaf 'grasp'" in (tmp_path / "made" / "IMPORTED.md").read_text()
    assert mission("check", "made").code == 0
    assert "grasp" in mission("show", "made/patrol.yaml").out
    refused = mission("run", "made/patrol.yaml", "--simulate", "fast")
    assert refused.code == 2
    assert "'grasp' is a stub, which cannot run" in refused.err
    assert "write its update in behaviours/tree.py, or mock it" in refused.err
    case = "tests: patrol\ncases: [{case: mocked, given: [{grasp: succeeds}], expect: {result: success, ran: grasp}}]\n"
    (tmp_path / "made" / "patrol.test.yaml").write_text(case)
    assert mission("test", "made/patrol.test.yaml", "--jobs", "1").code == 0


def test_stub_runs_after_its_update_is_implemented(mission: Mission, tmp_path: Path) -> None:
    (tmp_path / "tree.xml").write_text(tree_text(GRASP))
    mission("import", "tree.xml", "-o", "made")
    file = tmp_path / "made" / "behaviours" / "tree.py"
    lines = [line for line in file.read_text().splitlines() if not line.strip().startswith("stub =")]
    refusal = next(line for line in lines if "self.fail(" in line)
    written = "\n".join(lines).replace(refusal, "        return Status.SUCCESS")
    file.write_text(written + "\n")
    assert mission("run", "made/patrol.yaml", "--simulate", "fast").code == 0


def test_leaves_named_like_words_of_missions_get_other_tags(mission: Mission, tmp_path: Path) -> None:
    words = ("Summary", "Params", "Recover", "Finally", "InTurn", "Tree", "Drive", "Name")
    leaves = "".join(f"<{word}/>" for word in words)
    (tmp_path / "tree.xml").write_text(tree_text(f"<Sequence>{leaves}</Sequence>"))
    mission("import", "tree.xml", "-o", "made")
    assert mission("check", "made").out.startswith("made/patrol.yaml: good")


def test_existing_files_are_kept_without_force(mission: Mission, tmp_path: Path) -> None:
    (tmp_path / "tree.xml").write_text(tree_text("<AlwaysSuccess/>"))
    (tmp_path / "made").mkdir()
    (tmp_path / "made" / "patrol.yaml").write_text("mine")
    refused = mission("import", "tree.xml", "-o", "made")
    assert refused.code == 2
    assert "patrol.yaml already exists" in refused.err
    assert "--force" in refused.err
    assert (tmp_path / "made" / "patrol.yaml").read_text() == "mine"
    assert not (tmp_path / "made" / "IMPORTED.md").exists()
    assert mission("import", "tree.xml", "-o", "made", "--force").code == 0
    assert (tmp_path / "made" / "patrol.yaml").read_text() != "mine"


def test_second_import_keeps_written_leaves_and_adds_new_stubs(mission: Mission, tmp_path: Path) -> None:
    (tmp_path / "tree.xml").write_text(tree_text(GRASP))
    mission("import", "tree.xml", "-o", "made")
    file = tmp_path / "made" / "behaviours" / "tree.py"
    written = file.read_text().replace("    stub = ", "    note = ") + "\n\nclass Lift(Leaf):\n    tag = 'raise'\n"
    file.write_text(written)
    (tmp_path / "made" / "behaviours" / "own.py").write_text(
        written.replace("'raise'", '"own"').replace("grasp", "see")
    )
    (tmp_path / "tree.xml").write_text(
        tree_text('<Sequence><Grasp force="3"/><Lift/><Find output_a="{a}" output_b="{b}"/><See force="3"/></Sequence>')
    )
    refused = mission("import", "tree.xml", "-o", "made")
    assert "the leaves in FOLDER/behaviours are kept" in refused.err
    done = mission("import", "tree.xml", "-o", "made", "--force")
    assert "wrote 1 mission and 2 stub leaves to made\nkept the leaves in made/behaviours/tree.py" in done.out
    text = file.read_text()
    assert text.startswith(written.rstrip())
    assert "\nfrom collections.abc import Mapping\nfrom typing import Any\n" in text
    assert "class Lift_(Leaf):" in text
    assert 'tag = "see"' not in text
    assert mission("check", "made").code == 0
    assert mission("import", "tree.xml", "-o", "made", "--force").code == 0
    assert file.read_text() == text


def test_second_import_adds_no_stub_for_leaves_of_other_files(mission: Mission, tmp_path: Path) -> None:
    (tmp_path / "tree.xml").write_text(tree_text(GRASP))
    mission("import", "tree.xml", "-o", "made")
    folder = tmp_path / "made" / "behaviours"
    own = (folder / "tree.py").rename(folder / "writ.py")
    own.write_text(own.read_text().replace("    stub = ", "    note = "))
    done = mission("import", "tree.xml", "-o", "made", "--force")
    assert "wrote 1 mission to made\n" in done.out
    assert list(folder.glob("*.py")) == [own]
    (tmp_path / "tree.xml").write_text(tree_text('<Sequence><Grasp force="3"/><Lift/></Sequence>'))
    done = mission("import", "tree.xml", "-o", "made", "--force")
    assert "wrote 1 mission and 1 stub leaf to made\n" in done.out
    text = (folder / "tree.py").read_text()
    assert text.startswith('"""Stub leaves of tree.xml')
    assert "class Lift(Leaf)" in text
    assert "grasp" not in text
    assert not mission("check", "made").err.count("skipped")


def test_report_of_a_second_import_separates_written_leaves_from_stubs(mission: Mission, tmp_path: Path) -> None:
    (tmp_path / "tree.xml").write_text(tree_text('<Sequence><Grasp force="3"/><Lift/></Sequence>'))
    mission("import", "tree.xml", "-o", "made")
    file = tmp_path / "made" / "behaviours" / "tree.py"
    file.write_text(file.read_text().replace("    stub = ", "    note = ", 1))
    done = mission("import", "tree.xml", "-o", "made", "--force")
    stub, leaf = "tree.xml:1: Lift: the stub leaf 'lift'", "tree.xml:1: Grasp: the leaf 'grasp'"
    assert f"until you write them:\n  {stub}\nLeaves that you have written:\n  {leaf}\n" in done.out
    report = (tmp_path / "made" / "IMPORTED.md").read_text()
    assert f"## Leaves that you have written\n\n- {leaf}" in report


def test_second_import_names_outdated_stubs_and_refuses_broken_files(mission: Mission, tmp_path: Path) -> None:
    (tmp_path / "tree.xml").write_text(tree_text(GRASP))
    mission("import", "tree.xml", "-o", "made")
    (tmp_path / "tree.xml").write_text(tree_text(GRASP.replace("force", "power")))
    done = mission("import", "tree.xml", "-o", "made", "--force")
    assert "'grasp' is a stub with other ports: to replace it, delete its class" in done.out
    (tmp_path / "tree.xml").write_text(tree_text(GRASP))
    file = tmp_path / "made" / "behaviours" / "tree.py"
    file.write_text(file.read_text().replace("        return self", "        del self.force\n        return self"))
    assert "is a stub with" not in mission("import", "tree.xml", "-o", "made", "--force").out
    file.write_text("class Grasp(\n")
    refused = mission("import", "tree.xml", "-o", "made", "--force")
    assert refused.code == 2
    assert "tree.py:1:1: not valid Python: '(' was never closed\n" in refused.err


def test_links_in_the_folder_are_not_followed(mission: Mission, tmp_path: Path) -> None:
    (tmp_path / "tree.xml").write_text(tree_text(GRASP))
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "made").mkdir()
    (tmp_path / "made" / "behaviours").symlink_to(tmp_path / "elsewhere")
    assert "is a link" in mission("import", "tree.xml", "-o", "made", "--force").err
    assert not list((tmp_path / "elsewhere").iterdir())


def test_import_over_a_pipe_is_refused(mission: Mission, tmp_path: Path) -> None:
    (tmp_path / "tree.xml").write_text(tree_text("<AlwaysSuccess/>"))
    (tmp_path / "made").mkdir()
    mkfifo(tmp_path / "made" / "patrol.yaml")
    assert "not a regular file" in mission("import", "tree.xml", "-o", "made", "--force").err


def test_report_has_no_links_of_the_file(mission: Mission, tmp_path: Path) -> None:
    (tmp_path / "tree.xml").write_text(tree_text('<Action ID="![x](http://x)"/>'))
    mission("import", "tree.xml", "-o", "made")
    assert "!\\[x](http://x)" in (tmp_path / "made" / "IMPORTED.md").read_text()


def test_mistakes_are_reported_with_their_place(mission: Mission, tmp_path: Path) -> None:
    (tmp_path / "broken.xml").write_text("<root>\n<A></B></root>")
    assert "broken.xml:2:" in mission("import", "broken.xml", "-o", "made").err
    (tmp_path / "other.xml").write_text("<package><name>robot</name></package>")
    assert "not a behaviour tree" in mission("import", "other.xml", "-o", "made").err
    (tmp_path / "empty.xml").write_text("<root/>")
    assert "no tree in this file" in mission("import", "empty.xml", "-o", "made").err
    (tmp_path / "folder").mkdir()
    assert "no XML file with behaviour trees" in mission("import", "folder", "-o", "made").err
    assert not (tmp_path / "made").exists()


def test_import_of_a_folder_reports_unreadable_files(mission: Mission, tmp_path: Path) -> None:
    (tmp_path / "trees").mkdir()
    (tmp_path / "trees" / "a.xml").write_text(tree_text('<SubTree ID="Dock"/>'))
    (tmp_path / "trees" / "b.xml").write_text(tree_text("<AlwaysSuccess/>").replace("Patrol", "Dock"))
    (tmp_path / "trees" / "c.xml").write_text("<root><A>")
    (tmp_path / "trees" / "package.xml").write_text("<package/>")
    done = mission("import", "trees", "-o", "made")
    assert "wrote 2 missions" in done.out
    assert "c.xml:1: file: not well-formed XML" in done.out
    assert "package.xml" not in done.out
    assert mission("check", "made").code == 0


def test_includes_stay_in_the_folder(mission: Mission, tmp_path: Path) -> None:
    (tmp_path / "secret.xml").write_text(tree_text("<AlwaysSuccess/>").replace("Patrol", "Secret"))
    folder = tmp_path / "trees"
    folder.mkdir()
    (folder / "link.xml").symlink_to(tmp_path / "secret.xml")
    includes = "".join(f'<include path="{path}"/>' for path in ("../secret.xml", "link.xml", "/etc/passwd", "more.xml"))
    more = '<include ros_pkg="nav2" path="x.xml"/>'
    (folder / "main.xml").write_text(tree_text('<SubTree ID="Secret"/>', more=includes + more))
    (folder / "more.xml").write_text(tree_text("<AlwaysSuccess/>").replace("Patrol", "More"))
    done = mission("import", "trees/main.xml", "-o", "made")
    assert done.out.count("is outside the folder") == 3
    assert "includes from a ROS package are not followed" in done.out
    assert (tmp_path / "made" / "more.yaml").exists()
    assert not (tmp_path / "made" / "secret.yaml").exists()


def test_circular_includes_are_refused(mission: Mission, tmp_path: Path) -> None:
    for name, other in (("a", "b"), ("b", "a")):
        tree = tree_text("<AlwaysSuccess/>", more=f'<include path="{other}.xml"/>').replace("Patrol", name.upper())
        (tmp_path / f"{name}.xml").write_text(tree)
    done = mission("import", "a.xml", "-o", "made")
    assert "includes itself" in done.out + done.err


def test_a_table_of_leaves_maps_leaves_and_units(mission: Mission, tmp_path: Path) -> None:
    node = '<Sequence><SaySomething message="Hello"/><Retreat far="0.5"/><SaySomething message="{words}"/></Sequence>'
    (tmp_path / "tree.xml").write_text(tree_text(node))
    table = """leaves:
  SaySomething: {leaf: say, ports: {message: text}}
  Retreat: {leaf: drive, ports: {far: -distance in m}}
"""
    (tmp_path / "table.yaml").write_text(table)
    assert mission("import", "tree.xml", "-o", "made", "--leaves", "table.yaml").code == 0
    text = (tmp_path / "made" / "patrol.yaml").read_text()
    assert "- say: Hello" in text
    assert "- drive: -0.5 m" in text
    assert '- say: "${words}"' in text
    assert mission("check", "made").code == 0


def import_with(mission: Mission, folder: Path, node: str, table: str) -> Outcome:
    """Import one tree with a table of leaves, of which ``table`` has the entries."""
    (folder / "tree.xml").write_text(tree_text(node))
    (folder / "table.yaml").write_text(f"leaves: {{{table}}}")
    return mission("import", "tree.xml", "-o", "made", "--leaves", "table.yaml", "--force")


@pytest.mark.parametrize(
    ("node", "table", "line"),
    [
        ("<Go/>", "Go: {leaf: drive}", "tree.xml:1: Go: the stub leaf 'go': 'drive' needs 'distance', which no port"),
        ("<Go/>", "Goo: {leaf: drive}", "table.yaml:1: no tree has a leaf 'Goo'; did you mean 'Go'?"),
        ('<Go a="x"/>', "Go: {leaf: say, ports: {a: text, aa: voice}}", "table.yaml:1: no node 'Go' has a port 'aa'"),
        ("<Go/>", "Go: {outputs: [pose]}", "table.yaml:1: no node 'Go' has a port 'pose'"),
        (
            '<Go pose="0;0;0"/>',
            "Go: {leaf: drive, ports: {pose: distance in m}}",
            "the stub leaf 'go': the port 'pose': 'distance' needs a length",
        ),
        (
            '<Go pose="true"/>',
            "Go: {leaf: drive, ports: {pose: distance in m}}",
            "; 'drive' needs 'distance', which no port gives",
        ),
        (
            '<Go far="1" v="x"/>',
            "Go: {leaf: drive, ports: {far: distance in m, v: speed in m/s}}",
            "Go: the port 'v': 'speed' needs a speed",
        ),
        (
            '<Sequence><CountPoses n="{n}"/><Say t="{n}"/></Sequence>',
            "CountPoses: {leaf: nod}",
            "CountPoses: the port 'n', which seems to be an output: it is not in the table",
        ),
        (
            '<Sequence><Find who="{n}"/><Say t="{n}"/></Sequence>',
            "Find: {leaf: find_face}",
            "Find: its output seems to be 'who'; if so, add outputs: [who] to your table",
        ),
    ],
)
def test_entry_of_a_table_without_effect_is_reported(
    node: str, table: str, line: str, mission: Mission, tmp_path: Path
) -> None:
    done = import_with(mission, tmp_path, node, table)
    assert done.code == 0
    assert line in done.out
    assert mission("check", "made").code == 0


def test_leaf_of_the_user_with_the_name_of_a_stub_is_offered_for_the_table(mission: Mission, tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text('from behaviours.leaf import Leaf\n\n\nclass Find(Leaf):\n    tag = "find_it"\n')
    (tmp_path / "tree.xml").write_text(tree_text("<FindIt/>"))
    done = mission("import", "tree.xml", "-o", "made", "--behaviours", "own.py")
    assert (
        "stub leaf 'find_it_action': 'find_it' exists; to use it, add to your table of leaves: FindIt: {l" in done.out
    )
    (tmp_path / "table.yaml").write_text("leaves: {FindIt: {leaf: find_it}}")
    done = mission("import", "tree.xml", "-o", "new", "--behaviours", "own.py", "--leaves", "table.yaml")
    assert done.out.endswith("next: mission check new --behaviours own.py\n")
    assert mission("check", "new", "--behaviours", "own.py").code == 0


def test_table_gives_constants_and_replaces_known_leaves_and_missing_trees(mission: Mission, tmp_path: Path) -> None:
    node = '<Sequence><Grasp/><Listen/><Sleep msec="5"/><SubTree ID="Bow"/></Sequence>'
    table = """Grasp: {leaf: gesture, with: {gesture: hello}}, Sleep: {leaf: say, ports: {msec: text}},
      Listen: {leaf: listen, with: {for: ["yes", "no"], timeout: 5 s}}, Bow: {leaf: nod}"""
    assert import_with(mission, tmp_path, node, table).out.startswith("wrote 1 mission to made")
    lines = (tmp_path / "made" / "patrol.yaml").read_text().splitlines()[-4:]
    assert lines == [
        "    - gesture: hello",
        "    - listen: {for: [yes, no], timeout: 5 s}",
        "    - say: 5",
        "    - nod",
    ]
    assert mission("check", "made").code == 0


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ("leaves: {A: {leaf: drive, with: {distance: red}}}", "'distance' needs a length"),
        ("leaves: {A: {leaf: drive, with: {far: 1 m}}}", "'drive' has no argument 'far'"),
        ('leaves: {A: {leaf: say, with: {text: "${x}"}}}', "'with' takes constants"),
        ("leaves: {A: {leaf: say, with: hello}}", "'with' needs arguments and values"),
        ("leaves: {A: {leaf: say, with: {text: hello}, ports: {x: text}}}", "has a constant in 'with' and the port"),
        ("leaves: {A: {with: {text: hello}}}", "'with' needs a 'leaf' beside it"),
        ("leaves: {A: {outputs: pose}}", "'outputs' needs a list"),
        ("leaves: {A: {leaf: nod, outputs: [pose]}}", "'nod' has no output"),
        ("leaves: {A: {leaf: drive, ports: {x: distance in s}}}", "the unit 's' does not suit 'distance', a length"),
        ("leaves: {A: {leaf: nod, ports: {x: timeout}}}", "'nod' has no argument 'timeout'"),
        ("leaf: {}", "needs the key 'leaves'"),
        ("leaves: {A: {leaf: sya}}", "unknown behaviour 'sya'"),
        ("leaves: {A: {leaf: say, ports: {x: words}}}", "'say' has no argument 'words'"),
        ("leaves: {A: {leaf: drive, ports: {x: distance in mile}}}", "unknown unit 'mile'"),
        ("leaves: {A: {leafs: drive}}", "unknown key 'leafs'"),
        ("leaves: {A: drive}", "write {leaf: NAME"),
    ],
)
def test_mistakes_in_a_table_are_reported(table: str, message: str, mission: Mission, tmp_path: Path) -> None:
    (tmp_path / "tree.xml").write_text(tree_text("<AlwaysSuccess/>"))
    (tmp_path / "table.yaml").write_text(table)
    refused = mission("import", "tree.xml", "-o", "made", "--leaves", "table.yaml")
    assert refused.code == 2
    assert message in refused.err
