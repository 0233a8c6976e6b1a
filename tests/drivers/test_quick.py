"""Classes that are made quickly are the dataclasses of the standard library in all that a caller sees."""

import copy
import dataclasses
import pickle
import subprocess
import sys
from collections.abc import Callable
from dataclasses import FrozenInstanceError, asdict, field, replace
from typing import Any, ClassVar

import pytest

from drivers.api import fast_dataclass

MAKERS = [dataclasses.dataclass, fast_dataclass.dataclass]


@fast_dataclass.dataclass(frozen=True, slots=True)
class Place:
    """Somewhere, with what was found there."""

    x: float
    y: float = 0.0
    found: list[str] = field(default_factory=list, compare=False)


def made(maker: Callable[..., Any], **options: bool) -> type[Any]:
    """A class with a bit of everything."""

    class Robot:
        """A robot."""

        kind: ClassVar[str] = "rover"
        name: str
        speed: float = 0.5
        parts: list[str] = field(default_factory=list)
        note: str = field(default="x", repr=False, compare=False)
        length: int = field(init=False)

        def __post_init__(self) -> None:
            object.__setattr__(self, "length", len(self.name))

    Robot.__qualname__ = "Robot"
    return maker(**options)(Robot)  # type: ignore[no-any-return]


@pytest.mark.parametrize("maker", MAKERS)
@pytest.mark.parametrize("kw_only", [False, True])
@pytest.mark.parametrize("slots", [False, True])
@pytest.mark.parametrize("frozen", [False, True])
def test_quick_and_standard_dataclasses_behave_alike(
    maker: Callable[..., Any], frozen: bool, slots: bool, kw_only: bool
) -> None:
    robot = made(maker, frozen=frozen, slots=slots, kw_only=kw_only)
    rover = robot(name="rover", parts=["arm"])
    assert repr(rover) == "Robot(name='rover', speed=0.5, parts=['arm'], length=5)"
    assert rover == robot(name="rover", parts=["arm"], note="y")
    assert rover != robot(name="rover", parts=["arm"], speed=1.0)
    assert rover != ("rover", 0.5, ["arm"], 5)
    assert robot(name="a").parts is not robot(name="b").parts
    assert asdict(replace(rover, name="me")) == {
        "name": "me", "speed": 0.5, "parts": ["arm"], "note": "x", "length": 2,
    }  # fmt: skip
    assert hasattr(rover, "__dict__") is not slots
    assert copy.deepcopy(rover) == rover
    for wrong in ({}, {"name": "a", "size": 1}, {"name": "a", "length": 1}):
        with pytest.raises(TypeError):
            robot(**wrong)
    if kw_only:
        with pytest.raises(TypeError):
            robot("rover")
    elif not frozen:
        assert robot("rover", 1.0).speed == 1.0
    if frozen:
        with pytest.raises(FrozenInstanceError, match="cannot assign to field 'name'"):
            rover.name = "other"
        with pytest.raises(FrozenInstanceError, match="cannot delete field 'name'"):
            del rover.name
    else:
        rover.name = "other"
        assert rover.name == "other"


@pytest.mark.parametrize("maker", MAKERS)
def test_only_frozen_dataclasses_are_hashable(maker: Callable[..., Any]) -> None:
    for frozen, eq in ((True, True), (False, True), (True, False), (False, False)):

        class Same:
            x: float

        same = maker(frozen=frozen, eq=eq, slots=True)(Same)
        assert (same(1.0) == same(1.0)) is eq
        if eq and not frozen:
            with pytest.raises(TypeError):
                hash(same(1.0))
        else:
            assert (hash(same(1.0)) == hash(same(1.0))) is eq or not eq


@pytest.mark.parametrize("maker", MAKERS)
def test_own_methods_are_kept_and_nan_equals_itself(maker: Callable[..., Any]) -> None:
    class Number:
        value: float

        def __repr__(self) -> str:
            return f"<{self.value}>"

    number = maker(frozen=True, slots=True)(Number)
    nan = float("nan")
    assert repr(number(1.0)) == "<1.0>"
    assert number(nan) == number(nan), "the same object, as in a tuple"


@pytest.mark.parametrize("child", MAKERS)
@pytest.mark.parametrize("parent", MAKERS)
def test_quick_and_standard_dataclasses_inherit_from_each_other(
    parent: Callable[..., Any], child: Callable[..., Any]
) -> None:
    class Base:
        x: float = 1.0

    base = parent(frozen=True, slots=True)(Base)

    class More(base):  # type: ignore[valid-type, misc]
        y: float = 2.0

    more = child(frozen=True, slots=True)(More)
    assert (more(3.0).x, more(3.0).y) == (3.0, 2.0)
    assert more(3.0) != base(3.0)
    with pytest.raises(FrozenInstanceError):
        more().x = 2.0


@pytest.mark.parametrize("child", MAKERS)
@pytest.mark.parametrize("parent", MAKERS)
@pytest.mark.parametrize("frozen", [False, True])
def test_frozen_and_unfrozen_dataclasses_do_not_inherit(
    parent: Callable[..., Any], child: Callable[..., Any], frozen: bool
) -> None:
    class Base:
        x: float = 1.0

    base = parent(frozen=frozen)(Base)

    class More(base):  # type: ignore[valid-type, misc]
        y: float = 2.0

    with pytest.raises(TypeError, match="frozen"):
        child(frozen=not frozen)(More)


def test_a_frozen_one_with_slots_survives_a_pickle_and_matches_by_place() -> None:
    place = Place(1.0, 2.0, ["ball"])
    again = pickle.loads(pickle.dumps(place))  # noqa: S301 - our own
    assert (again, again.found) == (place, ["ball"])
    match again:
        case Place(x, y):
            assert (x, y) == (1.0, 2.0)
    assert hash(again) == hash(place)


def test_a_check_of_a_mission_makes_few_classes_the_slow_way() -> None:
    program = """if True:
        import dataclasses, sys
        slow, original = [], dataclasses._create_fn
        def counted(name, *more, **named):
            slow.append(name)
            return original(name, *more, **named)
        dataclasses._create_fn = counted
        from missions.cli.root import main
        sys.argv = ["mission", "check", "greet"]
        try:
            main()
        finally:
            print(len(slow))
    """
    told = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout
    assert int(told.split()[-1]) < 200, "methods; were 850"
