"""Trees in the XML of py_trees 2.6 become missions that run as in py_trees."""

from pathlib import Path
from random import Random

import py_trees
import pytest
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from tests.missions.interchange.playing import LeafScript, play_import
from tests.missions.interchange.trees import import_text, tree_lines, tree_text
from tests.tries import tries

TREES = tries(60, most=1000)
FIRST_SEED = 920_000
TICKS = 25
WORDS = {"R": "RUNNING", "S": "SUCCESS", "F": "FAILURE"}


@pytest.mark.parametrize(
    ("node", "lines"),
    [
        ('<Sequence memory="false"><Go/></Sequence>', ["reactive_sequence:", "  - go"]),
        ('<selector memory="True"><Go/></selector>', ["selector:", "  - go"]),
        (
            '<Parallel policy="success_on_one"><Go/><Go/></Parallel>',
            ["parallel:", "  - go", "  - go", "success_count: 1"],
        ),
        ('<Parallel policy="success_on_all"><Go/><Go/></Parallel>', ["parallel:", "  - go", "  - go"]),
        ('<Timeout duration="1.5"><Go/></Timeout>', ["go:", "timeout: 1.5 s"]),
        ('<Retry num_failures="3"><Go/></Retry>', ["go:", "retry: 3"]),
        ("<FailureIsSuccess><Go/></FailureIsSuccess>", ["go:", "on_failure: succeed"]),
        ("<runningisfailure><Go/></runningisfailure>", ["go:", "on_running: fail"]),
        ('<OneShot policy="x"><Go/></OneShot>', ["go:", "once: true"]),
        ("<Count><PassThrough><Go/></PassThrough></Count>", ["go"]),
    ],
)
def test_nodes_of_py_trees_become_words_of_missions(node: str, lines: list[str], tmp_path: Path) -> None:
    assert tree_lines(import_text(tmp_path, tree_text(node, format=""))) == lines


def test_imports_and_keys_of_py_trees_are_read(tmp_path: Path) -> None:
    (tmp_path / "other.xml").write_text(tree_text('<Go to="{place}"/>', format="").replace("Patrol", "Inner"))
    node = '<Sequence><Find place_out="{p}"/><SubTree ID="Inner" name="one" place="{p}"/></Sequence>'
    imported = import_text(tmp_path, tree_text(node, format="", more='<Import src="other.xml"/>'))
    assert tree_lines(imported) == [
        "sequence:",
        "  - find:",
        "    as: p",
        "  - mission: inner",
        "    name: one",
        '    with: {place: "${p}"}',
    ]


class Scripted(Behaviour):
    """Behaviour that gives outcomes in turn, and notes the ends."""

    def __init__(self, name: str, letters: str, ends: list[str]) -> None:
        super().__init__(name)
        self._letters, self._ends, self._given = letters, ends, 0

    def update(self) -> Status:
        letter = self._letters[self._given % len(self._letters)]
        self._given += 1
        if letter != "R":
            self._ends.append(f"{self.name} {letter}")
        return Status[WORDS[letter]]


class Drawing:
    """A random tree, in XML and in py_trees.

    It has no parallel: that of py_trees ticks all its children before it decides.
    """

    def __init__(self, seed: int) -> None:
        self._random = Random(seed)  # noqa: S311 - as a test draws
        self.outcomes: dict[str, str] = {}
        self.ends: list[str] = []
        self._parents = 0

    def node(self, depth: int) -> tuple[str, Behaviour]:
        """Draw a node with its counterpart."""
        random = self._random
        if depth == 0:
            name = f"n{len(self.outcomes)}"
            self.outcomes[name] = "".join(random.choices("RSF", k=random.randint(1, 4)))
            return f'<Probe name="{name}"/>', Scripted(name, self.outcomes[name], self.ends)
        self._parents += 1
        name = f"p{self._parents}"
        if random.random() < 0.3:
            tag, cls = random.choice(
                (
                    ("Inverter", py_trees.decorators.Inverter),
                    ("FailureIsSuccess", py_trees.decorators.FailureIsSuccess),
                    ("SuccessIsFailure", py_trees.decorators.SuccessIsFailure),
                )
            )
            text, child = self.node(depth - 1)
            return f'<{tag} name="{name}">{text}</{tag}>', cls(name=name, child=child)
        texts, children = zip(*(self.node(depth - 1) for _ in range(random.randint(1, 3))), strict=True)
        memory = random.random() < 0.6
        tag, composite = random.choice(
            (("Sequence", py_trees.composites.Sequence), ("Selector", py_trees.composites.Selector))
        )
        text = f'<{tag} name="{name}" memory="{str(memory).lower()}">{"".join(texts)}</{tag}>'
        return text, composite(name=name, memory=memory, children=list(children))


def test_imported_random_trees_run_as_in_py_trees(tmp_path: Path) -> None:
    for seed in range(FIRST_SEED, FIRST_SEED + TREES):
        drawing = Drawing(seed)
        text, root = drawing.node(3)
        text = f'<Sequence memory="true">{text}</Sequence>'  # by which a file of py_trees is recognised
        for _ in range(TICKS):
            root.tick_once()
            if root.status is not Status.RUNNING:
                break
        folder = tmp_path / str(seed)
        folder.mkdir()
        xml = f'<root main_tree_to_execute="Main"><BehaviorTree ID="Main">{text}</BehaviorTree></root>'
        (folder / "tree.xml").write_text(xml)
        scripts = {
            name: LeafScript([WORDS[letter] for letter in letters] * 100) for name, letters in drawing.outcomes.items()
        }
        played = play_import(folder / "tree.xml", folder, "tree", scripts, max_ticks=TICKS)
        ends = [f"{name} {status[0]}" for name, status in played.order if name in scripts and status[0] in "SF"]
        assert (played.result, ends) == (root.status.value, drawing.ends), f"seed {seed}: {xml}"
