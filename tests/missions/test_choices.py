"""Arguments that take one of some words: how a mistake is told, and what the schema and the catalogue say."""

import re
from pathlib import Path

import pytest

from behaviours.catalogue import LEAVES
from config.diagnostics import InvalidFileError
from missions.library.catalogue import example_value, kind_text
from missions.library.shipped import load_mission
from missions.plugins.schema.values import value_schema


def mission(folder: Path, step: str) -> Path:
    file = folder / "words.yaml"
    file.write_text(f"mission: words\ntree:\n  {step}\n", encoding="utf-8")
    return file


@pytest.mark.parametrize(
    ("step", "name", "word"),
    [
        ("bumped: left", "side", "left"),
        ("cliff: {side: right}", "side", "right"),
        ("sound: on", "tune", "on"),  # which is a word here, and no boolean
        ("led: off", "colour", "off"),
    ],
)
def test_choice_accepts_each_of_its_words(tmp_path: Path, step: str, name: str, word: str) -> None:
    (value,) = (
        value
        for read in load_mission(str(mission(tmp_path, step))).tree.walk()
        for argument, value in read.arguments.items()
        if argument == name
    )
    assert value.constant == word


@pytest.mark.parametrize("wrong", ["lefft", "true", "7"])
def test_wrong_choice_lists_the_valid_words(tmp_path: Path, wrong: str) -> None:
    with pytest.raises(InvalidFileError, match=f"needs one of any, left, centre, right, got '{wrong}'"):
        load_mission(str(mission(tmp_path, f"bumped: {wrong}")))


def test_the_schema_and_the_catalogue_know_the_words() -> None:
    side, colour = LEAVES["bumped"].arguments["side"], LEAVES["led"].arguments["colour"]
    assert kind_text(side) == "one of any, left, centre, right"
    assert example_value(colour) == "off"
    schema = value_schema(side, {})
    assert schema["type"] == "string"
    assert re.search(schema["pattern"], "centre")
    assert re.search(schema["pattern"], "${where}")
    assert not re.search(schema["pattern"], "middle")
    assert value_schema(colour, {})["type"] == ["string", "boolean"]
