"""`mission check --fix` rewrites old forms of the mission language, and leaves every other character of a file."""

from collections.abc import Callable
from errno import ENOSPC
from pathlib import Path

import pytest
from py_trees.common import Status

from behaviours.catalogue import LEAVES
from config.diagnostics import SourceText
from missions.cli import check
from missions.executive.events import status_word
from missions.language.document import check_plan
from missions.language.old_forms import Rewrite, rewrite_old_forms
from missions.library.shipped import shipped_missions
from tests.conformance.harness import Play
from tests.conformance.probes import Probe
from tests.missions.command import command

HEAD = "mission: m\nparams: {n: 1, time: {default: 9 s, low: 1 s}, any: 9 s}\ntree:\n  sequence:\n"

REWRITTEN = {
    "    - succeed:\n      while: n > 0   # ours\n": "    - check: n > 0   # ours\n",
    "    - {succeed: , while: n > 0}\n": "    - {check: n > 0}\n",
    "    - succeed:\n      while: ${n > 0}\n      name: ok\n": "    - check: ${n > 0}\n      name: ok\n",
    "    - succeed:\n      while: n > 0\n      retry: forever\n": "    - wait_until: n > 0\n",
    "    - {succeed: , while: 'n > 0', retry: forever, timeout: 1 s}\n": "    - {wait_until: 'n > 0', timeout: 1 s}\n",
    "    - succeed:\n      while: face.seen\n      retry: forever\n": "    - check: face.seen\n      retry: forever\n",
    "    - fail:\n      if: n > 1\n    - succeed\n": "    - check: not (n > 1)\n    - succeed\n",
    "    - fail:\n      if: not base.docked\n    - succeed\n": "    - check: base.docked\n    - succeed\n",
    '    - {fail: , if: "n > 1"}\n    - succeed\n': '    - {check: "not (n > 1)"}\n    - succeed\n',
    "    - race:\n        - nod\n        - wait: 5 s\n": "    - nod:\n      for: 5 s\n",
    "    - race:\n        - wait: 5 s\n        - nod  # yes\n": "    - nod:  # yes\n      for: 5 s\n",
    "    - race:\n        - wait: 5 s\n        - 'nod'\n": None,
    "    - race:\n        - drive: 1 m\n          name: a\n        - wait: 5 s  # enough\n      retry: 2\n": (
        "    - drive: 1 m\n      name: a\n      for: 5 s  # enough\n      retry: 2\n"
    ),
    "    - race:\n        - wait: ${time}\n        - sequence:\n            - nod\n\n            - nod": (
        "    - sequence:\n        - nod\n\n        - nod\n      for: ${time}\n"
    ),
    "    - race:\n        - drive: 1 m\n        - wait: ${any}\n": None,  # which may be 0 s
    "    - race:\n        - drive: 1 m\n        - wait: 0 s\n": None,
    "    - race:\n        - drive: 1 m\n        - wait: 5 s\n      name: way\n": None,  # the name would be lost
    "    - race:   # either\n        - drive: 1 m\n        - wait: 5 s\n": None,
    "    - race:\n        # slowly\n        - drive: 1 m\n        - wait: 5 s\n": None,
    "    - race:\n        - drive: 1 m\n          for: 2 s\n        - wait: 5 s\n": None,
    "    - race: [{drive: 1 m}, {wait: 5 s}]\n": None,
    "    - succeed:  # why\n      while: n > 0\n": None,
    "    - succeed:\n      name: ok\n      while: n > 0\n": None,
    "    - fail: no way\n      if: n > 1\n    - succeed\n": None,  # its reason would be lost
    "    - fail:\n      if: n > 1\n": None,  # the sequence would succeed where it was skipped
    "    - fail:\n      if: n > 1\n      on_failure: succeed\n    - succeed\n": None,
    "    - selector:\n        - fail:\n          if: n > 1\n        - succeed\n": None,
    # The other child may be skipped, and the sequence with it.
    "    - fail:\n      if: n > 1\n    - sequence:\n        - nod:\n          if: n > 2\n": None,
    # A skipped behaviour leaves the race to the wait.
    "    - race:\n        - nod:\n          if: n > 1\n        - wait: 5 s\n": None,
    # With a silent sensor, a race and a `for` are treated differently there.
    "    - reactive_sequence:\n        - race:\n            - drive: 1 m\n            - wait: 5 s\n": None,
    "    - race:\n        - drive: 1 m\n        - wait: 5 s\n      while: face.seen\n": None,
    "    - set: {a: {succeed: , while: n}, b: [{fail: , if: n}, 1]}\n": None,  # data
    "    - selector:\n        - &a {succeed: , while: n > 0}\n    - *a\n": None,
    '    - race:\n        - wait: 5 s\n        - say: "two\n      lines"\n': None,
    "    - race:\n        - wait: 5 s\n        - say: |+\n            two\n\n": None,
    '    - race:\n        - say: "🤖\n      lines"\n        - wait: 5 s\n': (
        '    - say: "🤖\n  lines"\n      for: 5 s\n'
    ),
    "    - say: 🤖\n    - {succeed: , while: n > 0, name: 🤖}  # 🤖 \t": (
        "    - say: 🤖\n    - {check: n > 0, name: 🤖}  # 🤖 \t"
    ),
}
"""Nodes of a mission, and the same nodes rewritten; None if they are left."""


@pytest.mark.parametrize("line_end", ["\n", "\r\n"])
@pytest.mark.parametrize("old", REWRITTEN)
def test_old_forms_are_rewritten_and_all_else_is_left(old: str, line_end: str) -> None:
    text = (HEAD + old).replace("\n", line_end)
    new, rewrites = rewrite_old_forms("m.yaml", text)
    wanted = REWRITTEN[old]
    assert new == (text if wanted is None else (HEAD + wanted).replace("\n", line_end))
    assert len(rewrites) == (wanted is not None)


def test_rewrite_that_is_not_accepted_leaves_the_others() -> None:
    old = "    - {succeed: , while: n > 0, timeout: 1 s}\n    - {succeed: , while: n > 0}\n"
    new, _ = rewrite_old_forms("m.yaml", HEAD + old, lambda text: "check: n > 0, timeout" not in text)
    assert new == HEAD + "    - {succeed: , while: n > 0, timeout: 1 s}\n    - {check: n > 0}\n"


def test_shipped_missions_have_no_old_forms() -> None:
    for path in shipped_missions().values():
        assert rewrite_old_forms(path.name, path.read_text(encoding="utf-8"))[1] == []


def test_all_old_forms_of_a_file_are_rewritten_innermost_too() -> None:
    old = (
        "    - race:\n        - sequence:\n            - succeed:\n              while: n > 0\n"
        "            - {fail: , if: n > 1}\n            - nod\n        - wait: 5 s\n"
    )
    new, rewrites = rewrite_old_forms("m.yaml", HEAD + old)
    assert new == HEAD + (
        "    - sequence:\n        - check: n > 0\n        - {check: not (n > 1)}\n        - nod\n      for: 5 s\n"
    )
    assert sorted(rewrite.new for rewrite in rewrites) == ["check", "check", "for"]


PLAYED = [
    "sequence:\n  - succeed:\n    while: battery.percent > 20\n  - probe: success\n    name: a\n",
    "selector:\n  - succeed:\n    while: battery.percent > 20\n  - probe: success\n    name: a\n",
    "sequence:\n  - fail:\n    if: battery.percent < 20\n  - probe: success\n    name: a\n",
    "race:\n  - probe: [running, running, running, running, success]\n    name: a\n  - wait: 250 ms\n",
    "race:\n  - wait: 250 ms\n  - probe: [running, failure]\n    name: a\n",
    "reactive_sequence:\n  - succeed:\n    while: battery.percent > 20\n  - probe: running\n    name: a\n",
]


@pytest.mark.parametrize("tree", PLAYED)
@pytest.mark.parametrize("levels", [(80, 80, 80, 80, 80, 80), (10, 80, 10, 80, 10, 80), (80, 80, 10, 10, 10, 10)])
def test_a_rewritten_tree_does_the_same(tree: str, levels: tuple[int, ...]) -> None:
    old = "mission: m\ntree:\n" + "".join(f"  {line}\n" for line in tree.splitlines())
    new, rewrites = rewrite_old_forms("m.yaml", old)
    assert rewrites
    played = []
    for text in (old, new):
        plan = check_plan(SourceText("m.yaml", text), {**LEAVES, Probe.tag: Probe}, {})
        play = Play(plan, {"battery": {"percent": 80}})
        lines = []
        for level in levels:
            lines.append(play.line(f"with battery.percent = {level}", 0.1))
            if play.root.status is not Status.RUNNING:
                break
        starts_and_ends = [[each for each in line.split(", ") if each.startswith("a ")] for line in lines]
        played.append((starts_and_ends, status_word(play.root)))
    assert played[0] == played[1]


OLD = b"\xef\xbb\xbfmission: m\r\ntree:\r\n  succeed:\r\n  while: 1 < 2"


def test_fix_replaces_the_file_and_names_each_rewrite(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("m.yaml").write_bytes(OLD)
    assert command(capsys, "check", "m.yaml").out == "m.yaml: good (m, 2 nodes)\n"
    assert Path("m.yaml").read_bytes() == OLD
    done = command(capsys, "check", "--fix", "m.yaml")
    assert (done.code, done.out) == (0, "m.yaml: good (m, 2 nodes)\nm.yaml:3: rewritten as 'check'\n")
    assert Path("m.yaml").read_bytes() == b"\xef\xbb\xbfmission: m\r\ntree:\r\n  check: 1 < 2"
    assert command(capsys, "check", "--fix", "m.yaml").out == "m.yaml: good (m, 1 node)\nm.yaml: no old form\n"
    assert [path.name for path in tmp_path.iterdir()] == ["m.yaml"]


def test_fix_leaves_a_file_with_errors(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    text = "mission: m\ntree:\n  sequence:\n    - {succeed: , while: 1 < 2}\n    - nodd\n"
    Path("m.yaml").write_text(text, encoding="utf-8")
    done = command(capsys, "check", "--fix", "m.yaml")
    assert done.code == 2
    assert "rewritten" not in done.out + done.err
    assert Path("m.yaml").read_text(encoding="utf-8") == text


def test_fix_follows_a_symbolic_link_and_leaves_hard_links(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("m.yaml").write_bytes(OLD)
    Path("hard.yaml").hardlink_to("m.yaml")
    Path("soft.yaml").symlink_to("m.yaml")
    assert "hard links" in command(capsys, "check", "--fix", "soft.yaml").out
    assert Path("hard.yaml").read_bytes() == OLD
    Path("hard.yaml").unlink()
    Path("m.yaml").chmod(0o640)
    assert "rewritten as 'check'" in command(capsys, "check", "--fix", "soft.yaml").out
    assert Path("soft.yaml").is_symlink()
    assert b"check" in Path("m.yaml").read_bytes()
    assert Path("m.yaml").stat().st_mode & 0o777 == 0o640


def test_fix_leaves_a_form_without_which_the_file_would_have_errors(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    left = "    - {succeed: , while: 1 < 2, timeout: 1 s}\n"  # a check with a timeout is an error
    head = "mission: m\ntree:\n  sequence:\n" + left
    Path("m.yaml").write_text(head + "    - {succeed: , while: 1 < 2}\n", encoding="utf-8")
    assert "m.yaml:5: rewritten as 'check'\n" in command(capsys, "check", "--fix", "m.yaml").out
    assert Path("m.yaml").read_text(encoding="utf-8") == head + "    - {check: 1 < 2}\n"
    assert "no old form" in command(capsys, "check", "--fix", "m.yaml").out


def test_fix_leaves_a_file_that_changes_meanwhile(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("m.yaml").write_bytes(OLD)

    def rewrite_slowly(name: str, text: str, accepts: Callable[[str], bool]) -> tuple[str, list[Rewrite]]:
        Path("m.yaml").write_bytes(OLD + b"  # mine")
        return rewrite_old_forms(name, text, accepts)

    monkeypatch.setattr(check, "rewrite_old_forms", rewrite_slowly)
    assert "has changed meanwhile" in command(capsys, "check", "--fix", "m.yaml").out
    assert Path("m.yaml").read_bytes() == OLD + b"  # mine"


def test_fix_without_files_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    done = command(capsys, "check", "--fix")
    assert done.code == 2
    assert "mission check --fix FILE" in done.err


def test_fix_names_a_file_that_cannot_be_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("m.yaml").write_bytes(OLD)

    def refuse(path: Path, _text: str) -> None:
        raise OSError(ENOSPC, "no space left on device", str(path))

    monkeypatch.setattr(check, "rewrite", refuse)
    done = command(capsys, "check", "--fix", "m.yaml")
    assert done.code == 2
    assert "m.yaml" in done.err
    assert "space" in done.err
    assert Path("m.yaml").read_bytes() == OLD


def test_hidden_files_of_a_folder_are_not_checked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("m.yaml").write_bytes(OLD)
    Path(".m.abc.yaml").write_text("mission: ", encoding="utf-8")
    assert command(capsys, "check", ".").out == "m.yaml: good (m, 2 nodes)\n"
