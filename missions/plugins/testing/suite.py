"""Test files: ``greet.test.yaml`` beside ``greet.yaml`` names the mission under test, its cases and expectations."""

import re
from collections.abc import Callable, Collection, Iterator, Sequence
from collections.abc import Mapping as Named
from dataclasses import dataclass, replace
from pathlib import Path

from config.cases import GIVEN_HINT, CommonKeys, Eyes, JudgedSuiteKeys, SuiteKeys
from config.diagnostics import InvalidFileError, Mark, SourceText, suggest_from
from config.fields import Fields, read_fields
from config.library import UnknownNameError
from config.section_reader import KeyPath as Place
from config.section_reader import read_keys
from config.units import quoted_value, with_article
from config.yaml_nodes import Listing, Mapping, Node, Scalar
from missions.language.split_values import join_split_values
from missions.library.shipped import TEST_SUFFIX, find_mission, shipped_missions
from missions.plugins.testing.expectations import Expectation, read_expectations
from missions.plugins.testing.fault_specs import RUN, FaultSpec, read_fault
from missions.plugins.testing.mock_reader import read_mock
from missions.plugins.testing.mocks import VERBS, MockSpec
from missions.plugins.testing.phrases import Phrase
from missions.plugins.testing.suite_context import CaseSetting, SuiteContext

# What a case is given: leaves that are mocked, and what goes wrong with the robot.


def read_given(fields: Fields, setting: CaseSetting) -> tuple[tuple[MockSpec, ...], tuple[FaultSpec, ...]]:
    """Return the mocks and faults of the list ``given``: a text is a fault, one key with a value is a mock."""
    mocks: list[MockSpec] = []
    mishaps: list[FaultSpec] = []
    listed = fields.node_of("given")
    for place, node in enumerate(listed.items if isinstance(listed, Listing) else []):
        if any(path[:2] == ("given", place) for path in fields.wrong_places):
            continue
        if isinstance(node, Mapping) and node.entries:
            mocks += [read_mock(fields, key, value, setting) for key, value in node.entries]
        elif isinstance(node, Scalar):
            mishaps.append(_read_fault(fields, node, setting))
        else:
            fields.add_error(node.mark, "neither a mock nor something that goes wrong", GIVEN_HINT)
    _report_second_mocks(fields, listed)
    return tuple(mocks), tuple(mishaps)


def _report_second_mocks(fields: Fields, listed: Node | None) -> None:
    """Add an error for each mock in a list that would have no effect, because an earlier one has the same target."""
    items = listed.items if isinstance(listed, Listing) else []
    seen: set[str] = set()
    for key in (key for item in items if isinstance(item, Mapping) for key, _ in item.entries):
        if key.text in seen:
            hint = f"write all its outcomes in one script: '{key.text}: fails twice, then succeeds'"
            fields.add_error(key.mark, f"a second mock of {quoted_value(key.text)}", hint)
        seen.add(key.text)


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
    top = _merge_shared(_join_scripts(fields))
    whole = Fields(fields.source, top, fields.diagnostics, subject=fields.subject)
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
    _check_time_limit(fields, keys)
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


def _check_time_limit(fields: Fields, keys: CommonKeys) -> None:
    """Add an error if a case expects a mission that still runs, and does not say when the run is ended."""
    expect = fields.node_of("expect")
    result = expect.get("result") if isinstance(expect, Mapping) else None
    is_endless = keys.expect is not None and keys.expect.result == "running"
    if is_endless and result is not None and fields.node_of("timeout") is None:
        hint = "write 'timeout: 30 s' beside 'expect'"
        fields.add_error(result.mark, "'running' needs the time after which the run is ended", hint)


def _join_scripts(fields: Fields) -> Node:
    """Return a test file in which each script of a mock that YAML has split is whole again; report each of them."""

    def join_given(case: Node) -> Node:
        return _replace_value(case, "given", lambda given: join_split_values(given, fields.add_error, _is_split_script))

    def join_cases(cases: Node) -> Node:
        return replace(cases, items=[join_given(case) for case in cases.items]) if isinstance(cases, Listing) else cases

    return _replace_value(_replace_value(fields.node, "with", join_given), "cases", join_cases)


def _replace_value(node: Node, word: str, change: Callable[[Node], Node]) -> Node:
    if not isinstance(node, Mapping):
        return node
    return replace(node, entries=[(key, change(value) if key.text == word else value) for key, value in node.entries])


def _is_split_script(text: str, part: str) -> bool:
    """Return whether ``text`` is the script of a mock that goes on with ``part``; an empty part is its end."""
    is_continued = part.startswith("then ") or text.count('"') % 2 == 1
    return is_continued and re.match(rf"(?:{'|'.join(VERBS)})\b", text) is not None


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

    If both have a key, lists and mappings are joined, and for any other value that of the case is used. An empty list
    or mapping of a case replaces the shared one, and its mocks replace shared ones of the same behaviours.
    """
    if shared is None or not isinstance(case, Mapping):
        return case
    entries = [(key, _merge_values(shared.get(key.text), value)) for key, value in case.entries]
    own = {key.text for key, _ in case.entries}
    return Mapping(case.mark, entries + [(key, value) for key, value in shared.entries if key.text not in own])


def _merge_values(shared: Node | None, own: Node) -> Node:
    if isinstance(shared, Mapping) and isinstance(own, Mapping) and own.entries:
        return Mapping(own.mark, [*_without_keys(shared, {*own.keys()}).entries, *own.entries])
    if isinstance(shared, Listing) and isinstance(own, Listing) and own.items:
        mocked = {key.text for item in own.items if isinstance(item, Mapping) for key, _ in item.entries}
        kept = [_without_keys(item, mocked) if isinstance(item, Mapping) else item for item in shared.items]
        left = [item for item in kept if not isinstance(item, Mapping) or item.entries]
        return Listing(own.mark, [*left, *own.items])
    return own


def _without_keys(node: Mapping, words: Collection[str]) -> Mapping:
    return replace(node, entries=[(key, value) for key, value in node.entries if key.text not in words])


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
