"""What a case is given: leaves that are mocked, and what goes wrong with the robot."""

import re
from collections.abc import Collection
from collections.abc import Mapping as Named

from behaviours.hearing import Listening
from config.cases import EITHER
from config.faults import did_you_mean, one_of
from config.fields import Fields
from config.marked import Listing, Mapping, Node, Scalar
from config.units import article, seen
from missions.language.arguments import default_value
from missions.language.nodes import MODIFIERS
from missions.language.phrases import own_phrases
from missions.language.plan import Step
from missions.testing.context import Setting
from missions.testing.mishaps import RUN, Mishap, read_mishap
from missions.testing.mocks import RESULT_OF_FACE, MockSpec, fits
from missions.testing.phrases import Phrase
from missions.testing.script import read_script
from perception.api import Face


def read_given(fields: Fields, setting: Setting) -> tuple[tuple[MockSpec, ...], tuple[Mishap, ...]]:
    """Return what the list under ``given`` means: a text is a mishap, one key with a value is a mock."""
    mocks: list[MockSpec] = []
    mishaps: list[Mishap] = []
    listed = fields.node_of("given")
    for place, node in enumerate(listed.items if isinstance(listed, Listing) else []):
        if any(path[:2] == ("given", place) for path in fields.wrong):
            continue
        if isinstance(node, Mapping) and len(node.entries) == 1:
            key, value = node.entries[0]
            mocks.append(_mock(fields, key, value, setting))
        elif isinstance(node, Scalar):
            mishaps.append(_mishap(fields, node, setting))
        else:
            fields.fault(node.mark, "neither a mock nor something that goes wrong", EITHER)
    return tuple(mocks), tuple(mishaps)


def _mishap(fields: Fields, node: Scalar, setting: Setting) -> Mishap:
    mishap = read_mishap(Phrase(fields.source, node, fields.faults), setting.unknown, setting.config.others)
    if not mishap.state or setting.plan is None:
        return mishap
    if mishap.part not in setting.parts | {RUN}:
        parts = ", ".join(sorted(setting.parts)) or "nothing"
        hint = f"it uses {parts}"
        fields.fault(node.mark, f"mission '{setting.plan.mission}' does not use {article(mishap.part)}", hint)
    elif mishap.of_joint:
        joints = setting.config.sections[mishap.part].keys.limits
        if mishap.detail not in joints:
            hint = one_of(mishap.detail, joints)
            told = f"the {mishap.part} of '{setting.config.name}' has no joint {seen(mishap.detail)}"
            fields.fault(node.mark, told, hint)
    return mishap


def _mock(fields: Fields, key: Scalar, value: Node, setting: Setting) -> MockSpec:
    _check_target(fields, key, setting)
    script, told, said = value, None, ""
    if isinstance(value, Mapping):
        long = Fields(fields.source, value, fields.faults, what="a mock")
        script, result = value.get("does") or key, value.get("result")
        if _hears(key, setting):
            said = "" if result is None else _phrase(long, result, key, setting)
        elif result is not None:
            told = Fields(fields.source, result, fields.faults, what="'result'")
    if not isinstance(script, Scalar):
        return MockSpec(key.text, ())
    if (with_it := re.match(r"succeeds\s+with\s+(.+)", script.text)) is not None:
        hint = f"write {key.text}: {{does: succeeds, result: {with_it[1]}}}"
        fields.fault(script.mark, "what a mock does and its result stand apart", hint)
        return MockSpec(key.text, ())
    turns = read_script(Phrase(fields.source, script, fields.faults)) if script is not key else ()
    return MockSpec(key.text, turns, said or None if told is None else _result(told, key, setting))


def _hears(key: Scalar, setting: Setting) -> bool:
    """Say whether what is mocked keeps a phrase."""
    return any(step.leaf is not None and issubclass(step.leaf, Listening) for step in _mocked(key, setting))


def _phrase(fields: Fields, node: Node, key: Scalar, setting: Setting) -> str:
    """Read the phrase that a mock has heard: one of those that the mission listens for there."""
    said = node.text if isinstance(node, Scalar) else ""
    if not said.strip():
        fields.fault(node.mark, "'result' needs a text")
    known = [phrase for step in _mocked(key, setting) for phrase in own_phrases(step).values()]
    if said and said not in known:
        hint = did_you_mean(said, known) or f"it listens for {', '.join(known)}"
        fields.fault(node.mark, f"'{key.text}' cannot hear {seen(said)}", hint)
    return said


def _mocked(key: Scalar, setting: Setting) -> list[Step]:
    """Return the steps for which a mock stands."""
    return [step for step in (() if setting.plan is None else setting.plan.tree.walk()) if fits(key.text, step)]


def _check_target(fields: Fields, key: Scalar, setting: Setting) -> None:
    """Note a name that means nothing of the mission which can be mocked."""
    if setting.plan is None or _mocked(key, setting):
        return
    steps = [step for step in setting.plan.tree.walk() if step.kind not in MODIFIERS]
    known = {name for step in steps for name in (step.kind, step.name, step.text) if name and fits(name, step)}
    message = f"mission '{setting.plan.mission}' has no behaviour {seen(key.text)}"
    hint = did_you_mean(key.text, known) or f"mocked can be: {', '.join(sorted(known))}"
    if setting.steps(key.text):
        message = f"{seen(key.text)} is no name of one behaviour"
        hint = f"give it a name of its own in the mission (name: ...), and mock that; {hint}"
    fields.fault(key.mark, message, hint)


def _result(told: Fields, key: Scalar, setting: Setting) -> Named[str, object]:
    """Read what ``as`` keeps, by name; the values of a face are those of a face, and a mission's what it returns."""
    steps = _mocked(key, setting)
    if steps and all(step.leaf is None for step in steps):
        return _returned(told, key, {name for step in steps for name in step.returns})
    if any(step.leaf is not None and step.leaf.keeps is Face for step in steps):
        return _of_face(told)
    return {name.text: _plain(told, name, value) for name, value in told.entries()}


def _returned(told: Fields, key: Scalar, returns: Collection[str]) -> Named[str, object]:
    """Read what a mission returns, where a mapping stands for a face."""
    found: dict[str, object] = {}
    for name, value in told.entries():
        if name.text not in returns:
            hint = one_of(name.text, returns) or "it returns nothing"
            told.fault(name.mark, f"'{key.text}' returns no {seen(name.text)}", hint)
        elif isinstance(value, Mapping):
            found[name.text] = _of_face(Fields(told.source, value, told.faults, what="a face"))
        else:
            found[name.text] = _plain(told, name, value)
    return found


def _of_face(told: Fields) -> dict[str, object]:
    """Read what is known of a face."""
    found: dict[str, object] = {}
    for name, value in told.entries():
        if name.text not in RESULT_OF_FACE:
            told.fault(name.mark, f"a face has no {seen(name.text)}", one_of(name.text, RESULT_OF_FACE))
        elif isinstance(value, Scalar) and name.text == "name":
            found[name.text] = value.text
        elif isinstance(value, Scalar) and (
            not isinstance(default_value(value), int | float) or isinstance(value.value, bool)
        ):
            told.fault(value.mark, f"'{name.text}' of a face needs a number, got {seen(value.text)}")
        else:
            found[name.text] = _plain(told, name, value)
    return found


def _plain(told: Fields, name: Scalar, value: Node) -> object:
    """Read one value."""
    if isinstance(value, Scalar):
        return default_value(value)
    told.fault(value.mark, f"'{name.text}' needs one value")
    return None
