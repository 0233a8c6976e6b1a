"""Test files: ``greet.test.yaml`` beside ``greet.yaml`` says which mission is tested, in which cases, and what then."""

from collections.abc import Mapping as Named
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from config.faults import InvalidFileError, Mark, Source
from config.fields import Fields, read_fields
from config.marked import Listing, Mapping, Node
from missions.library import TESTS
from missions.testing.context import Context
from missions.testing.expectations import Expectation, read_expectations
from missions.testing.given import read_given
from missions.testing.mishaps import Mishap
from missions.testing.mocks import MockSpec

TIMEOUT = 120.0
"""Seconds of simulated time after which a case that still runs has failed, unless its file says otherwise."""

Eyes = Literal["pixels", "truth"]


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
    context = Context.read(fields, folder, behaviours)
    shared = fields.node_of("with")
    if shared is not None and not isinstance(shared, Mapping):
        fields.fault(shared.mark, "'with' needs what all cases have in common", "such as {world: living_room}")
    nodes = fields.items("cases", required=True)
    fields.done()
    common = shared if isinstance(shared, Mapping) else None
    cases = tuple(_case(fields, merged(common, node), context, judged=judged) for node in nodes)
    titles: set[str] = set()
    for case in cases:
        if case.title and case.title in titles:
            fields.fault(case.mark, f"a second case '{case.title}'")
        titles.add(case.title)
    if not cases and not fields.faults:
        fields.fault(fields.node.mark, "there is no case", "write 'cases:' and under it '- case: what must happen'")
    if fields.faults:
        raise InvalidFileError(fields.faults)
    return cases


def _case(suite: Fields, node: Node, context: Context, *, judged: bool) -> Case:
    fields = Fields(suite.source, node, suite.faults, what="a case")
    title = fields.text("case")
    setting = context.setting(fields)
    mocks, mishaps = read_given(fields, setting)
    expect = fields.section("expect", required=judged)
    case = Case(
        title,
        suite.source,
        node.mark,
        context.mission,
        setting.params,
        setting.robot,
        setting.world,
        fields.integer("seed", 0, low=0),
        "truth" if fields.choice("eyes", ("pixels", "truth"), "pixels") == "truth" else "pixels",
        fields.quantity("timeout", "duration", TIMEOUT, low=0.1),
        context.behaviours,
        mocks,
        mishaps,
        () if expect is None else read_expectations(expect, setting.grammar),
    )
    fields.done()
    return case


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
