"""Objects as missions name them: by a phrase, by the name of a file, or by its path."""

from pathlib import Path

import pytest

from config.diagnostics import InvalidFileError
from missions.language.wanted_objects import objects_to_find
from missions.library.lookups import find_object
from missions.library.shipped import load_mission
from perception.api import ThingSpec

MISSION = """
mission: look
tree:
  sequence:
    - find_object: small yellow ball
    - object_seen: {what: apple, within: 2 s}
    - selector:
        - object_seen: apple
        - wait: 1 s
    - robot_seen: 7
"""


def test_object_is_found_by_phrase_or_file_name() -> None:
    assert find_object("red  Ball") == ThingSpec("red ball", "red", "ball", None)
    assert find_object("apple") == ThingSpec("apple", "red", "ball", 0.12)


def test_a_file_of_ones_own_is_an_object(tmp_path: Path) -> None:
    path = tmp_path / "cup.yaml"
    path.write_text("object: cup\ncolour: blue\nsize: 9 cm\n")
    assert find_object(str(path)) == ThingSpec("cup", "blue", "thing", 0.09)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("appel", "did you mean 'apple'"),
        ("red bal", "did you mean 'ball'"),
        ("cup.yaml", "no such file"),
        ("brown box", "brown things cannot be distinguished from a room"),
    ],
)
def test_unknown_object_is_refused_with_a_hint(name: str, said: str) -> None:
    with pytest.raises(LookupError, match=said):
        find_object(name)


def test_objects_of_a_mission_are_known_before_the_start(tmp_path: Path) -> None:
    path = tmp_path / "look.yaml"
    path.write_text(MISSION)
    plan = load_mission(str(path))
    assert [one.name for one in objects_to_find(plan.tree)] == ["small yellow ball", "apple"]


def test_misspelt_object_in_a_mission_is_reported(tmp_path: Path) -> None:
    path = tmp_path / "look.yaml"
    path.write_text(MISSION.replace("yellow", "yelow"))
    with pytest.raises(InvalidFileError, match="'yelow' is not a colour; did you mean 'yellow'"):
        load_mission(str(path))


@pytest.mark.parametrize(
    ("steps", "names"),
    [
        ('for_each: {in: [red ball, blue box], as: thing, do: {find_object: "${thing}"}}', ["red ball", "blue box"]),
        ('for_each: {in: hues, as: hue, do: {find_object: "${hue} ball"}}', ["red ball", "green ball"]),
        ('sequence: [set: {it: pink box}, find_object: "${it}"]', ["pink box"]),
        ('sequence: [{listen: {for: [blue box]}, as: heard}, find_object: "${heard}"]', ["blue box"]),
        ('sequence: [{find_object: red ball, as: it}, object_seen: "${it.name}"]', ["red ball"]),
    ],
)
def test_objects_named_by_an_expression_are_detected(steps: str, names: list[str], tmp_path: Path) -> None:
    path = tmp_path / "look.yaml"
    path.write_text(f"mission: look\nparams: {{hues: [red, green]}}\ntree: {{{steps}}}\n")
    assert set(names) <= {one.name for one in objects_to_find(load_mission(str(path)).tree)}


def test_objects_passed_to_a_submission_are_detected(tmp_path: Path) -> None:
    (tmp_path / "seek.yaml").write_text('mission: seek\nparams: {what: apple}\ntree: {find_object: "${what}"}\n')
    path = tmp_path / "look.yaml"
    each = '{in: [red, blue], as: hue, do: {mission: seek.yaml, with: {what: "${hue} box"}}}'
    path.write_text(f"mission: look\ntree: {{for_each: {each}}}\n")
    assert {"red box", "blue box"} <= {one.name for one in objects_to_find(load_mission(str(path)).tree)}


def test_object_unknown_before_the_start_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "look.yaml"
    path.write_text('mission: look\ntree: {sequence: [set: {it: nothing}, find_object: "${it}"]}\n')
    with pytest.raises(InvalidFileError, match="'find_object': what it looks for must be known before the mission"):
        load_mission(str(path))


def test_object_from_a_missing_param_passes_the_check(tmp_path: Path) -> None:
    path = tmp_path / "look.yaml"
    path.write_text(
        'mission: look\nparams: {what: {type: text}}\ntree: {sequence: [set: {it: "${what}"}, find_object: "${it}"]}\n'
    )
    plan = load_mission(str(path))
    assert objects_to_find(plan.tree) == ()
