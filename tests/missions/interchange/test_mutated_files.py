"""Mutated XML files are imported or refused: no traceback, no hang, and no other file is read or written."""

import ast
import re
import sys
import time
from collections.abc import Iterator
from os.path import realpath
from pathlib import Path
from random import Random
from xml.sax.saxutils import escape

import pytest

from behaviours.catalogue import LEAVES
from config.diagnostics import InvalidFileError, SourceText
from config.file_io import read_regular
from config.yaml_nodes import compose
from missions.plugins.interchange import xml_reader
from missions.plugins.interchange.importer import ImportedProject, import_trees
from tests.tries import tries

TRIES = tries(300, most=10_000)
FIRST_SEED = 380_000
MAX_SECONDS = 5.0
"""Maximum time of one import, on a slow machine."""

TREES = (
    """<?xml version="1.0" encoding="UTF-8"?>
<!-- all kinds of nodes -->
<root BTCPP_format="4" main_tree_to_execute="Main">
  <include path="other.xml"/>
  <BehaviorTree ID="Main"><Sequence name="all">
    <Script code="n := 0; open := true; word := 'a'"/>
    <Parallel success_count="1" failure_count="2"><Sleep msec="50" _while="n &lt; 3" _onHalted="n += 1"/>
      <Go to="{@x}"/></Parallel>
    <Switch2 variable="{word}" case_1="a" case_2="b"><AlwaysSuccess/><AlwaysFailure/><AlwaysSuccess/></Switch2>
    <SubTree ID="Inner" goal="{word}" n="{n}" _autoremap="true"/>
    <WhileDoElse><ScriptCondition code="open &amp;&amp; n == 2"/><Go to="hall"/><Find it="{found}"/></WhileDoElse>
    <RunOnce><Inverter><Go to="x" _skipIf="open" _post="n = n + 1"/></Inverter></RunOnce>
    <SequenceWithMemory><Delay delay_msec="20"><Go to="y"/></Delay><Timeout msec="{n}"><Go to="z"/></Timeout>
    </SequenceWithMemory>
    <LoopDouble queue="1;2;3" value="{v}"><Go to="{v}"/></LoopDouble>
  </Sequence></BehaviorTree>
  <BehaviorTree ID="Inner"><Fallback><Precondition if="n > 2" else="RUNNING"><Go to="{goal}"/></Precondition>
    <RetryUntilSuccessful num_attempts="3"><Find it="{found}"/></RetryUntilSuccessful></Fallback></BehaviorTree>
  <TreeNodesModel><Action ID="Find"><output_port name="it" type="std::string"/></Action></TreeNodesModel>
</root>
""",
    """<root main_tree_to_execute="MainTree"><BehaviorTree ID="MainTree">
  <RecoveryNode number_of_retries="6" name="NavigateRecovery">
    <PipelineSequence><RateController hz="1.0"><ComputePathToPose goal="{goal}" path="{path}"/></RateController>
      <DistanceController distance="1.0"><FollowPath path="{path}"/></DistanceController>
      <GoalUpdatedController><Magic><Wait wait_duration="5"/></Magic></GoalUpdatedController></PipelineSequence>
    <ReactiveFallback><GoalUpdated/><RoundRobin><Spin spin_dist="1.57"/>
      <BackUp backup_dist="{d}"/></RoundRobin></ReactiveFallback>
  </RecoveryNode></BehaviorTree></root>
""",
    """<root BTCPP_format="4" main_tree_to_execute="main">
  <BehaviorTree ID="main">
    <Sequence name="[unskipped]"><AlwaysSuccess/><Sequence>
      <Sequence name="[set] two"><UnsetBlackboard key="z"/><Script code="n := x; word := 'a' .. 'b'"/></Sequence>
      <ReactiveSequence name="[while]"><ScriptCondition code="n &lt; 3"/><Drive distance="{y}" result="{d}"/>
      </ReactiveSequence>
      <Parallel success_count="1" failure_count="1" name="[for]"><Sleep msec="500"/><Hold value="1 s"><Say
        text="yaml: &quot;5&quot;" _skipIf="!(n == 1)"/></Hold></Parallel>
      <IfThenElse name="[switch: '[null, default]']"><ScriptCondition code="n == 2"/><AlwaysFailure
        name="[no_case]"/><Grasp with="yaml: [1, {a: b}]"/></IfThenElse>
      <Switch2 variable="{word}" case_1="a" case_2="b" name="[reactive_switch]"><AlwaysSuccess/><AlwaysFailure
        name="[fail: 'it''s no']"/><AlwaysFailure name="[no_case] [] x"/></Switch2>
      <ParallelAll max_failures="1" name="[parallel: 'success_count: 2, failure_count: all']"><Say/><Say/></ParallelAll>
      <Retry value="2"><Fallback><Set values="yaml: {way: 2 m, list: [1, 2]}"/></Fallback><Log text="again"/></Retry>
      <MissionForEach in="yaml: [1, 2]" as="{m}" number="{k}"><RetryUntilSuccessful num_attempts="-1"
        name="[wait_until]"><ScriptCondition code="true"/></RetryUntilSuccessful></MissionForEach>
      <Sequence name="[prepared]"><Script code="part_p := 2"/><SubTree ID="part" p="{part_p}" q="{n}" _given="p"
        _returns="yaml: {n: q}" _calculated="yaml: {r: &quot;${min(n, 1)}&quot;}" _as="got"/></Sequence>
    </Sequence></Sequence></BehaviorTree>
  <BehaviorTree ID="part"><Script code="q := p"/></BehaviorTree>
  <TreeNodesModel>
    <Action ID="Drive"><description>mission step 'drive': Drive</description></Action>
    <Action ID="Say"><description>mission step 'say': Say</description></Action>
    <Action ID="Log"><description>mission step 'log': Log</description></Action>
    <Action ID="Set"><description>mission step 'set': Set</description></Action>
    <Action ID="Grasp"><description>mission step 'grasp': Grasp</description></Action>
    <Decorator ID="Hold"><description>mission step 'hold': hold</description></Decorator>
    <Control ID="Retry"><description>mission step 'retry': retry</description></Control>
    <Decorator ID="MissionForEach"><description>mission step 'for_each': loop</description></Decorator>
    <SubTree ID="main"><description>yaml: {mission: main, summary: "all", params: {x: 1, y: {default: 1 m, low: 0 m}},
      returns: {found: n}, properties: [{can: succeed}], if_interrupted: retry}</description></SubTree>
    <SubTree ID="part"><description>yaml: {mission: part, params: {p: 1, r: 1}}</description></SubTree>
  </TreeNodesModel></root>
""",
)
TOKENS = (
    *('"', "'", "<", ">", "&", "&amp;", "&#0;", "&x;", "{", "}", "{{", "${", "${a}", "{=}", "{@}", "/>", "<!--"),
    *("-->", "<![CDATA[", "]]>", "<?x y?>", "<!DOCTYPE a SYSTEM '/etc/passwd'>", "<!ENTITY a 'b'>", "xmlns:a='b' "),
    *("<include path='../../../etc/passwd'/>", "<include path='other.xml'/>", "<Sequence>", "</Sequence>", "a:b "),
    *("\0", "\x85", "\u2028", "\ufeff", "é", "😀", "\n\n", "\t", " ", "-1", "1e999", "0x", "nan", "9999999999999999"),
    *(" ID=''", " name='a: b #c'", " name='\"'", " _skipIf='('", " code='a := '", " ID='../../x'", " ID='/etc/x'"),
    *("True", "null", "~", "yes", "&&", "||", ":=", "'", "%", "\\", "'''", '"""', "import os", "def", "class", "*"),
)  # fmt: skip


def mutate(random: Random) -> str:
    """Return a tree with one to eight mutations: of its characters, or of its values and elements only."""
    text = random.choice(TREES)
    change = _change_characters if random.random() < 0.3 else _change_structure
    for _ in range(random.randint(1, 8)):
        text = change(text, random)
    return text


def _change_characters(text: str, random: Random) -> str:
    at, to = random.randrange(len(text) + 1), random.randrange(len(text) + 1)
    match random.randrange(5):
        case 0:
            return text[:at] + random.choice(TOKENS) + text[at:]
        case 1:
            return text[:at] + text[at + random.randint(1, 40) :]
        case 2:
            character = chr(random.choice((random.randrange(128), random.randrange(0xD000))))
            return text[:at] + character + text[at + 1 :]
        case 3:
            return text[:at] + text[min(at, to) : min(at, to) + random.randint(1, 200)] + text[at:]
    return text[:at] + random.choice(TOKENS) * random.randint(1, 300) + text[at:]


def _change_structure(text: str, random: Random) -> str:
    values = [(found.start(1), found.end(1)) for found in re.finditer(r'"([^"]*)"', text)]
    elements = [(found.start(), found.end()) for found in re.finditer(r"<[A-Z][^<>]*/>", text)]
    tags = re.findall(r"<([A-Z]\w*)", text)
    (start, end), (start2, end2) = random.choice(values), random.choice(values)
    match random.randrange(6):
        case 0:
            return text[:start] + text[start2:end2] + text[end:]
        case 1:
            at = random.randint(start, end)
            return text[:at] + escape(random.choice(TOKENS), {'"': "&quot;"}) + text[at:]
        case 2:
            return text[:start] + escape(random.choice(TOKENS) * random.randint(1, 300), {'"': "&quot;"}) + text[end:]
        case 3:
            one, other = random.choice(tags), random.choice(tags)
            return re.sub(rf"(</?){one}\b", rf"\g<1>{other}", text, count=random.randint(0, 4))
        case 4:
            (first, last), (place, _) = random.choice(elements), random.choice(elements)
            return text[:place] + text[first:last] * random.randint(1, 3) + text[place:]
    first, last = random.choice(elements)
    return text[:first] + text[last:]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder outside of which nothing may be read."""
    inside = tmp_path / "inside"
    inside.mkdir()
    (inside / "other.xml").write_text('<root><BehaviorTree ID="Other"><AlwaysSuccess/></BehaviorTree></root>')

    def read_inside(path: Path, max_bytes: int) -> bytes:
        assert Path(realpath(path)).is_relative_to(inside), f"{path} is outside"
        return read_regular(path, max_bytes)

    monkeypatch.setattr(xml_reader, "read_regular", read_inside)
    yield inside
    assert sorted(each.name for each in tmp_path.iterdir()) == ["inside"]


def test_mutated_files_are_imported_or_refused(folder: Path) -> None:
    before = set(sys.modules)
    imported = refused = 0
    for seed in range(FIRST_SEED, FIRST_SEED + TRIES):
        text = mutate(Random(seed))  # noqa: S311 - as a test draws
        path = folder / "tree.xml"
        path.write_bytes(text.encode("utf-8", errors="surrogatepass"))
        start = time.process_time()
        try:
            found = import_trees(path, LEAVES)
        except InvalidFileError as error:
            refused += bool(str(error))
        except Exception as error:
            raise AssertionError(f"seed {seed}: {error!r}\n{text}") from error
        else:
            imported += 1
            check_files(found, seed, text)
        assert time.process_time() - start < MAX_SECONDS, f"seed {seed}"
    assert imported + refused == TRIES
    assert imported > TRIES // 4
    assert not {name for name in set(sys.modules) - before if name.startswith(("tree", "inside"))}


def check_files(found: ImportedProject, seed: int, text: str) -> None:
    """Check that all files lie in the folder and can be parsed."""
    for name, content in found.files.items():
        where = f"seed {seed}: {name}\n{content}\n{text}"
        assert name.count("/") == name.startswith("behaviours/"), where
        assert not set(name) & {"\\", "\0", "\n"}, where
        assert ".." not in name, where
        if name.endswith(".yaml"):
            try:
                compose(SourceText(name, content))
            except InvalidFileError as error:
                raise AssertionError(f"{error}\n{where}") from error
        elif name.endswith(".py"):
            tree = ast.parse(content)
            assert all(isinstance(node, ast.ClassDef | ast.ImportFrom | ast.Expr) for node in tree.body), where
            names = {node.module for node in tree.body if isinstance(node, ast.ImportFrom)}
            assert names <= {"typing", "collections.abc", "py_trees.common", "behaviours.leaf"}, where
