"""The table of leaves says of each what its class says, and imports none before it is looked up."""

import pytest

from behaviours.catalogue import LEAVES, PLACES, Catalogue
from behaviours.leaf import Leaf


def test_every_leaf_stands_under_its_own_word() -> None:
    assert {word: leaf.word for word, leaf in LEAVES.items()} == {word: word for word in PLACES}
    assert all(issubclass(leaf, Leaf) for leaf in LEAVES.values())


def test_leaves_of_others_come_after_ours() -> None:
    class Blink(Leaf):
        word = "blink"

    leaves = Catalogue(PLACES, {"blink": Blink})
    assert [*leaves][-2:] == [[*PLACES][-1], "blink"]
    assert len(leaves) == len(PLACES) + 1
    assert leaves["blink"] is Blink
    assert "blink" in leaves
    assert "wait" in leaves
    assert "blnk" not in leaves


def test_there_is_no_leaf_of_an_unknown_word() -> None:
    with pytest.raises(KeyError):
        LEAVES["blnk"]
