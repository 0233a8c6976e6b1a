"""The table of leaves says of each what its class says, and imports none before it is looked up."""

import pytest

from behaviours.catalogue import LEAF_PATHS, LEAVES, Catalogue
from behaviours.leaf import Leaf


def test_leaf_tags_match_their_catalogue_keys() -> None:
    assert {word: leaf.tag for word, leaf in LEAVES.items()} == {word: word for word in LEAF_PATHS}
    assert all(issubclass(leaf, Leaf) for leaf in LEAVES.values())


def test_plugin_leaves_come_after_the_builtin_leaves() -> None:
    class Blink(Leaf):
        tag = "blink"

    leaves = Catalogue(LEAF_PATHS, {"blink": Blink})
    assert [*leaves][-2:] == [[*LEAF_PATHS][-1], "blink"]
    assert len(leaves) == len(LEAF_PATHS) + 1
    assert leaves["blink"] is Blink
    assert "blink" in leaves
    assert "wait" in leaves
    assert "blnk" not in leaves


def test_unknown_leaf_raises_key_error() -> None:
    with pytest.raises(KeyError):
        LEAVES["blnk"]
