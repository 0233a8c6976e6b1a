"""What a case is given: leaves that are mocked, and what goes wrong with the robot."""

import re
from collections.abc import Mapping as Named

from behaviours.hearing import Listening
from config.faults import did_you_mean, one_of
from config.fields import Fields
from config.marked import Mapping, Node, Scalar
from config.units import article, seen
from missions.language.arguments import default_value
from missions.language.phrases import own_phrases
from missions.testing.context import Setting
from missions.testing.mishaps import JOINT, Mishap, read_mishap
from missions.testing.mocks import RESULT_OF_FACE, MockSpec
from missions.testing.phrases import Phrase
from missions.testing.script import read_script
from perception.api import Face

EITHER = "write 'gesture: fails twice' for a mock, or 'camera frozen from 5 s to 8 s'"


def read_given(fields: Fields, setting: Setting) -> tuple[tuple[MockSpec, ...], tuple[Mishap, ...]]:
    """Read the list under ``given``: a text is a mishap, one key with a value is a mock."""
    mocks: list[MockSpec] = []
    mishaps: list[Mishap] = []
    for node in fields.items("given"):
        if isinstance(node, Mapping) and len(node.entries) == 1:
            key, value = node.entries[0]
            mocks.append(_mock(fields, key, value, setting))
        elif isinstance(node, Scalar) and node.value is not None:
            mishaps.append(_mishap(fields, node, setting))
        else:
            fields.fault(node.mark, "neither a mock nor something that goes wrong", EITHER)
    return tuple(mocks), tuple(mishaps)


def _mishap(fields: Fields, node: Scalar, setting: Setting) -> Mishap:
    mishap = read_mishap(Phrase(fields.source, node, fields.faults), setting.unknown)
    if not mishap.state or setting.plan is None:
        return mishap
    if mishap.part not in setting.parts:
        parts = ", ".join(sorted(setting.parts)) or "nothing"
        hint = f"it uses {parts}"
        fields.fault(node.mark, f"mission '{setting.plan.mission}' does not use {article(mishap.part)}", hint)
    elif mishap.state in JOINT and setting.config.arm is not None:
        joints = setting.config.arm.joints
        if mishap.detail not in joints:
            hint = one_of(mishap.detail, joints)
            fields.fault(node.mark, f"the arm of '{setting.config.name}' has no joint {seen(mishap.detail)}", hint)
    return mishap


def _mock(fields: Fields, key: Scalar, value: Node, setting: Setting) -> MockSpec:
    _check_target(fields, key, setting)
    script, told, said = value, None, ""
    if isinstance(value, Mapping):
        long = Fields(fields.source, value, fields.faults, what="a mock")
        does = long.node_of("does", required=True)
        told, said = (None, _phrase(long, key, setting)) if _hears(key, setting) else (long.section("result"), "")
        long.done()
        script = does if does is not None else key
    if not isinstance(script, Scalar) or script.value is None:
        fields.fault(script.mark, f"what '{key.text}' does instead is missing", "such as 'fails twice, then succeeds'")
        return MockSpec(key.text, ())
    if (result := re.match(r"succeeds\s+with\s+(.+)", script.text)) is not None:
        hint = f"write {key.text}: {{does: succeeds, result: {result[1]}}}"
        fields.fault(script.mark, "what a mock does and its result stand apart", hint)
        return MockSpec(key.text, ())
    turns = read_script(Phrase(fields.source, script, fields.faults)) if script is not key else ()
    return MockSpec(key.text, turns, said or None if told is None else _result(told, key, setting))


def _hears(key: Scalar, setting: Setting) -> bool:
    """Say whether what is mocked keeps a phrase."""
    return any(step.leaf is not None and issubclass(step.leaf, Listening) for step in setting.steps(key.text))


def _phrase(fields: Fields, key: Scalar, setting: Setting) -> str:
    """Read the phrase that a mock has heard: one of those that the mission listens for there."""
    said, node = fields.text("result", ""), fields.node_of("result")
    known = [phrase for step in setting.steps(key.text) for phrase in own_phrases(step).values()]
    if said and node is not None and said not in known:
        hint = did_you_mean(said, known) or f"it listens for {', '.join(known)}"
        fields.fault(node.mark, f"'{key.text}' cannot hear {seen(said)}", hint)
    return said


def _check_target(fields: Fields, key: Scalar, setting: Setting) -> None:
    """Note a name that means no leaf of the mission."""
    if setting.plan is None or any(step.leaf is not None for step in setting.steps(key.text)):
        return
    leaves = {word for step in setting.plan.tree.walk() if step.leaf is not None for word in (step.kind, step.name)}
    message = f"mission '{setting.plan.mission}' has no behaviour {seen(key.text)}"
    if setting.steps(key.text):
        message = f"{seen(key.text)} is no single behaviour, and only those can be mocked"
    hint = did_you_mean(key.text, leaves) or f"mocked can be: {', '.join(sorted(leaves))}"
    fields.fault(key.mark, message, hint)


def _result(told: Fields, key: Scalar, setting: Setting) -> Named[str, object]:
    """Read what ``as`` keeps, by name; the values of a face are those of a face."""
    faces = any(step.leaf is not None and step.leaf.keeps is Face for step in setting.steps(key.text))
    found: dict[str, object] = {}
    for name, value in told.entries():
        if faces and name.text not in RESULT_OF_FACE:
            told.fault(name.mark, f"a face has no {seen(name.text)}", one_of(name.text, RESULT_OF_FACE))
        elif not isinstance(value, Scalar):
            told.fault(value.mark, f"'{name.text}' needs one value")
        elif faces and name.text == "name":
            found[name.text] = value.text
        elif faces and (not isinstance(default_value(value), int | float) or isinstance(value.value, bool)):
            told.fault(value.mark, f"'{name.text}' of a face needs a number, got {seen(value.text)}")
        else:
            found[name.text] = default_value(value)
    return found
