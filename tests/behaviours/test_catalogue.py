"""The table of leaves says of each what its class says, and imports none before it is looked up."""

import pytest

from behaviours.catalogue import LEAF_PATHS, LEAVES, Catalogue
from behaviours.leaf import Leaf


def test_every_leaf_stands_under_its_own_word() -> None:
    assert {word: leaf.tag for word, leaf in LEAVES.items()} == {word: word for word in LEAF_PATHS}
    assert all(issubclass(leaf, Leaf) for leaf in LEAVES.values())


def test_leaves_of_others_come_after_ours() -> None:
    class Blink(Leaf):
        tag = "blink"

    leaves = Catalogue(LEAF_PATHS, {"blink": Blink})
    assert [*leaves][-2:] == [[*LEAF_PATHS][-1], "blink"]
    assert len(leaves) == len(LEAF_PATHS) + 1
    assert leaves["blink"] is Blink
    assert "blink" in leaves
    assert "wait" in leaves
    assert "blnk" not in leaves


def test_there_is_no_leaf_of_an_unknown_word() -> None:
    with pytest.raises(KeyError):
        LEAVES["blnk"]
