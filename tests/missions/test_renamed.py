"""Public names that have changed: the former ones go on for one release, and say what they are called now."""

import importlib

import pytest

from behaviours.joint_ranges import JointRanges
from behaviours.leaf import Leaf
from missions.executive.events import plain
from missions.plugins.records.recording.codec import from_json, to_json
from missions.plugins.testing.recorders import face
from perception.api import Face
from tests.cases import each

FORMER = (
    ("behaviours.reach", "Reach", "behaviours.joint_ranges.JointRanges"),
    ("behaviours.reach", "JointRanges", "behaviours.joint_ranges.JointRanges"),
    ("drivers.api", "Notice", "DeviceStatus"),
    ("drivers.api", "unheard", "ignore"),
    ("drivers.api", "unreported", "ignore"),
    ("drivers.api", "unsteered", "ignore"),
    ("drivers.servos.head", "DynamixelHead", "drivers.head.joints_head.NeckDriver"),
    ("missions.request", "Order", "RunRequest"),
    ("missions.plugins.testing.recorders", "Recorder", "Spy"),
)


@pytest.mark.parametrize(("module", "former", "name"), FORMER)
def test_a_former_name_goes_on_and_says_the_one_of_now(module: str, former: str, name: str) -> None:
    with pytest.warns(DeprecationWarning, match=f"{module}.{former} is called {name} now") as told:
        found = getattr(importlib.import_module(module), former)
    home, _, last = name.rpartition(".")
    assert found is getattr(importlib.import_module(home or module), last)
    assert told[0].filename.endswith("test_renamed.py")


@each("module", sorted({module for module, _, _ in FORMER}))
def test_a_name_that_never_was_is_refused_as_ever(module: str) -> None:
    with pytest.raises(AttributeError, match=f"module '{module}' has no attribute 'Nonsense'"):
        _ = importlib.import_module(module).Nonsense


def test_a_leaf_that_says_misfits_is_asked_for_joint_violations() -> None:
    with pytest.warns(DeprecationWarning, match="Wave.misfits is called joint_violations now") as told:

        class Wave(Leaf):
            """Wave."""

            def misfits(self, reach: JointRanges) -> list[str]:
                return reach.lacking(["wing"])

    assert told[0].filename == __file__
    assert Wave("wave").joint_violations(JointRanges({})) == ["the arm has no joint 'wing'"]


def test_a_percept_goes_on_to_tell_its_drop() -> None:
    with pytest.warns(DeprecationWarning, match="Percept.drop is called elevation now") as told:
        assert face(1.0, elevation=0.25).drop == 0.25
    assert told[0].filename == __file__


def test_a_face_of_a_test_goes_on_to_take_a_drop() -> None:
    with pytest.warns(DeprecationWarning, match="drop is called elevation now") as told:
        assert face(1.0, drop=0.25).elevation == 0.25
    assert told[0].filename == __file__


def test_records_keep_the_word_that_they_had_for_an_elevation() -> None:
    seen = face(1.0, elevation=0.25)
    written = to_json(seen)
    assert isinstance(written, dict)
    assert (written["drop"], "elevation" in written) == (0.25, False)
    assert from_json(written, Face) == seen
    told = plain(seen)
    assert isinstance(told, dict)
    assert (told["drop"], "elevation" in told) == (0.25, False)
