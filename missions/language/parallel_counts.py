"""``success_count``, ``failure_count`` and ``wait_for_all``: how many children decide a ``parallel``."""

from collections.abc import Mapping as Named
from collections.abc import Sequence
from functools import partial

from behaviours.leaf import Leaf
from config.units import quoted_value
from config.yaml_nodes import Listing, Mapping, Node, Scalar
from drivers.api.fast_dataclass import dataclass
from missions.language.check_context import CheckContext
from missions.language.expressions import INVALID_VALUE, Value, as_whole_number
from missions.language.nodes import FAILURE, SKIPPED, SUCCESS, Ends

# Arguments as written in the file, for pictures: "60 deg", not 1.0472.


def arguments_as_written(leaf: type[Leaf], node: Node | None) -> dict[str, str]:
    """Return the given arguments of a leaf as in the file, by name."""
    if isinstance(node, Mapping):
        return entries_as_written(node)
    principal = next((argument.name for argument in leaf.arguments.values() if argument.principal), None)
    if principal is None or node is None or (isinstance(node, Scalar) and node.value is None):
        return {}
    return {principal: source_text(node)}


def entries_as_written(node: Node | None) -> dict[str, str]:
    """Return the entries of a mapping as in the file; empty for other nodes."""
    return (
        {name.text: source_text(value_node) for name, value_node in node.entries} if isinstance(node, Mapping) else {}
    )


def source_text(node: Node) -> str:
    """Return the text of a node without quotes; lists as ``[a, b]``, mappings as ``{k: v}``, each on one line."""
    if isinstance(node, Listing):
        return f"[{', '.join(map(source_text, node.items))}]"
    if isinstance(node, Mapping):
        return f"{{{', '.join(f'{name}: {value}' for name, value in entries_as_written(node).items())}}}"
    return node.text


SUCCESS_COUNT, FAILURE_COUNT, WAIT_FOR_ALL = "success_count", "failure_count", "wait_for_all"

COUNTS = {
    SUCCESS_COUNT: ("a count or all", "succeeds after this number of successes (default: all)"),
    FAILURE_COUNT: (
        "a count or all",
        "fails after this number of failures, or when success is impossible (default: 1)",
    ),
    WAIT_FOR_ALL: ("true", "halts no child, and ends when all have ended"),
}
"""Keys that can stand beside a ``parallel``: the form of each key's value, and its meaning."""

ALL_CHILDREN = "all"
"""Value of a count beside a ``parallel`` that means all children."""


@dataclass(frozen=True, slots=True)
class ParallelDecision:
    """Condition after which a parallel ends: a number of ``successes`` or of ``failures`` among its children.

    With ``waits_for_all``, it ends when all children have ended, and succeeds if fewer than ``failures`` failed.
    """

    successes: int
    failures: int
    waits_for_all: bool = False


def decide_parallel(children: int, settings: Named[str, object]) -> ParallelDecision:
    """Return the condition after which a parallel with this number of ``children`` ends, as its counts say.

    ``settings`` are the values of ``success_count``, ``failure_count`` and ``wait_for_all`` beside the parallel, those
    that are written. The parallel fails after ``failure_count`` failures, or after so many that success is impossible.
    """
    successes = settings.get(SUCCESS_COUNT)
    failures = settings.get(FAILURE_COUNT, 1)
    needed = successes if isinstance(successes, int) else children
    enough = failures if isinstance(failures, int) else children
    return ParallelDecision(needed, min(enough, children - needed + 1), bool(settings.get(WAIT_FOR_ALL)))


def parallel_ends(children: int, ends: Named[Ends, int], settings: Named[str, object]) -> Ends:
    """Return the possible results (success, failure, skipped) of a parallel with this number of ``children``.

    ``ends`` counts the children by the results that each of them can have. ``settings`` are as in ``decide_parallel``.
    """
    waits, found = bool(settings.get(WAIT_FOR_ALL)), set[str]()
    succeeded, skipped, failed = _count_ends(ends, (SUCCESS, SKIPPED, FAILURE))
    if not waits:
        failed = 0  # these still run
    if succeeded and (not waits or succeeded + skipped + failed == children):
        decided = decide_parallel(children - skipped, settings)
        if succeeded >= decided.successes and failed < decided.failures:
            found.add(SUCCESS)
    failed, skipped, succeeded = _count_ends(ends, (FAILURE, SKIPPED, SUCCESS))
    if skipped == children and (not waits or any(number and SUCCESS in each for each, number in ends.items())):
        skipped, succeeded = skipped - 1, 1  # a child must run
    can_end = skipped < children and (not waits or failed + skipped + succeeded == children)
    if can_end and failed >= decide_parallel(children - skipped, settings).failures:
        found.add(FAILURE)
    all_skipped = sum(number for each, number in ends.items() if SKIPPED in each) == children
    if all_skipped and (waits or decide_parallel(1, settings).failures > 0):
        found.add(SKIPPED)
    return frozenset(found)


def _count_ends(ends: Named[Ends, int], order: Sequence[str]) -> list[int]:
    """Return the number of children for each result in ``order``, if each child has the first one that it can have."""
    counts = dict.fromkeys(order, 0)
    for each, number in ends.items():
        best = next((end for end in order if end in each), None)
        if best is not None:
            counts[best] += number
    return list(counts.values())


def read_counts(context: CheckContext, beside: Mapping, children: int) -> dict[str, Value]:
    """Return the values of ``success_count``, ``failure_count`` and ``wait_for_all`` beside a parallel.

    ``children`` is the number of its children. Report a ``failure_count`` without effect.
    """
    found = {
        word.text: _read_count(context, word.text, node, children)
        for word, node in beside.entries
        if word.text in COUNTS
    }
    settings = {word: value.constant for word, value in found.items() if value.template is None}
    if children and len(settings) == len(found) and FAILURE_COUNT in found:
        decided, failure_count = decide_parallel(children, settings), settings[FAILURE_COUNT]
        first = "the first failure" if decided.failures == 1 else f"{decided.failures} failures"
        too_many = isinstance(failure_count, int) and failure_count > decided.failures
        if too_many or (failure_count == ALL_CHILDREN and decided.successes == children):
            context.fault(
                next(word.mark for word, _ in beside.entries if word.text == FAILURE_COUNT),
                f"'{FAILURE_COUNT}' has no effect: after {first}, {decided.successes} of {children} cannot succeed",
                f"write '{SUCCESS_COUNT}' too: how many must succeed"
                if decided.successes == children
                else f"write '{FAILURE_COUNT}: {ALL_CHILDREN}': "
                f"it fails once {decided.successes} cannot succeed any more",
            )
    return found


def _read_count(context: CheckContext, word: str, node: Node, children: int) -> Value:
    what = f"'{word}'"
    if word == WAIT_FOR_ALL:
        if not isinstance(node, Scalar) or node.value is not True:
            context.fault(node.mark, f"{what} takes only true")
        return Value(True)
    if not isinstance(node, Scalar):
        context.fault(node.mark, f"{what} needs a count, or all")
        return INVALID_VALUE
    return context.read_value(node, what, partial(_count, children))


def _count(children: int, value: object) -> int | str:
    if value == ALL_CHILDREN:
        return ALL_CHILDREN
    number = as_whole_number(value)
    if number is None or number < 1:
        raise ValueError(f"needs a count of 1 or more, or all, got {quoted_value(value)}")
    if 0 < children < number:
        raise ValueError(f"must be at most {children}, the number of its children, got {number}")
    return number
