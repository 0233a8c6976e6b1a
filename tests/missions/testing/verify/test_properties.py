"""The ``properties`` of a mission file: what they name must be there, and what they say must be a form there is."""

import pytest

from config.diagnostics import InvalidFileError
from missions.language.mission_body import PROPERTIES, PROPERTY_FORMS
from missions.language.plan import MissionProperty
from tests.missions.testing.verify.exploring import plan_of

TREE = """
sequence:
  - find_face: {scans: 1}
    timeout: 5 s
  - parallel:
      - gesture: hello
      - say: Hi
    name: greet the person
  - drive: 1 m
    name: wait while he goes
"""


def read(promise: str) -> MissionProperty:
    (found,) = plan_of(TREE, promise).properties
    return found


@pytest.mark.parametrize(
    ("promise", "form", "subject", "other"),
    [
        ("never: gesture while drive", "while", "gesture", "drive"),
        ("never: say before greet the person", "before", "say", "greet the person"),
        ("never: base after say", "after", "base", "say"),
        ("never: say without arm", "without", "say", "arm"),
        ("never: wait while he goes while say", "while", "wait while he goes", "say"),
        ("never: say while wait while he goes", "while", "say", "wait while he goes"),
        ("always eventually: base stopped", "stopped", "base", ""),
        ("always eventually: greet the person stopped", "stopped", "greet the person", ""),
        ("always eventually: say", "eventually", "say", ""),
        ("can: succeed", "can", "succeed", ""),
        ("can: fail", "can", "fail", ""),
    ],
)
def test_each_form_is_read(promise: str, form: str, subject: str, other: str) -> None:
    found = read(promise)
    assert (found.form, found.subject, found.other) == (form, subject, other)
    assert found.text == promise
    assert found.mark.line > 12


@pytest.mark.parametrize(
    ("promise", "under", "message", "hint"),
    [
        ("never: gestrue while drive", "gestrue", "no behaviour of this mission is called 'gestrue'", "'gesture'"),
        ("never: gesture while drvie", "drvie", "no behaviour of this mission is called 'drvie'", "'drive'"),
        ("never: say before base", "base", "no behaviour of this mission is called 'base'", "known are: "),
        ("never: turn while say", "turn", "no behaviour of this mission is called 'turn'", "known are: "),
        ("never: say", "say", "'never' needs one of 'while', 'before', 'after', 'without' between", "such as"),
        ("always eventually: bse stopped", "bse", "no behaviour of this mission is called 'bse'", "'base'"),
        ("always eventually: sing", "sing", "no behaviour of this mission is called 'sing'", "known are: "),
        ("can: explode", "explode", "'can' takes succeed or fail, got 'explode'", "known are: fail, succeed"),
        ("sometimes: say", "sometimes", "unknown property 'sometimes'", "known are: "),
        ("never: {a: b}", "{", "'never' needs a text", "such as"),
        ("say", "say", "a property needs one of never, always eventually, can", "such as"),
    ],
)
def test_mistake_in_a_property_is_marked_with_a_hint(promise: str, under: str, message: str, hint: str) -> None:
    with pytest.raises(InvalidFileError) as caught:
        read(promise)
    (fault,) = caught.value.diagnostics
    begin = fault.mark.column - 1
    assert fault.source.line(fault.mark.line)[begin : begin + fault.mark.length] == under
    assert message in fault.message
    assert hint in fault.suggestion


def test_properties_need_a_list() -> None:
    with pytest.raises(InvalidFileError, match="'properties' needs a list"):
        plan_of("say: Hi\n", params="{}\nproperties: never")


def test_the_examples_of_the_forms_are_forms() -> None:
    assert {form.partition(":")[0] for form in PROPERTY_FORMS} == set(PROPERTIES)
