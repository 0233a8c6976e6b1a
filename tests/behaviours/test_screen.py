"""Faces and words on the screen: for good, or for a time."""

from behaviours.leaf import RUNNING, SUCCESS
from behaviours.screen import MOODS, FaceLeaf, Show
from drivers.api import Mood
from drivers.api.keys import declared_keys
from drivers.api.sections import ScreenKeys
from missions.plugins.testing.recorders import LeafTestBench


def test_a_face_is_shown_at_once_and_stays() -> None:
    bench = LeafTestBench()
    assert bench.tick(bench.put(FaceLeaf("face"), mood="happy")) is SUCCESS
    assert bench.screen.commands == [Mood.HAPPY]


def test_face_restores_the_mood_after_its_time() -> None:
    bench = LeafTestBench()
    bench.screen.mood(Mood.SAD)
    leaf = bench.put(FaceLeaf("face"), mood="surprised", seconds=2.0)
    assert bench.tick(leaf) is RUNNING
    assert bench.tick(leaf, after=2.0) is SUCCESS
    assert bench.screen.commands == [Mood.SAD, Mood.SURPRISED, Mood.SAD]


def test_halted_face_restores_the_mood() -> None:
    bench = LeafTestBench()
    leaf = bench.put(FaceLeaf("face"), mood="asleep", seconds=2.0)
    bench.tick(leaf)
    bench.halt(leaf)
    assert bench.screen.now.mood is Mood.NEUTRAL


def test_words_stay_or_go_after_their_time() -> None:
    bench = LeafTestBench()
    assert bench.tick(bench.put(Show("show"), text="Hello")) is SUCCESS
    assert bench.screen.now.text == "Hello"
    leaf = bench.put(Show("show"), text="Bye", seconds=1.0)
    assert bench.tick(leaf) is RUNNING
    assert bench.tick(leaf, after=1.0) is SUCCESS
    assert bench.screen.commands == ["Hello", "Bye", ""]


def test_moods_of_the_file_equal_those_of_the_driver() -> None:
    (mood,) = declared_keys(ScreenKeys)
    assert MOODS == mood.among == tuple(Mood)
