"""The kinds of nodes, each declared once: its help, its sign, and how a run goes through it.

Checker, ``mission verify``, statistics, pictures, schemas and documentation read these tables; the classes that are
ticked stand in ``missions.executive``, each under the word of its kind.
"""

from collections.abc import Mapping
from typing import Literal

from drivers.api.fast_dataclass import dataclass

SUCCESS, FAILURE = "success", "failure"

RESTART = "again"
"""How a modifier goes on that starts its child anew, or asks it once more."""

Ends = frozenset[str]
BOTH_ENDS: Ends = frozenset({SUCCESS, FAILURE})


@dataclass(frozen=True, slots=True)
class ParentKind:
    """A kind of node that has others below it, but for modifiers.

    ``help`` is what it does, ``symbol`` its sign in the notation of behaviour trees (all are in DejaVu Sans),
    ``unreached_reason`` why a child of it is never reached.
    """

    help: str
    symbol: str
    unreached_reason: str = ""


@dataclass(frozen=True, slots=True)
class CompositeKind(ParentKind):
    """A kind of node with a list of children.

    ``order`` is how it goes through them. ``passes`` is the end of a child that lets it go on with the others: of none
    in a race. A ``reactive`` one asks again from the first child at every tick.
    """

    order: Literal["in order", "in any order", "at once"] = "in order"
    passes: str = ""
    reactive: bool = False

    @property
    def at_once(self) -> bool:
        """True where its children run at the same time."""
        return self.order == "at once"


@dataclass(frozen=True, slots=True)
class SwitchKind(ParentKind):
    """A kind of node that chooses one child by the value of an expression: at its start, or ``reactive``, each tick."""

    reactive: bool = False


@dataclass(frozen=True, slots=True)
class ModifierKind:
    """A kind of node around one other, written beside it.

    ``takes`` is the form of its value, in words; ``value`` the type of it, and ``constants`` all that it can be, where
    these are few. ``success`` and ``failure`` are the ways on when its child has ended so: an end of its own, or
    ``RESTART``. ``early_ends`` are the ends that it comes to besides, without an end of its child (``on_running``: one of them,
    by its value), and ``early_end_text`` says in which case; nothing where that comes only after an earlier success.
    ``every_tick`` says that its condition is asked at each tick. ``child_ticks`` says whether the child is ticked at each
    tick of its own, only at some, or ``afresh`` each time. ``relevant_end`` is the end of its child without which it makes
    no difference.
    """

    help: str
    takes: str
    value: Literal["condition", "duration", "count", "constant", "expression"]
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
        """True where it starts its child anew, or asks it once more, after an end."""
        return RESTART in self.success | self.failure

    @property
    def remembers(self) -> bool:
        """True where it answers with an earlier result, without its child."""
        return self.child_ticks == "afresh" and not self.repeats

    def without_limit(self, end: str) -> bool:
        """True where it goes on for ever after this end of its child, if its count is ``forever``."""
        return self.value == "count" and RESTART in (self.success if end == SUCCESS else self.failure)


COMPOSITES: Mapping[str, CompositeKind] = {
    "sequence": CompositeKind(
        "does one after another; fails at the first failure",
        "→",
        "what stands before it never succeeds",
        passes=SUCCESS,
    ),
    "reactive_sequence": CompositeKind(
        "a sequence that asks again from the first at every tick",
        "→↻",
        "what stands before it never succeeds",
        passes=SUCCESS,
        reactive=True,
    ),
    "random_sequence": CompositeKind(
        "a sequence in an order drawn afresh at each start", "→~", order="in any order", passes=SUCCESS
    ),
    "selector": CompositeKind(
        "tries one after another until one succeeds", "?", "what stands before it never fails", passes=FAILURE
    ),
    "reactive_selector": CompositeKind(
        "a selector that asks again from the first at every tick",
        "?↻",
        "what stands before it never fails",
        passes=FAILURE,
        reactive=True,
    ),
    "random_selector": CompositeKind(
        "a selector in an order drawn afresh at each start", "?~", order="in any order", passes=FAILURE
    ),
    "parallel": CompositeKind(
        "does all at once; succeeds when all have",
        "⇉",
        "what stands before it always ends it first",
        order="at once",
        passes=SUCCESS,
    ),
    "race": CompositeKind(
        "does all at once; ends with the first that ends",
        "⇉¹",
        "what stands before it always ends first",
        order="at once",
    ),
}
"""The composites with a list of children."""

AT_ONCE = frozenset(word for word, kind in COMPOSITES.items() if kind.at_once)
"""The composites whose children run at the same time."""

SWITCH, REACTIVE_SWITCH = "switch", "reactive_switch"

NO_CASE = "the value of this case never comes"

SWITCHES: Mapping[str, SwitchKind] = {
    SWITCH: SwitchKind("does the one whose case is the value of an expression, asked when it starts", "⇄", NO_CASE),
    REACTIVE_SWITCH: SwitchKind(
        "a switch that asks at every tick; another case halts the one that runs before it starts",
        "⇄↻",
        NO_CASE,
        reactive=True,
    ),
}
"""The composites that choose."""

FOR_EACH, MISSION = "for_each", "mission"

OTHER_PARENTS: Mapping[str, ParentKind] = {
    **SWITCHES,
    FOR_EACH: ParentKind(
        "does one behaviour for each member of a list, one after another; fails at the first failure",
        "∀",
        "its list is always empty",
    ),
    MISSION: ParentKind("runs another mission", "▣"),
}
"""The nodes that have others below them in ways of their own."""

BRANCHES: Mapping[str, ParentKind] = {**COMPOSITES, **OTHER_PARENTS}
"""All nodes that have others below them, but for modifiers."""

MODIFIERS: Mapping[str, ModifierKind] = {
    "if": ModifierKind(
        "asked once, at the start; false skips the node, which counts as success; for 'else' use switch",
        "an expression",
        "condition",
        early_ends=frozenset({SUCCESS}),
        early_end_text="is false",
        child_ticks="sometimes",
        unreached_reason="its condition is never true",
    ),
    "while": ModifierKind(
        "asked at every tick; once false, the node is halted and fails",
        "an expression",
        "condition",
        early_ends=frozenset({FAILURE}),
        early_end_text="is false",
        every_tick=True,
        child_ticks="sometimes",
        unreached_reason="its condition is never true",
    ),
    "until": ModifierKind(
        "asked at every tick; once true, the node is halted and succeeds",
        "an expression",
        "condition",
        early_ends=frozenset({SUCCESS}),
        early_end_text="is true",
        every_tick=True,
        child_ticks="sometimes",
        unreached_reason="its condition is true from the start",
    ),
    "timeout": ModifierKind(
        "fails, halting the node, when it still runs after that long",
        "a duration",
        "duration",
        early_ends=frozenset({FAILURE}),
        early_end_text="is over",
        child_ticks="sometimes",
    ),
    "retry": ModifierKind(
        "starts again after a failure; the count is of attempts",
        "a count or forever",
        "count",
        failure=frozenset({FAILURE, RESTART}),
        child_ticks="afresh",
        relevant_end=FAILURE,
    ),
    "repeat": ModifierKind(
        "starts again after a success; the count is of runs",
        "a count or forever",
        "count",
        success=frozenset({SUCCESS, RESTART}),
        child_ticks="afresh",
        relevant_end=SUCCESS,
    ),
    "invert": ModifierKind(
        "success for failure and failure for success",
        "true",
        "constant",
        constants=(True,),
        success=frozenset({FAILURE}),
        failure=frozenset({SUCCESS}),
    ),
    "on_failure": ModifierKind(
        "a failure counts as success",
        "succeed",
        "constant",
        constants=("succeed",),
        failure=frozenset({SUCCESS}),
        relevant_end=FAILURE,
    ),
    "on_success": ModifierKind(
        "a success counts as failure",
        "fail",
        "constant",
        constants=("fail",),
        success=frozenset({FAILURE}),
        relevant_end=SUCCESS,
    ),
    "on_running": ModifierKind(
        "a node that still runs after its tick is halted, and counts as that",
        "succeed or fail",
        "constant",
        constants=("succeed", "fail"),
        early_ends=BOTH_ENDS,
        early_end_text="ends it",
    ),
    "hold": ModifierKind(
        "succeeds once the node has succeeded at every tick for that long",
        "a duration",
        "duration",
        success=frozenset({SUCCESS, RESTART}),
        failure=frozenset({RESTART}),
        relevant_end=SUCCESS,
    ),
    "delay": ModifierKind(
        "waits before the node starts",
        "a duration",
        "duration",
        child_ticks="sometimes",
        unreached_reason="something else always ends it before",
    ),
    "cooldown": ModifierKind(
        "fails without starting within that long after its last success",
        "a duration",
        "duration",
        early_ends=frozenset({FAILURE}),
        child_ticks="sometimes",
        relevant_end=SUCCESS,
    ),
    "once": ModifierKind(
        "after its first end, keeps answering with that result; with an expression, while its value stays the same",
        "true or an expression",
        "expression",
        child_ticks="afresh",
    ),
}
"""What may stand beside a behaviour, outermost first."""

NODES: Mapping[str, ParentKind | ModifierKind] = {**BRANCHES, **MODIFIERS}
"""All kinds of nodes that are no leaves, by their words."""
