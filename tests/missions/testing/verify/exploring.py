"""Exploring missions in tests: from the text of a tree to its verdicts."""

from collections.abc import Iterable, Mapping

from behaviours.catalogue import LEAVES
from behaviours.leaf import Leaf
from config.diagnostics import SourceText
from drivers.clock import ManualClock
from missions.language.document import check_plan
from missions.language.plan import Plan
from missions.library.lookups import LOOKUPS
from missions.library.shipped import find_mission
from missions.plugins.verify.explore import VerificationReport
from missions.plugins.verify.verdicts import MAX_STATES, verify


def plan_of(tree: str, *properties: str, leaves: Iterable[type[Leaf]] = (), params: str = "{}") -> Plan:
    """A checked mission with this tree, which begins at column 0, and these properties."""
    lines = "".join(f"  {line}\n" for line in tree.strip("\n").splitlines())
    promises = "properties:\n" + "".join(f"  - {each}\n" for each in properties) if properties else ""
    text = f"mission: m\nparams: {params}\ntree:\n{lines}{promises}"
    known = {**LEAVES, **{leaf.tag: leaf for leaf in leaves}}
    return check_plan(SourceText("m.yaml", text), known, LOOKUPS, find_mission=find_mission)


def explored(
    tree: str, *properties: str, bound: int = MAX_STATES, leaves: Iterable[type[Leaf]] = ()
) -> VerificationReport:
    """What comes out for such a mission."""
    return verify(plan_of(tree, *properties, leaves=leaves), ManualClock(), bound=bound)


def outcomes(report: VerificationReport) -> Mapping[str, str]:
    """The outcome of every rule, by the first words of the rule."""
    return {verdict.rule: verdict.outcome for verdict in report.verdicts}


def outcome(tree: str, promise: str, *, leaves: Iterable[type[Leaf]] = ()) -> str:
    """The outcome of one property of a tree."""
    return outcomes(explored(tree, promise, leaves=leaves))[promise]
