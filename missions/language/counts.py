"""``success_count``, ``failure_count`` and ``wait_for_all``: how many children decide a ``parallel``."""

from collections.abc import Mapping as Named
from functools import partial

from config.marked import Mapping, Node, Scalar
from config.units import seen
from drivers.api.quick import dataclass
from missions.language.notes import Notes
from missions.language.values import UNREAD, Value, whole

SUCCESS_COUNT, FAILURE_COUNT, WAIT_FOR_ALL = "success_count", "failure_count", "wait_for_all"

COUNTS = {
    SUCCESS_COUNT: ("a count or all", "succeeds once so many children have; all, where it is not said"),
    FAILURE_COUNT: ("a count or all", "fails once so many children have, or success is impossible; 1 if not said"),
    WAIT_FOR_ALL: ("true", "halts none of them, and ends when all have ended"),
}
"""What may stand beside a ``parallel``: what each takes, and what it does."""

ALL = "all"
"""The count of all children, whatever their number."""


@dataclass(frozen=True, slots=True)
class Decision:
    """When a parallel ends: once ``successes`` of its children have succeeded, or ``failures`` have failed.

    ``waits``: it ends only when all children have, and succeeds when fewer than ``failures`` have failed.
    """

    successes: int
    failures: int
    waits: bool = False


def decision(children: int, settings: Named[str, object]) -> Decision:
    """Return what decides a parallel; ``settings`` are its own.

    It fails once as many have failed as ``failure_count`` says, or as many that too few are left that could succeed.
    """
    successes = settings.get(SUCCESS_COUNT)
    failures = settings.get(FAILURE_COUNT, 1)
    needed = successes if isinstance(successes, int) else children
    enough = failures if isinstance(failures, int) else children
    return Decision(needed, min(enough, children - needed + 1), bool(settings.get(WAIT_FOR_ALL)))


def read_counts(notes: Notes, beside: Mapping, children: int) -> dict[str, Value]:
    """Read what stands beside a parallel of so many children."""
    found = {word.text: _read(notes, word.text, node, children) for word, node in beside.entries if word.text in COUNTS}
    settings = {word: value.constant for word, value in found.items() if value.template is None}
    if children and len(settings) == len(found) and FAILURE_COUNT in found:
        decided, asked = decision(children, settings), settings[FAILURE_COUNT]
        first = "the first failure" if decided.failures == 1 else f"{decided.failures} failures"
        too_many = isinstance(asked, int) and asked > decided.failures
        if too_many or (asked == ALL and decided.successes == children):
            notes.fault(
                next(word.mark for word, _ in beside.entries if word.text == FAILURE_COUNT),
                f"'{FAILURE_COUNT}' cannot matter: after {first}, {decided.successes} of {children} cannot succeed",
                f"write '{SUCCESS_COUNT}' too: how many must succeed"
                if decided.successes == children
                else f"write '{FAILURE_COUNT}: {ALL}': it fails once {decided.successes} cannot succeed any more",
            )
    return found


def _read(notes: Notes, word: str, node: Node, children: int) -> Value:
    what = f"'{word}'"
    if word == WAIT_FOR_ALL:
        if not isinstance(node, Scalar) or node.value is not True:
            notes.fault(node.mark, f"{what} takes only true")
        return Value(True)
    if not isinstance(node, Scalar):
        notes.fault(node.mark, f"{what} needs a count, or all")
        return UNREAD
    return notes.value(node, what, partial(_count, children))


def _count(children: int, value: object) -> int | str:
    if value == ALL:
        return ALL
    number = whole(value)
    if number is None or number < 1:
        raise ValueError(f"needs a count of 1 or more, or all, got {seen(value)}")
    if 0 < children < number:
        raise ValueError(f"must be at most {children}, the number of its children, got {number}")
    return number
