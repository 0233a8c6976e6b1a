"""Smileys in a text: the mood that they set, and what is left to be spoken."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from behaviours.voice import split_mood
from drivers.api import Mood


@pytest.mark.parametrize(
    ("text", "left", "mood"),
    [
        ("Hello :)", "Hello", Mood.HAPPY),
        (":-) Hello", "Hello", Mood.HAPPY),
        ("Well done :D, Anna", "Well done, Anna", Mood.HAPPY),
        ("Great ;)))", "Great", Mood.HAPPY),
        ("I am lost :(", "I am lost", Mood.SAD),
        ("No soup :'-( today.", "No soup today.", Mood.SAD),
        ("You are here :O!", "You are here!", Mood.SURPRISED),
        ("Good night 😴", "Good night", Mood.ASLEEP),
        ("Danke😀", "Danke", Mood.HAPPY),
        ("Danke 😀", "Danke", Mood.HAPPY),
        ("so sad ☹️ then glad 🙂", "so sad then glad", Mood.HAPPY),
        (":)", "", Mood.HAPPY),
        ("at 8:00", "at 8:00", None),
        ("see http://robot/:D", "see http://robot/:D", None),
        ("a list:(1)", "a list:(1)", None),
        ("plain  words ", "plain  words ", None),
        ("", "", None),
    ],
)
def test_smileys_set_the_mood_and_are_not_spoken(text: str, left: str, mood: Mood | None) -> None:
    assert split_mood(text) == (left, mood)


@given(st.text())
def test_only_smileys_are_taken_out_of_a_text(text: str) -> None:
    left, mood = split_mood(text)
    if mood is None:
        assert left == text
    else:
        assert len(left) < len(text)
        letters = iter(text)
        assert all(letter in letters for letter in left)
