"""Mocks of a test file, parsed and checked against the mission: ``gesture: fails``, ``listen: {result: yes}``."""

import re
from collections.abc import Sequence
from dataclasses import replace

from behaviours.hearing import HearingLeaf
from config.cases import SCRIPT_HINT, MockTurnKeys
from config.diagnostics import did_you_mean
from config.fields import Fields
from config.section_reader import read_keys
from config.units import quoted_value
from config.yaml_nodes import Listing, Mapping, Node, Scalar
from missions.language.kinds import Kind, ListKind, RecordKind, describe_kind, join_kinds, kind_of_type
from missions.language.nodes import FINALLY, MISSION, RECOVER
from missions.language.phrases import step_phrases
from missions.language.plan import Step
from missions.language.variables import return_kinds
from missions.plugins.testing.mock_results import INVALID_RESULT, ResultReader, settable_members
from missions.plugins.testing.mocks import VERBS, MockSpec, MockTurn, Script, matches_step, read_script
from missions.plugins.testing.phrases import Phrase
from missions.plugins.testing.suite_context import CaseSetting


def read_mock(fields: Fields, key: Scalar, value: Node, setting: CaseSetting) -> MockSpec:
    """Return the mock of the behaviour, mission or composite that ``key`` names, from its script or mapping."""
    steps = [step for step in setting.nodes if matches_step(key.text, step)]
    if setting.plan is not None and not steps:
        _report_unknown_target(fields, key, setting, setting.plan.mission)
    return MockSpec(key.text, _MockReader(fields, key, steps).read(value), key.mark)


def _report_unknown_target(fields: Fields, key: Scalar, setting: CaseSetting, mission: str) -> None:
    """Add the error that nothing in the mission that can be mocked has this name."""
    words = [(step, word) for step in setting.nodes for word in (step.word, step.name) if word]
    known = {word for step, word in words if matches_step(word, step)}
    message = f"mission '{mission}' has no behaviour {quoted_value(key.text)}"
    hint = did_you_mean(key.text, known) or f"these can be mocked: {', '.join(sorted(known))}"
    if key.text in (RECOVER, FINALLY):
        hint = f"name the behaviour of '{key.text}' instead; {hint}"
    elif setting.steps(key.text):
        message = f"{quoted_value(key.text)} is not the name of one behaviour"
        hint = f"give it a name of its own in the mission (name: ...), and mock it; {hint}"
    fields.add_error(key.mark, message, hint)


class _MockReader:
    """Reads the turns of one mock; ``steps`` are the steps of the mission that it replaces.

    If there are none, the types of the mock's results are not checked.
    """

    def __init__(self, fields: Fields, key: Scalar, steps: Sequence[Step]) -> None:
        self._fields = fields
        self._key = key
        self._steps = steps
        self._results = ResultReader(fields)
        self._kinds = list(_output_kinds(steps))
        self._phrases = [
            phrase
            for step in steps
            if step.leaf is not None and issubclass(step.leaf, HearingLeaf)
            for phrase in step_phrases(step).values()
        ]

    def read(self, value: Node) -> Script:
        """Return the turns of a script, or of a mapping with ``does``, ``result`` and ``then``."""
        if not isinstance(value, Mapping):
            return self._read_script(value, is_last=True)
        does, result, then = (value.get(word) for word in ("does", "result", "then"))
        if does is None and result is None:
            hint = f"write {self._key.text}: {{result: ...}}, or {{does: ...}} {SCRIPT_HINT}"
            self._fields.add_error(value.mark, "a mock needs the outcome of its first start", hint)
        entries = then.items if isinstance(then, Listing) else [] if then is None else [then]
        turns = self._read_turns(does, result, "'result'", is_last=not entries)
        if then is not None and not entries:
            self._fields.add_error(then.mark, "'then' has no results", "leave it out, or write then: [RESULT, RESULT]")
        for number, entry in enumerate(entries, start=1):
            label = f"entry {number} of 'then'" if len(entries) > 1 else "'then'"
            turns += self._read_entry(entry, label, is_last=number == len(entries))
        return turns

    def _read_entry(self, entry: Node, label: str, *, is_last: bool) -> Script:
        """Return the turns of an entry of ``then``: a result, or a mapping with ``does`` or ``result``."""
        words = {*entry.keys()} if isinstance(entry, Mapping) else set()
        has_turn_keys = "does" in words or (words == {"result"} and not self._has_result_member)
        if not isinstance(entry, Mapping) or not has_turn_keys:
            return self._read_turns(None, entry, label, is_last=is_last)
        turn = Fields(self._fields.source, entry, self._fields.diagnostics, subject=label)
        before = len(turn.diagnostics)
        read_keys(turn, MockTurnKeys)
        if len(turn.diagnostics) > before:
            return ()
        return self._read_turns(entry.get("does"), entry.get("result"), "'result'", is_last=is_last)

    @property
    def _has_result_member(self) -> bool:
        """Whether the mocked output may be a record that has a member named ``result``."""
        records = [kind for kind in self._kinds if isinstance(kind, RecordKind)]
        return None in self._kinds or any(
            kind.other_kind is not None or "result" in settable_members(kind) for kind in records
        )

    def _read_turns(self, does: Node | None, result: Node | None, label: str, *, is_last: bool) -> Script:
        """Return the turns of a script; those that end with a result get the value of ``result``."""
        turns = (MockTurn("success"),) if does is None else self._read_script(does, is_last=is_last)
        if result is None:
            return turns
        value = self._read_result(result, label)
        if value is INVALID_RESULT or not turns:
            return turns
        ends = {"success", "failure"} if any(step.kind == MISSION for step in self._steps) else {"success"}
        if self._steps and not any(turn.end in ends for turn in turns):
            message = f"'{self._key.text}' never succeeds, so it never has this result"
            self._fields.add_error(result.mark, message, "leave 'does' out, or write 'succeeds' in it")
        return tuple(replace(turn, result=value) if turn.end in ends else turn for turn in turns)

    def _read_script(self, node: Node, *, is_last: bool) -> Script:
        if not isinstance(node, Scalar):
            return ()
        if (with_it := re.match(r"succeeds\s+with\s+(.+)", node.text)) is not None:
            hint = f"write {self._key.text}: {{result: {with_it[1]}}}"
            self._fields.add_error(node.mark, "the script of a mock and its result are separate keys", hint)
            return ()
        first = node.text.split()[:1]
        if self._kinds and first and first[0] not in VERBS and not did_you_mean(first[0], VERBS):
            hint = f"write {self._key.text}: {{result: {node.text}}}, or a script {SCRIPT_HINT}"
            self._fields.add_error(node.mark, f"{quoted_value(node.text)} is not the script of a mock", hint)
            return ()
        return read_script(Phrase(self._fields.source, node, self._fields.diagnostics), is_last=is_last)

    def _read_result(self, node: Node, label: str) -> object:
        """Return the value in ``node``, which must have the type of the output that is mocked."""
        if isinstance(node, Scalar) and node.value is None:
            return self._reject(node, f"{label} is empty", "leave it out, or write a value")
        if not self._steps:
            return self._results.read(node, None, label)
        if not self._kinds:
            return self._reject(node, f"{quoted_value(self._key.text)} has no result", self._no_result_hint(node))
        if len(self._kinds) > 1:
            words = {step.kind for step in self._steps if step.returns or _has_output(step)}
            message = f"{quoted_value(self._key.text)} has different results: {', '.join(sorted(words))}"
            return self._reject(self._key, message, "mock each by its own word or name")
        if isinstance(node, Listing) and not (self._kinds[0] is None or isinstance(self._kinds[0], ListKind)):
            hint = "for one after another, write the first beside 'result', and the others beside 'then'"
            return self._reject(node, f"{label} needs {describe_kind(self._kinds[0])}, got a list", hint)
        found = self._results.read(node, self._kinds[0], label)
        if self._phrases and isinstance(found, str) and found not in self._phrases:
            hint = did_you_mean(found, self._phrases) or f"it listens for {', '.join(self._phrases)}"
            message = f"'{self._key.text}' cannot hear {quoted_value(found)}"
            return self._reject(node, message, _script_hint(node) or hint)
        return found

    def _no_result_hint(self, node: Node) -> str:
        below = {step.kind for each in self._steps for step in each.walk() if _has_output(step)}
        if any(step.leaf is None and step.kind != MISSION for step in self._steps) and below:
            return f"mock the behaviour in it that has one: {', '.join(sorted(below))}"
        return _script_hint(node) or "leave the result out"

    def _reject(self, node: Node, message: str, hint: str) -> object:
        self._fields.add_error(node.mark, message, hint)
        return INVALID_RESULT


def _script_hint(node: Node) -> str:
    """Return the hint for a script in the place of a result."""
    text = node.text if isinstance(node, Scalar) else ""
    return f"write {{does: {text}}}" if text.partition(" ")[0] in VERBS else ""


def _has_output(step: Step) -> bool:
    """Return whether a step is a leaf whose result ``as`` can store."""
    return step.leaf is not None and bool(step.leaf.output_doc)


def _output_kinds(steps: Sequence[Step]) -> list[Kind]:
    """Return the different types of the outputs of mocked steps.

    All missions among them count as one type: a record with all their results.
    """
    found: list[Kind] = []
    returned: dict[str, Kind] = {}
    for step in steps:
        if step.kind == MISSION:
            for name, kind in return_kinds(step).items():
                returned[name] = join_kinds(returned[name], kind) if name in returned else kind
        elif step.leaf is not None and _has_output(step):
            kind = kind_of_type(step.leaf.output_type)
            found += [] if kind in found else [kind]
    return [*found, RecordKind("the results of a mission", members=returned)] if returned else found
