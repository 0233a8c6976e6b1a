"""Exported missions: BehaviorTree.CPP runs them as here, parses all, and an import returns the same tree."""

import re
from collections import Counter
from collections.abc import Iterator, Mapping
from itertools import count, islice
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

from behaviours.catalogue import LEAVES
from behaviours.leaf import FAILURE, Leaf
from config.diagnostics import InvalidFileError
from missions.language.plan import Plan
from missions.plugins.interchange.tree_writer import ExportedTree
from tests.behaviortree_cpp import ask_behaviortree_cpp, needs_behaviortree_cpp
from tests.missions.interchange.playing import LeafScript, play
from tests.missions.interchange.random_missions import Draw, draw_mission
from tests.missions.interchange.round_trips import export_and_import, plan_of, tree_of
from tests.tries import tries

MISSIONS = tries(60, most=500)
TICKS = 30
ENTRIES = ("a", "b", "c", "flag", "word")
WORDS = {"R": "RUNNING", "S": "SUCCESS", "F": "FAILURE"}


class Probe(Leaf):
    """Leaf without arguments; a script replaces it."""

    tag = "probe"
    stub = "replaced by a script"

    def update(self) -> Any:
        return FAILURE


KNOWN: Mapping[str, type[Leaf]] = {**LEAVES, "probe": Probe}


def checked_missions(folder: Path, first_seed: int, *, all_kinds: bool) -> Iterator[tuple[int, Draw, Plan]]:
    """Yield random missions that the checker accepts, with their seeds."""
    for seed in count(first_seed):
        drawn = draw_mission(seed, all_kinds=all_kinds)
        place = folder / f"{seed}"
        place.mkdir()
        for name, text in drawn.files.items():
            (place / name).write_text(text)
        try:
            yield seed, drawn, plan_of(place / "main.yaml", KNOWN)
        except InvalidFileError:
            continue


def parse_request(exported: ExportedTree) -> Mapping[str, Any]:
    """Return a request to parse a tree; a built-in control node stands for custom ones."""
    text = exported.text
    models = ET.fromstring(text.encode()).find("TreeNodesModel")  # noqa: S314 - written by ourselves
    assert models is not None
    nodes = {model.attrib["ID"]: model.tag for model in models if model.tag != "SubTree"}
    for name in [name for name, role in nodes.items() if role == "Control"]:
        text = re.sub(rf"(</?){name}\b", r"\1Sequence", text)
        del nodes[name]
    return {"xml": text, "nodes": nodes}


def plain(value: object) -> object:
    return float(value) if isinstance(value, int | float) else value


@needs_behaviortree_cpp
def test_exported_missions_run_as_in_behaviortree_cpp(tmp_path: Path) -> None:
    cases, requests = list[tuple[int, Draw, Plan]](), list[Mapping[str, Any]]()
    candidates = checked_missions(tmp_path, 900_000, all_kinds=False)
    while len(cases) < MISSIONS:
        seed, drawn, plan = next(candidates)
        exported, path = export_and_import(plan, tmp_path / f"{seed}_again", KNOWN)
        assert tree_of(plan_of(path, KNOWN).tree) == tree_of(plan.tree), seed
        probes = sum(step.leaf is Probe for step in plan.tree.walk())
        if exported.custom > probes:
            continue  # it cannot run there
        cases.append((seed, drawn, plan))
        outcomes = drawn.outcomes
        requests.append(
            {"xml": exported.text, "main": "main", "outcomes": outcomes, "ticks": TICKS, "entries": ENTRIES}
        )
    ended = 0
    for (seed, drawn, plan), (*ticks, values) in zip(cases, ask_behaviortree_cpp(requests), strict=True):
        scripts = {name: LeafScript([WORDS[letter] for letter in text] * 200) for name, text in drawn.outcomes.items()}
        played = play(plan, scripts, max_ticks=TICKS * 8)
        order = [f"{name} {status[0]}" for name, status in played.order if name in drawn.outcomes and status[0] in "SF"]
        expected = [entry for _, ticked, _ in ticks for entry in ticked if entry[-1] != "R"]
        status = ticks[-1][0]
        if "RUNNING" in (status, played.result):  # a mission may need more ticks for the same rounds
            length = min(len(order), len(expected))
            assert order[:length] == expected[:length], seed
            continue
        ended += 1
        assert (played.result, order) == (status, expected), seed
        assert [plain(played.variables.get(name)) for name in ENTRIES] == values, seed
    assert ended > MISSIONS // 3


@needs_behaviortree_cpp
def test_missions_of_all_kinds_are_parsed_there_and_imported_as_the_same_tree(tmp_path: Path) -> None:
    requests, causes = list[Mapping[str, Any]](), Counter[str]()
    for seed, _, plan in islice(checked_missions(tmp_path, 910_000, all_kinds=True), MISSIONS):
        exported, path = export_and_import(plan, tmp_path / f"{seed}_again", KNOWN)
        assert tree_of(plan_of(path, KNOWN).tree) == tree_of(plan.tree), seed
        requests.append(parse_request(exported))
        causes.update(str(remark.text) for remark in exported.remarks)
    assert ask_behaviortree_cpp(requests) == [[] for _ in requests]
    assert len(causes) > 10
