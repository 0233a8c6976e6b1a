"""A short version of the trial of docs/speech.md: spoken by the synthesiser, heard through the whole listening path."""

from dataclasses import replace
from pathlib import Path

import pytest

from tests.benchmarks.listening import hear_all, read
from tests.benchmarks.round_trip import Row, rows, table, written
from tests.benchmarks.speaking import Speaking
from tests.benchmarks.spoken import COMMANDS, LESSON, STRANGERS, TRIAL, Material

pytest.importorskip("pocketsphinx")
pytest.importorskip("espeakng_loader")

SHORT = replace(TRIAL, voices=("en-us",), speeds=1, sentences=8)
KEYS = ("trial/clean/en-us/0", "trial/pink/en-us/0")


OTHERS = ("nine", "left", "dog", "up", "bird")


class Noisy:
    """Every key but those of a clean background."""

    def __contains__(self, key: object) -> bool:
        return "/clean/" not in str(key)


class AllBut:
    """Every key but some."""

    def __contains__(self, key: object) -> bool:
        return key not in KEYS


def test_commands_are_understood_and_other_sentences_refused(tmp_path: Path) -> None:
    results = tmp_path / "results.jsonl"
    with Speaking() as speaking:
        hear_all(SHORT.streams(speaking.say, AllBut()), results)
    clean, pink = rows(read(results))
    assert (clean.background, clean.phrases, clean.others) == ("clean", 7, 5)
    assert (pink.background, pink.phrases, pink.others) == ("pink", 7, 5)
    assert clean.accepted >= 0.85
    assert clean.false <= 0.2
    assert pink.recognised >= 0.7
    assert pink.false <= 0.2


def test_single_words_are_distinguished_from_other_words(tmp_path: Path) -> None:
    words = Material("words", ("en-us+f2",), (("yes", "no", "stop"),), OTHERS, "", 5, speeds=1)
    results = tmp_path / "results.jsonl"
    with Speaking() as speaking:
        hear_all(words.streams(speaking.say, Noisy()), results)
    (clean,) = rows(read(results))
    assert (clean.phrases, clean.others) == (3, 5)
    assert clean.accepted == 1
    assert clean.false <= 0.2


@pytest.mark.parametrize("trial", [TRIAL, STRANGERS], ids=["trial", "strangers"])
def test_nothing_of_the_lesson_comes_up_in_the_trial(trial: Material) -> None:
    assert not set(LESSON.voices) & set(trial.voices)
    assert not {phrase for phrases in LESSON.grammars for phrase in phrases} & set(COMMANDS)
    assert not set(LESSON.others) & set(trial.others)
    assert LESSON.babble != trial.babble
    assert len(set(trial.voices)) == 10
    assert len(set(trial.others)) == 40
    assert not set(TRIAL.voices) & set(STRANGERS.voices)


@pytest.mark.parametrize("old", ["", "old\n"])
def test_table_replaces_the_old_one_and_keeps_the_page(old: str) -> None:
    found = Row("pink", 7, 10, 1.0, (0.5, 0.625, 0.75, 0.875), 0.857, 0.1, 0.0831)
    begin, end = "<!-- round trip of trial: begin -->\n", "<!-- round trip of trial: end -->\nafter\n"
    page = written(f"before\n{begin}{old}{end}", "trial", table([found]))
    assert page.startswith(f"before\n{begin}| background | phrases / others |")
    assert "| pink | 7 / 10 | 100.0 % | 50.0 % | 62.5 % | 75.0 % | 87.5 % | 85.7 % | 10.0 % | 0.083 |" in page
    assert page.endswith(f"|\n{end}")
    assert "old" not in page
    with pytest.raises(ValueError, match="no place"):
        written("before\nafter\n", "trial", "")
