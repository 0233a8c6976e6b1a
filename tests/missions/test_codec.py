"""The codec refuses data that is not exactly as declared, and says which member is wrong."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Annotated, Any, ClassVar, Literal

import jsonschema
import pytest

from missions.codec import Bound, CodecError, JsonName, Rules, decode, definitions, encode, object_schema
from tests.cases import each


class Level(Enum):
    LOW = 1
    HIGH = "high"


@dataclass(frozen=True)
class Node:
    """A node."""

    derived: ClassVar[Mapping[str, str]] = {"title": "Its name in capitals."}

    name: Annotated[str, "Its name.", Bound(high=5)]
    keep_as: Annotated[str, JsonName("as")] = ""
    count: Annotated[int, Bound(0, 9)] = 0
    share: float = 0.0
    level: Level = Level.LOW
    side: Literal["left", "right"] = "left"
    place: tuple[float, float] | None = None
    tags: Mapping[str, bool] = field(default_factory=dict)
    children: tuple["Node", ...] = ()

    @property
    def title(self) -> str:
        """Its name in capitals."""
        return self.name.upper()


RULES = Rules(max_text=8, max_members=3)
TREE = Node("a", "x", 3, 0.5, Level.HIGH, "right", (1.0, 2.0), {"on": True}, (Node("b"),))


def test_encoded_value_round_trips_and_matches_its_schema() -> None:
    written = encode(TREE, RULES)
    assert (written["as"], written["title"], "keep_as" in written) == ("x", "A", False)
    assert decode(Node, written, RULES) == TREE
    schema = {**object_schema(Node, RULES), "$defs": definitions(Node, RULES)}
    jsonschema.Draft202012Validator(schema).validate({**written, "place": [1.0, 2.0]})


def test_none_members_are_omitted_by_rule() -> None:
    assert "place" not in encode(Node("b"), Rules(omit_none=True))


@each(
    ("wrong", "said"),
    [
        ([], "must be an object (Node)"),
        ({}, "'name' is missing: Its name."),
        ({"nam": "a"}, "'nam' is not a member of Node"),
        ({"\x1b[2J": 1}, r"'\x1b[2J' is not a member"),
        ({"name": 5}, "'name' must be a text of at most 5 characters"),
        ({"name": "abcdef"}, "'name' must be a text of at most 5"),
        ({"name": "a", "as": "123456789"}, "'as' must be a text of at most 8"),
        ({"name": "a", "count": True}, "'count' must be a whole number"),
        ({"name": "a", "count": 1.0}, "'count' must be a whole number"),
        ({"name": "a", "count": 10}, "within 0 and 9"),
        ({"name": "a", "share": float("nan")}, "'share' must be a number"),
        ({"name": "a", "share": 10**400}, "'share' must be a number"),
        ({"name": "a", "share": "nan"}, "'share' must be a number"),
        ({"name": "a", "share": None}, "'share' must be a number"),
        ({"name": "a", "level": True}, "'level' must be one of 1, high"),
        ({"name": "a", "level": [1]}, "'level' must be one of"),
        ({"name": "a", "side": ["left"]}, "'side' must be one of left, right"),
        ({"name": "a", "place": [1.0]}, "'place' must be a list of 2"),
        ({"name": "a", "place": "12"}, "'place' must be a list of 2"),
        ({"name": "a", "tags": {"on": 1}}, "'tags.on' must be true or false"),
        ({"name": "a", "tags": dict.fromkeys("abcd", True)}, "'tags' must be an object"),
        ({"name": "a", "children": [{"name": "b"}] * 4}, "'children' must be a list"),
        ({"name": "a", "children": [{"name": "b", "children": [{"name": 1}]}]}, "'children.children.name' must be"),
    ],
)
def test_wrong_data_is_refused_with_the_wrong_member(wrong: Any, said: str) -> None:
    with pytest.raises(CodecError) as caught:
        decode(Node, wrong, RULES)
    assert said in str(caught.value)


def test_misspelt_member_gives_a_suggestion() -> None:
    with pytest.raises(CodecError) as caught:
        decode(Node, {"nam": "a"}, RULES)
    assert caught.value.hint == "did you mean 'name'?"
