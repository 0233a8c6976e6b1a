"""Examples of leaves: each is a valid step with the tag of its leaf, and `mission show` prints it."""

from pathlib import Path

import pytest

from behaviours.catalogue import LEAVES
from behaviours.leaf import Leaf
from config.diagnostics import SourceText
from missions.language.document import check_plan
from missions.library.lookups import LOOKUPS
from tests.missions.command import command


@pytest.mark.parametrize("tag", LEAVES)
def test_example_of_a_leaf_is_a_valid_step(tag: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("bell.wav").touch()
    steps = "".join(f"    {line}\n" for line in LEAVES[tag].example.splitlines())
    plan = check_plan(SourceText("example.yaml", f"mission: example\ntree:\n  sequence:\n{steps}"), LEAVES, LOOKUPS)
    assert tag in [step.kind for step in plan.tree.walk()]


def test_show_prints_the_example_of_a_behaviour(capsys: pytest.CaptureFixture[str]) -> None:
    shown = command(capsys, "show", "behaviour", "drive")
    assert shown.code == 0
    assert shown.out.endswith("\n  example:\n    - drive: 0.5 m\n")


def test_old_name_of_a_declaration_is_refused_with_the_new_name() -> None:
    with pytest.raises(TypeError, match=r"Bow: the attribute 'word' of a leaf is called 'tag' now"):
        type("Bow", (Leaf,), {"word": "bow"})
