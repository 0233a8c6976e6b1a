"""Test files: ``greet.test.yaml`` beside ``greet.yaml`` says which mission is tested, in which cases, and what then."""

from collections.abc import Mapping as Named
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from config.cases import CommonKeys, Eyes, JudgedKeys, SuiteKeys
from config.declared import Path as Place
from config.declared import read_keys
from config.faults import InvalidFileError, Mark, Source
from config.fields import Fields, read_fields
from config.marked import Listing, Mapping, Node
from missions.library.shipped import TESTS
from missions.testing.context import Context
from missions.testing.expectations import Expectation, read_expectations
from missions.testing.given import read_given
from missions.testing.mishaps import Mishap
from missions.testing.mocks import MockSpec


@dataclass(frozen=True, slots=True)
class Case:
    """One case, checked: plain data, which can be sent to another process. ``timeout`` is in simulated seconds.

    ``mission``, ``robot`` and ``world`` are names, or paths that hold wherever the process runs now.
    """

    title: str
    source: Source
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
    mishaps: tuple[Mishap, ...]
    expectations: tuple[Expectation, ...]

    @property
    def place(self) -> str:
        """``FILE:LINE``, where it stands."""
        return f"{self.source.name}:{self.mark.line}"

    def __str__(self) -> str:
        return f"{self.place}: {self.title}"


def load_suite(path: Path, behaviours: Sequence[Path] = ()) -> tuple[Case, ...]:
    """Read and check a test file, and the mission that it tests, with more files of ``behaviours`` than it names.

    Raises InvalidFileError with every mistake in it, or in the mission.
    """
    return read_suite(read_fields(path, what="a test file", name=shown_path(path)), path.parent, behaviours)


def read_suite(
    fields: Fields, folder: Path, behaviours: Sequence[Path] = (), *, judged: bool = True
) -> tuple[Case, ...]:
    """Read the cases of a test file, whose names are relative to ``folder``; ``judged`` asks what each expects.

    Raises InvalidFileError with every mistake in it, or in the mission.
    """
    whole = Fields(fields.source, _merged(fields.node), fields.faults, what=fields.what)
    told = read_keys(whole, JudgedKeys if judged else SuiteKeys)
    context = Context.read(whole, told, folder, behaviours)
    titles: set[str] = set()
    cases: list[Case] = []
    listed = whole.node_of("cases")
    nodes = listed.items if isinstance(listed, Listing) else []
    for place, case in enumerate(told.cases):
        wrong = [path[2:] for path in whole.wrong if path[:2] == ("cases", place)]
        cases.append(_case(whole, nodes[place], case, wrong, context))
        if case.case and case.case in titles:
            fields.fault(cases[-1].mark, f"a second case '{case.case}'")
        titles.add(case.case)
    if not cases and not fields.faults:
        fields.fault(fields.node.mark, "there is no case", "write 'cases:' and under it '- case: what must happen'")
    if fields.faults:
        raise InvalidFileError(fields.faults)
    return tuple(cases)


def _case(suite: Fields, node: Node, told: CommonKeys, wrong: list[Place], context: Context) -> Case:
    """Read what the keys of a case mean; those that are ``wrong`` by themselves are passed over."""
    fields = Fields(suite.source, node, [], what="a case")
    fields.faults, fields.wrong = suite.faults, wrong
    setting = context.setting(fields, told)
    mocks, mishaps = read_given(fields, setting)
    return Case(
        told.case,
        suite.source,
        node.mark,
        context.mission,
        setting.params,
        setting.robot,
        setting.world,
        told.seed,
        told.eyes,
        told.physics,
        told.timeout,
        context.behaviours,
        mocks,
        mishaps,
        read_expectations(fields, told.expect, setting.grammar),
    )


def _merged(top: Node) -> Node:
    """Return a test file in which each case has what all have in common."""
    shared, cases = (top.get(word) if isinstance(top, Mapping) else None for word in ("with", "cases"))
    if not isinstance(top, Mapping) or not isinstance(shared, Mapping) or not isinstance(cases, Listing):
        return top
    listed = Listing(cases.mark, [merged(shared, case) for case in cases.items])
    entries = [(key, listed if value is cases else value) for key, value in top.entries if value is not shared]
    return Mapping(top.mark, entries, top.torn)


def merged(shared: Mapping | None, case: Node) -> Node:
    """Return a case with what all have in common: its own keys come first, lists and mappings are joined."""
    if shared is None or not isinstance(case, Mapping):
        return case
    entries = [(key, _joined(shared.get(key.text), value)) for key, value in case.entries]
    own = {key.text for key, _ in case.entries}
    return Mapping(case.mark, entries + [(key, value) for key, value in shared.entries if key.text not in own])


def _joined(shared: Node | None, own: Node) -> Node:
    if isinstance(shared, Mapping) and isinstance(own, Mapping):
        names = {key.text for key, _ in own.entries}
        return Mapping(own.mark, [*(each for each in shared.entries if each[0].text not in names), *own.entries])
    if isinstance(shared, Listing) and isinstance(own, Listing):
        return Listing(own.mark, [*shared.items, *own.items])
    return own


def shown_path(path: Path) -> str:
    """Return a path as people would type it here: relative, where it lies below this folder."""
    here = Path.cwd()
    return str(path.relative_to(here) if path.is_relative_to(here) else path)


def beside(mission: Path) -> Path:
    """Return the test file that belongs to a mission's file, whether there is one or not."""
    return mission.with_name(f"{mission.stem}{TESTS}")


def is_test_file(path: Path) -> bool:
    """Whether a file is a test file, by its name."""
    return path.name.endswith(TESTS)
