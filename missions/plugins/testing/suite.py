"""Test files: ``greet.test.yaml`` beside ``greet.yaml`` names the mission under test, its cases and expectations."""

import re
from collections.abc import Collection, Iterator, Sequence
from collections.abc import Mapping as Named
from dataclasses import dataclass
from pathlib import Path

from behaviours.hearing import HearingLeaf
from config.cases import GIVEN_HINT, CommonKeys, Eyes, JudgedSuiteKeys, SuiteKeys
from config.diagnostics import InvalidFileError, Mark, SourceText, did_you_mean, suggest_from
from config.fields import Fields, read_fields
from config.library import UnknownNameError
from config.section_reader import KeyPath as Place
from config.section_reader import read_keys
from config.units import quoted_value, with_article
from config.yaml_nodes import Listing, Mapping, Node, Scalar
from missions.language.arguments import default_value
from missions.language.nodes import MODIFIERS
from missions.language.phrases import step_phrases
from missions.language.plan import Step
from missions.library.shipped import TEST_SUFFIX, find_mission, shipped_missions
from missions.plugins.testing.expectations import Expectation, read_expectations
from missions.plugins.testing.fault_specs import RUN, FaultSpec, read_fault
from missions.plugins.testing.mocks import FACE_FIELDS, MockSpec, matches_step, read_script
from missions.plugins.testing.phrases import Phrase
from missions.plugins.testing.suite_context import CaseSetting, SuiteContext
from perception.api import Face

# What a case is given: leaves that are mocked, and what goes wrong with the robot.


def read_given(fields: Fields, setting: CaseSetting) -> tuple[tuple[MockSpec, ...], tuple[FaultSpec, ...]]:
    """Return the mocks and faults of the list ``given``: a text is a fault, one key with a value is a mock."""
    mocks: list[MockSpec] = []
    mishaps: list[FaultSpec] = []
    listed = fields.node_of("given")
    for place, node in enumerate(listed.items if isinstance(listed, Listing) else []):
        if any(path[:2] == ("given", place) for path in fields.wrong_places):
            continue
        if isinstance(node, Mapping) and len(node.entries) == 1:
            key, value = node.entries[0]
            mocks.append(_read_mock(fields, key, value, setting))
        elif isinstance(node, Scalar):
            mishaps.append(_read_fault(fields, node, setting))
        else:
            fields.add_error(node.mark, "neither a mock nor something that goes wrong", GIVEN_HINT)
    return tuple(mocks), tuple(mishaps)


def _read_fault(fields: Fields, node: Scalar, setting: CaseSetting) -> FaultSpec:
    mishap = read_fault(Phrase(fields.source, node, fields.diagnostics), setting.node_error, setting.config.extra_parts)
    if not mishap.state or setting.plan is None:
        return mishap
    if mishap.part not in setting.parts | {RUN}:
        parts = ", ".join(sorted(setting.parts)) or "nothing"
        hint = f"it uses {parts}"
        fields.add_error(node.mark, f"mission '{setting.plan.mission}' does not use {with_article(mishap.part)}", hint)
    elif mishap.is_joint_fault:
        joints = setting.config.sections[mishap.part].keys.limits
        if mishap.detail not in joints:
            hint = suggest_from(mishap.detail, joints)
            message = f"the {mishap.part} of '{setting.config.name}' has no joint {quoted_value(mishap.detail)}"
            fields.add_error(node.mark, message, hint)
    return mishap


def _read_mock(fields: Fields, key: Scalar, value: Node, setting: CaseSetting) -> MockSpec:
    _check_target(fields, key, setting)
    script, outcome, phrase = value, None, ""
    if isinstance(value, Mapping):
        long = Fields(fields.source, value, fields.diagnostics, subject="a mock")
        script, result = value.get("does") or key, value.get("result")
        if _is_listening_mock(key, setting):
            phrase = "" if result is None else _read_phrase(long, result, key, setting)
        elif result is not None:
            outcome = Fields(fields.source, result, fields.diagnostics, subject="'result'")
    if not isinstance(script, Scalar):
        return MockSpec(key.text, ())
    if (with_it := re.match(r"succeeds\s+with\s+(.+)", script.text)) is not None:
        hint = f"write {key.text}: {{does: succeeds, result: {with_it[1]}}}"
        fields.add_error(script.mark, "the script of a mock and its result are separate keys", hint)
        return MockSpec(key.text, ())
    turns = read_script(Phrase(fields.source, script, fields.diagnostics)) if script is not key else ()
    return MockSpec(key.text, turns, phrase or None if outcome is None else _read_result(outcome, key, setting))


def _is_listening_mock(key: Scalar, setting: CaseSetting) -> bool:
    """Return whether a mock replaces a leaf that listens for phrases."""
    return any(step.leaf is not None and issubclass(step.leaf, HearingLeaf) for step in _mocked_steps(key, setting))


def _read_phrase(fields: Fields, node: Node, key: Scalar, setting: CaseSetting) -> str:
    """Return the phrase that a mock hears: one of those for which the mission listens in the mocked step."""
    text = node.text if isinstance(node, Scalar) else ""
    if not text.strip():
        fields.add_error(node.mark, "'result' needs a text")
    known = [phrase for step in _mocked_steps(key, setting) for phrase in step_phrases(step).values()]
    if text and text not in known:
        hint = did_you_mean(text, known) or f"it listens for {', '.join(known)}"
        fields.add_error(node.mark, f"'{key.text}' cannot hear {quoted_value(text)}", hint)
    return text


def _mocked_steps(key: Scalar, setting: CaseSetting) -> list[Step]:
    return [step for step in (() if setting.plan is None else setting.plan.tree.walk()) if matches_step(key.text, step)]


def _check_target(fields: Fields, key: Scalar, setting: CaseSetting) -> None:
    """Add an error if nothing in the mission that can be mocked has this name."""
    if setting.plan is None or _mocked_steps(key, setting):
        return
    steps = [step for step in setting.plan.tree.walk() if step.kind not in MODIFIERS]
    known = {name for step in steps for name in (step.kind, step.name, step.text) if name and matches_step(name, step)}
    message = f"mission '{setting.plan.mission}' has no behaviour {quoted_value(key.text)}"
    hint = did_you_mean(key.text, known) or f"these can be mocked: {', '.join(sorted(known))}"
    if setting.steps(key.text):
        message = f"{quoted_value(key.text)} is not the name of one behaviour"
        hint = f"give it a name of its own in the mission (name: ...), and mock it; {hint}"
    fields.add_error(key.mark, message, hint)


def _read_result(fields: Fields, key: Scalar, setting: CaseSetting) -> Named[str, object]:
    """Return the values of a mock's result by name: fields of a face, or results of a mission."""
    steps = _mocked_steps(key, setting)
    if steps and all(step.leaf is None for step in steps):
        return _read_returns(fields, key, {name for step in steps for name in step.returns})
    if any(step.leaf is not None and step.leaf.output_type is Face for step in steps):
        return _read_face(fields)
    return {name.text: _read_value(fields, name, value) for name, value in fields.entries()}


def _read_returns(fields: Fields, key: Scalar, returns: Collection[str]) -> Named[str, object]:
    """Return the results of a mocked mission by name; a mapping as a value stands for a face."""
    found: dict[str, object] = {}
    for name, value in fields.entries():
        if name.text not in returns:
            hint = suggest_from(name.text, returns) or "it has no results"
            fields.add_error(name.mark, f"'{key.text}' returns no {quoted_value(name.text)}", hint)
        elif isinstance(value, Mapping):
            found[name.text] = _read_face(Fields(fields.source, value, fields.diagnostics, subject="a face"))
        else:
            found[name.text] = _read_value(fields, name, value)
    return found


def _read_face(fields: Fields) -> dict[str, object]:
    """Return the fields of a mocked face by name, such as its bearing; unknown fields are errors."""
    found: dict[str, object] = {}
    for name, value in fields.entries():
        if name.text not in FACE_FIELDS:
            fields.add_error(
                name.mark, f"a face has no {quoted_value(name.text)}", suggest_from(name.text, FACE_FIELDS)
            )
        elif isinstance(value, Scalar) and name.text == "name":
            found[name.text] = value.text
        elif isinstance(value, Scalar) and (
            not isinstance(default_value(value), int | float) or isinstance(value.value, bool)
        ):
            fields.add_error(value.mark, f"'{name.text}' of a face needs a number, got {quoted_value(value.text)}")
        else:
            found[name.text] = _read_value(fields, name, value)
    return found


def _read_value(fields: Fields, name: Scalar, value: Node) -> object:
    """Return one value of a mock's result; a list or a mapping is an error."""
    if isinstance(value, Scalar):
        return default_value(value)
    fields.add_error(value.mark, f"'{name.text}' needs one value")
    return None


@dataclass(frozen=True, slots=True)
class Case:
    """A checked case: plain data, which can be sent to another process. ``timeout`` is in simulated seconds.

    ``mission``, ``robot`` and ``world`` are names or absolute paths.
    """

    title: str
    source: SourceText
    mark: Mark
    mission: str
    params: Named[str, str]
    robot: str | None
    world: str | None
    seed: int
    eyes: Eyes
    physics: bool
    timeout: float
    behaviours: Sequence[Path]
    mocks: tuple[MockSpec, ...]
    injected_faults: tuple[FaultSpec, ...]
    expectations: tuple[Expectation, ...]

    @property
    def location(self) -> str:
        """Position of the case as ``FILE:LINE``."""
        return f"{self.source.name}:{self.mark.line}"

    def __str__(self) -> str:
        return f"{self.location}: {self.title}"


def load_suite(path: Path, behaviours: Sequence[Path] = ()) -> tuple[Case, ...]:
    """Read and check a test file and its mission; ``behaviours`` are added to the file's own.

    Raises InvalidFileError with all errors in both files.
    """
    return read_suite(read_fields(path, subject="a test file", name=display_path(path)), path.parent, behaviours)


def read_suite(
    fields: Fields, folder: Path, behaviours: Sequence[Path] = (), *, with_expectations: bool = True
) -> tuple[Case, ...]:
    """Read the cases of a test file; names are relative to ``folder``.

    Raises InvalidFileError with all errors in the test file or the mission.
    """
    whole = Fields(fields.source, _merge_shared(fields.node), fields.diagnostics, subject=fields.subject)
    keys = read_keys(whole, JudgedSuiteKeys if with_expectations else SuiteKeys)
    context = SuiteContext.read(whole, keys, folder, behaviours)
    titles: set[str] = set()
    cases: list[Case] = []
    listed = whole.node_of("cases")
    nodes = listed.items if isinstance(listed, Listing) else []
    for place, case in enumerate(keys.cases):
        wrong = [path[2:] for path in whole.wrong_places if path[:2] == ("cases", place)]
        cases.append(_read_case(whole, nodes[place], case, wrong, context))
        if case.case and case.case in titles:
            fields.add_error(cases[-1].mark, f"a second case '{case.case}'")
        titles.add(case.case)
    if not cases and not fields.diagnostics:
        fields.add_error(fields.node.mark, "the file has no cases", "write 'cases:' and under it '- case: TITLE'")
    if fields.diagnostics:
        raise InvalidFileError(fields.diagnostics)
    return tuple(cases)


def _read_case(suite: Fields, node: Node, keys: CommonKeys, wrong: list[Place], context: SuiteContext) -> Case:
    """Return a case, read from its keys; keys whose places are in ``wrong`` have an error already and are skipped."""
    fields = Fields(suite.source, node, [], subject="a case")
    fields.diagnostics, fields.wrong_places = suite.diagnostics, wrong
    setting = context.read_setting(fields, keys)
    mocks, mishaps = read_given(fields, setting)
    return Case(
        keys.case,
        suite.source,
        node.mark,
        context.mission,
        setting.params,
        setting.robot,
        setting.world,
        keys.seed,
        keys.eyes,
        keys.physics,
        keys.timeout,
        context.behaviours,
        mocks,
        mishaps,
        read_expectations(fields, keys.expect, setting.names),
    )


def _merge_shared(top: Node) -> Node:
    """Return a test file in which each case has the keys that the cases share."""
    shared, cases = (top.get(word) if isinstance(top, Mapping) else None for word in ("with", "cases"))
    if not isinstance(top, Mapping) or not isinstance(shared, Mapping) or not isinstance(cases, Listing):
        return top
    listed = Listing(cases.mark, [merge_case(shared, case) for case in cases.items])
    entries = [(key, listed if value is cases else value) for key, value in top.entries if value is not shared]
    return Mapping(top.mark, entries, top.torn)


def merge_case(shared: Mapping | None, case: Node) -> Node:
    """Return a case with the shared keys added.

    If both have a key, lists and mappings are joined, and for any other value that of the case is used.
    """
    if shared is None or not isinstance(case, Mapping):
        return case
    entries = [(key, _merge_values(shared.get(key.text), value)) for key, value in case.entries]
    own = {key.text for key, _ in case.entries}
    return Mapping(case.mark, entries + [(key, value) for key, value in shared.entries if key.text not in own])


def _merge_values(shared: Node | None, own: Node) -> Node:
    if isinstance(shared, Mapping) and isinstance(own, Mapping):
        names = {key.text for key, _ in own.entries}
        return Mapping(own.mark, [*(each for each in shared.entries if each[0].text not in names), *own.entries])
    if isinstance(shared, Listing) and isinstance(own, Listing):
        return Listing(own.mark, [*shared.items, *own.items])
    return own


def display_path(path: Path) -> str:
    """Return a path as a user would type it: relative if it is below the working directory."""
    here = Path.cwd()
    return str(path.relative_to(here) if path.is_relative_to(here) else path)


def suite_file_of(mission: Path) -> Path:
    """Return the path of a mission's test file, which need not exist."""
    return mission.with_name(f"{mission.stem}{TEST_SUFFIX}")


def is_test_file(path: Path) -> bool:
    """Return whether a path has the name of a test file."""
    return path.name.endswith(TEST_SUFFIX)


def check_tests(path: Path, behaviours: Sequence[Path]) -> str:
    """Return the number of cases of a test file as text. Raises InvalidFileError with all errors."""
    cases = len(load_suite(path, behaviours))
    return f"{cases} case{'s' if cases > 1 else ''}"


# Finding test files: by path, by folder, or by the mission that they test.


def find_tests(name: str) -> list[Path]:
    """Return the test files for ``name``: the file itself, all in a folder and below, or that of a mission.

    Raises config.library.UnknownNameError if there is none.
    """
    path = Path(name)
    if path.is_dir():
        found = list(_test_files_below(path))
        if not found:
            raise UnknownNameError(f"{name}: this folder holds no tests (files that end in {TEST_SUFFIX})")
        return found
    if is_test_file(path):
        if not path.is_file():
            raise UnknownNameError(f"'{name}': no such file")
        return [path]
    here = Path(f"{name}{TEST_SUFFIX}")
    if here.is_file():
        return [here]
    tests = suite_file_of(find_mission(name))
    if not tests.is_file():
        raise UnknownNameError(
            f"mission '{name}' has no tests: there is no {tests}\n"
            f"  try: create it with `tests: {tests.name.removesuffix(TEST_SUFFIX)}` and `cases:` (docs/testing.md)"
        )
    return [tests]


def all_tests() -> list[Path]:
    """Return the test files in the working directory and below; if there are none, those of the library."""
    return list(_test_files_below(Path())) or [
        tests for path in shipped_missions().values() if (tests := suite_file_of(path)).is_file()
    ]


def _test_files_below(folder: Path) -> Iterator[Path]:
    """Yield the test files in a folder and below, except in hidden folders, such as virtual environments."""
    for path in sorted(folder.rglob(f"*{TEST_SUFFIX}")):
        hidden = any(part.startswith(".") for part in path.relative_to(folder).parts)
        if path.is_file() and not hidden:
            yield path
