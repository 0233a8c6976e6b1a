"""Kinds of nodes, each declared once: help, symbol, and rules of execution.

Checker, ``mission verify``, statistics, pictures, schemas and docs read these tables; the node classes are in
``missions.executive``, by the same words.
"""

from collections.abc import Mapping
from typing import Literal

from drivers.api.fast_dataclass import dataclass

SUCCESS, FAILURE, SKIPPED = "success", "failure", "skipped"

RESTART = "again"
"""Value in ``ModifierKind.success`` and ``failure``: after this result of its child, the modifier restarts the child.
"""

Ends = frozenset[str]
BOTH_ENDS: Ends = frozenset({SUCCESS, FAILURE})


@dataclass(frozen=True, slots=True)
class ParentKind:
    """A kind of node with children, other than a modifier.

    ``help`` is a description, ``symbol`` its sign in behaviour tree notation (in the font DejaVu Sans).
    ``unreached_reason`` explains in errors why a child is never reached.
    """

    help: str
    symbol: str
    unreached_reason: str = ""


@dataclass(frozen=True, slots=True)
class CompositeKind(ParentKind):
    """A kind of node with a list of children.

    ``order`` is the order in which they are ticked. ``passes`` is the result of a child after which the other children
    still run: success in a sequence, failure in a selector, empty for a race. A ``reactive`` composite starts from the
    first child at every tick.
    """

    order: Literal["in order", "in any order", "at once"] = "in order"
    passes: str = ""
    reactive: bool = False

    @property
    def at_once(self) -> bool:
        """True if the children of the composite run at the same time."""
        return self.order == "at once"


@dataclass(frozen=True, slots=True)
class SwitchKind(ParentKind):
    """A kind of node that selects a child by an expression: at its start, or at each tick if ``reactive``."""

    reactive: bool = False


@dataclass(frozen=True, slots=True)
class ModifierKind:
    """A kind of node around one child, written beside the child in a mission.

    - ``takes`` describes its value for people, and ``value`` is the type of the value; ``constants`` are all allowed
      values if they are few.
    - ``success`` and ``failure`` say what can follow that result of the child: one of the modifier, or ``RESTART``.
    - ``early_ends`` are the results that the modifier can have while its child has none; for ``on_running``, its
      value selects one of them. ``early_end_text`` describes when this happens; empty if it needs an earlier success.
    - ``every_tick`` is true for a condition that is evaluated at each tick.
    - ``child_ticks`` says whether each tick of the modifier ticks the child: ``always``, ``sometimes``, or ``afresh``
      (once the child has a result, only after a restart).
    - ``relevant_end`` is the result of the child without which the modifier has no effect.
    """

    help: str
    takes: str
    value: Literal["condition", "duration", "count", "constant", "expression", "node"]
    success: Ends = frozenset({SUCCESS})
    failure: Ends = frozenset({FAILURE})
    early_ends: Ends = frozenset()
    early_end_text: str = ""
    every_tick: bool = False
    child_ticks: Literal["always", "sometimes", "afresh"] = "always"
    relevant_end: str = ""
    unreached_reason: str = ""
    constants: tuple[bool | str, ...] = ()

    @property
    def repeats(self) -> bool:
        """True if the modifier can start its child again after the child has ended."""
        return RESTART in self.success | self.failure

    @property
    def remembers(self) -> bool:
        """True if the modifier can return an earlier result without ticking its child."""
        return self.child_ticks == "afresh" and not self.repeats and self.value != "node"

    def without_limit(self, end: str) -> bool:
        """Return True if, with the count ``forever``, the modifier restarts its child after each result ``end``."""
        return self.value == "count" and RESTART in (self.success if end == SUCCESS else self.failure)


COMPOSITES: Mapping[str, CompositeKind] = {
    "sequence": CompositeKind(
        "ticks its children in order; fails at the first failure",
        "→",
        "the child before it never succeeds",
        passes=SUCCESS,
    ),
    "reactive_sequence": CompositeKind(
        "a sequence that restarts from the first child at every tick",
        "→↻",
        "the child before it never succeeds",
        passes=SUCCESS,
        reactive=True,
    ),
    "random_sequence": CompositeKind(
        "a sequence in a random order, drawn at each start", "→~", order="in any order", passes=SUCCESS
    ),
    "selector": CompositeKind(
        "ticks its children in order until one succeeds", "?", "the child before it never fails", passes=FAILURE
    ),
    "reactive_selector": CompositeKind(
        "a selector that restarts from the first child at every tick",
        "?↻",
        "the child before it never fails",
        passes=FAILURE,
        reactive=True,
    ),
    "random_selector": CompositeKind(
        "a selector in a random order, drawn at each start", "?~", order="in any order", passes=FAILURE
    ),
    "parallel": CompositeKind(
        "ticks all children; succeeds when all have succeeded",
        "⇉",
        "an earlier child always ends it first",
        order="at once",
        passes=SUCCESS,
    ),
    "race": CompositeKind(
        "ticks all children; ends when the first one ends",
        "⇉¹",
        "an earlier child always ends first",
        order="at once",
    ),
}
"""Composites with a list of children."""

IN_TURN, WEIGHTS = "in_turn", "weights"
"""Keys beside a selector that set the order of its children."""

IN_TURN_SELECTOR = CompositeKind(
    "a selector that starts with the child after the one that ran last",
    "?⇢",
    "its turn never comes",
    order="in any order",
    passes=FAILURE,
)
"""Kind of a ``selector`` with ``in_turn``."""


ORDER_KEYS: Mapping[str, tuple[str, str, str]] = {
    IN_TURN: ("selector", "true", "starts with the child after the one that ran last, in this run"),
    WEIGHTS: (
        "random_selector",
        "a list of numbers",
        "a number for each child: its chance to be drawn before the others; 0 for never",
    ),
}
"""Keys that set the order of a selector's children: the composite beside which each stands, its form, its meaning."""

AT_ONCE = frozenset(word for word, kind in COMPOSITES.items() if kind.at_once)
"""Composites whose children run at the same time."""

SWITCH, REACTIVE_SWITCH = "switch", "reactive_switch"

NO_CASE = "the expression never has the value of this case"

SWITCHES: Mapping[str, SwitchKind] = {
    SWITCH: SwitchKind(
        "runs the child whose case equals the value of an expression, evaluated at the start", "⇄", NO_CASE
    ),
    REACTIVE_SWITCH: SwitchKind(
        "a switch that evaluates at every tick; a new case first halts the running child",
        "⇄↻",
        NO_CASE,
        reactive=True,
    ),
}
"""Composites that select a child."""

FOR_EACH, MISSION, WAIT_FOR = "for_each", "mission", "wait_for"

OTHER_PARENTS: Mapping[str, ParentKind] = {
    **SWITCHES,
    FOR_EACH: ParentKind(
        "runs a behaviour for each member of a list, one after another; fails at the first failure",
        "∀",
        "its list is always empty",
    ),
    WAIT_FOR: ParentKind("ticks a behaviour until it succeeds; a failure of it means 'not yet'", "◷"),
    MISSION: ParentKind("runs another mission", "▣"),
}
"""Nodes with children that are not written as one list: switches, ``for_each`` and sub-missions."""

BRANCHES: Mapping[str, ParentKind] = {**COMPOSITES, **OTHER_PARENTS}
"""All nodes with children except modifiers."""

RETRY, RECOVER, FINALLY, HALT_LIMIT = "retry", "recover", "finally", "halt_limit"

TIME_LIMITS = frozenset({"for", "timeout"})
"""Modifiers that halt the node once it has run for a time."""

MODIFIERS: Mapping[str, ModifierKind] = {
    "if": ModifierKind(
        "evaluated once, at the start; if false, the node is skipped: its parent goes on without it",
        "an expression",
        "condition",
        early_ends=frozenset({SKIPPED}),
        early_end_text="is false",
        child_ticks="sometimes",
        unreached_reason="its condition is never true",
    ),
    "while": ModifierKind(
        "evaluated at every tick; once false, the node is halted and fails",
        "an expression",
        "condition",
        early_ends=frozenset({FAILURE}),
        early_end_text="is false",
        every_tick=True,
        child_ticks="sometimes",
        unreached_reason="its condition is never true",
    ),
    "until": ModifierKind(
        "evaluated at every tick; once true, the node is halted and succeeds",
        "an expression",
        "condition",
        early_ends=frozenset({SUCCESS}),
        early_end_text="is true",
        every_tick=True,
        child_ticks="sometimes",
        unreached_reason="its condition is true from the start",
    ),
    "for": ModifierKind(
        "halts the node after this time, and succeeds; an earlier end of the node counts",
        "a duration",
        "duration",
        early_ends=frozenset({SUCCESS}),
        early_end_text="is over",
        child_ticks="sometimes",
    ),
    "timeout": ModifierKind(
        "fails, and halts the node, if it still runs after this time",
        "a duration",
        "duration",
        early_ends=frozenset({FAILURE}),
        early_end_text="is over",
        child_ticks="sometimes",
    ),
    RETRY: ModifierKind(
        "restarts the node after a failure; the value is the number of attempts",
        "a count or forever",
        "count",
        failure=frozenset({FAILURE, RESTART}),
        child_ticks="afresh",
        relevant_end=FAILURE,
        unreached_reason="no attempt before the last one fails",
    ),
    "repeat": ModifierKind(
        "restarts the node after a success; the value is the number of runs",
        "a count or forever",
        "count",
        success=frozenset({SUCCESS, RESTART}),
        child_ticks="afresh",
        relevant_end=SUCCESS,
    ),
    "invert": ModifierKind(
        "exchanges success and failure",
        "true",
        "constant",
        constants=(True,),
        success=frozenset({FAILURE}),
        failure=frozenset({SUCCESS}),
    ),
    "on_failure": ModifierKind(
        "turns a failure into a success",
        "succeed",
        "constant",
        constants=("succeed",),
        failure=frozenset({SUCCESS}),
        relevant_end=FAILURE,
    ),
    "on_success": ModifierKind(
        "turns a success into a failure",
        "fail",
        "constant",
        constants=("fail",),
        success=frozenset({FAILURE}),
        relevant_end=SUCCESS,
    ),
    "on_running": ModifierKind(
        "halts a node that still runs after its tick, with this result",
        "succeed or fail",
        "constant",
        constants=("succeed", "fail"),
        early_ends=BOTH_ENDS,
        early_end_text="ends it",
    ),
    "hold": ModifierKind(
        "succeeds once the node has succeeded at every tick for this time",
        "a duration",
        "duration",
        success=frozenset({SUCCESS, RESTART}),
        failure=frozenset({RESTART}),
        relevant_end=SUCCESS,
    ),
    "delay": ModifierKind(
        "waits for this time before the node starts",
        "a duration",
        "duration",
        child_ticks="sometimes",
        unreached_reason="something else always ends it before",
    ),
    "cooldown": ModifierKind(
        "fails without starting the node within this time after its last success",
        "a duration",
        "duration",
        early_ends=frozenset({FAILURE}),
        child_ticks="sometimes",
        relevant_end=SUCCESS,
    ),
    "once": ModifierKind(
        "returns the first result again without running the node; with an expression, while its value stays the same",
        "true or an expression",
        "expression",
        child_ticks="afresh",
    ),
    FINALLY: ModifierKind(
        "runs this behaviour once after the node has ended or was halted; its result does not count",
        "a behaviour that moves nothing",
        "node",
        child_ticks="afresh",
        unreached_reason="the node is always skipped",
    ),
}
"""Modifiers by word; if a node has several, earlier ones enclose later ones."""

CLEANUP_CLAIMS = frozenset({"voice", "screen"})
"""Claims that a leaf within ``finally`` may have: everything else could move the robot after its mission has ended."""

NODES: Mapping[str, ParentKind | ModifierKind] = {**BRANCHES, **MODIFIERS}
"""All kinds of nodes except leaves, by their word in missions."""

MODIFIER_KEYS: Mapping[str, tuple[str, str, str]] = {
    RECOVER: (
        RETRY,
        "a behaviour",
        "runs this behaviour after each failed attempt but the last; its result does not count",
    ),
    HALT_LIMIT: (
        FINALLY,
        "a duration",
        "halts the behaviour of finally if it still runs after this time (default: 1 s)",
    ),
}
"""Keys beside a modifier: the modifier that each belongs to, the form of its value, and its meaning."""

FAILURE_NAME = "failure"
"""Name by which an expression reads the reason of the last failure around it."""


OWNED_KEYS: Mapping[str, tuple[str, str, str]] = {**MODIFIER_KEYS, **ORDER_KEYS}
"""Keys that stand beside one kind of node only, of which they change a setting."""


def provides_failure(kind: str, place: int) -> bool:
    """Return whether child ``place`` (from 0) of a node of this kind can read the reason of an earlier failure there.

    These are the later children of a selector, and the behaviours of ``recover`` and ``finally``.
    """
    composite = COMPOSITES.get(kind)
    if composite is None:
        return kind in MODIFIERS and place > 0
    is_selector = composite.passes == FAILURE
    return is_selector and (place > 0 or composite.order == "in any order")
