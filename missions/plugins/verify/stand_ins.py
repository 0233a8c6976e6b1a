"""Stand-ins for leaves: their results at each tick are choices, within the declarations of the real leaf."""

import ast
import inspect
import sys
import textwrap
from types import CodeType, FunctionType
from typing import TYPE_CHECKING, ClassVar, NamedTuple

from py_trees.common import Status

from behaviours.basics import Check, Fail, Log, Pretend, Set, Succeed, Wait, WaitUntil
from behaviours.leaf import FAILURE, IDLE, RUNNING, SUCCESS, Condition, Leaf
from missions.language.plan import Step
from missions.language.robot_state import state_value
from missions.plugins.verify.choices import Oracle
from missions.plugins.verify.places import describe_node
from missions.plugins.verify.rule_monitor import RuleMonitor
from missions.plugins.verify.symbolic_time import Instant
from missions.plugins.verify.unknown_values import UNKNOWN

if TYPE_CHECKING:
    from missions.plugins.verify.tick_merging import TickMerger


class TickOutcome(NamedTuple):
    """Possible result of a leaf at a tick: its status, and whether ``as`` has a result to store."""

    status: Status
    has_result: bool


EARLY_RESULT = TickOutcome(RUNNING, has_result=True)
"""Outcome of a leaf that has a result to store and keeps running."""

STATUS_VERBS = {RUNNING: "runs", SUCCESS: "succeeds", FAILURE: "fails"}

SENSOR_NAMES = {"range": "range finder", "ros2": "topic"}
"""Names in messages of the parts that conditions read, as far as they differ from the part's own name."""

FIXED_STATUSES = {Succeed: SUCCESS, Log: SUCCESS, Fail: FAILURE}
"""Leaves that always return the same status at once."""


class StandIn(Leaf):
    """Leaf that may run, succeed or fail, as listed in ``outcomes``; it has the claims of the real leaf.

    If ``merges_ends``, it never fails, since failure would have the same effect as success. With a ``leader``, another
    stand-in, it runs while the leader runs and ends in the same tick (see missions.plugins.verify.model). ``merger`` is
    called before each tick. ``report`` is the text by which ``Oracle.sensor_reports`` knows the sensor report that the
    leaf reads; stand-ins with the same text read the same report.
    """

    run_state: ClassVar[tuple[str, ...]] = ("live",)
    lasting_state: ClassVar[tuple[str, ...]] = ("_silent_since",)
    oracle: ClassVar[Oracle]
    watch: ClassVar[RuleMonitor]
    outcomes: ClassVar[tuple[TickOutcome, ...]]
    sensor: ClassVar[str]
    needs_new_report: ClassVar[bool]
    lingers: ClassVar[bool]
    never_rests: ClassVar[bool]
    stops: ClassVar[bool]
    live = False
    merges_ends = False
    leader: "StandIn | None" = None
    report = ""
    merger: "TickMerger | None" = None

    @property
    def label(self) -> str:
        """Name and place of the leaf for messages: "drive (line 4)"."""
        return describe_node(self)

    def on_tick(self) -> Status:
        if self.merger is not None:
            self.merger.visit(self)
        return super().on_tick()

    def initialise(self) -> None:
        if self.live:
            self.watch.add_violation(self, "was started again before it was stopped")
        self.live = True
        self.watch.on_start(self)

    def update(self) -> Status:
        """Return one of the outcomes, by choice; suspended while the leaf's sensor does not report."""
        if self.sensor and not self.oracle.sensor_reports(self.sensor, self.report, self._waiting_since()):
            self.result = None
            return self.suspend(self.sensor)
        known = self.output_variable is not None and self.scope.get(self.output_variable) is UNKNOWN
        possible = [outcome for outcome in self.outcomes if not known or outcome != EARLY_RESULT]
        if self.leader is not None:
            goes_on = self.leader.status is RUNNING
            possible = [outcome for outcome in possible if (outcome.status is RUNNING) == goes_on]
        if self.merges_ends and any(outcome.status is SUCCESS for outcome in possible):
            possible = [outcome for outcome in possible if outcome.status is not FAILURE]
        status, found = self.oracle.choose(possible, self._describe_outcome)
        self.result = UNKNOWN if found and self.output_variable is not None else None
        return status

    def _waiting_since(self) -> int | None:
        """Return the index of the instant since which the leaf waits for a new report of its sensor.

        None if it has not waited yet, or if it also accepts a report from before its start.
        """
        since = self._silent_since
        return since.place if self.needs_new_report and isinstance(since, Instant) else None

    def terminate(self, new_status: Status) -> None:
        """Report that the leaf has stopped, if the real leaf stops its parts."""
        if not self.live:
            self.watch.add_violation(self, "was stopped twice")
        self.live = False
        if new_status is IDLE and not self.stops:
            self.watch.on_left_moving(self)

    def halting(self) -> bool:
        """Return whether stopping takes more time: a choice, if the real leaf allows it."""
        return self.lingers and self.oracle.choose((False, True), self._describe_halting)

    def _count_unticked_time(self) -> None:
        """Do nothing: time without a tick has no effect on a tree, and counting it would add states and choices."""

    @property
    def can_end(self) -> bool:
        """Whether the leaf may ever succeed or fail."""
        return any(outcome.status is not RUNNING for outcome in self.outcomes)

    def _describe_outcome(self, outcome: TickOutcome) -> str:
        return f"{self.label} {STATUS_VERBS[outcome.status]}"

    def _describe_halting(self, still: bool) -> str:
        return f"{self.label} still stops" if still else ""


class SetStandIn(StandIn):
    """Stand-in for the leaf that sets variables; it sets them as in a run."""

    def update(self) -> Status:
        self.scope.update(self.values)
        return SUCCESS


class ConditionStandIn(StandIn):
    """Stand-in for a leaf that evaluates a condition, and has ``status_if_false`` if that is false.

    For one that waits, a condition that cannot be calculated is false. But it fails if the base does not measure a
    position that it reads, ``reads_position``. The stand-in gives no reasons of a false condition: the values in a
    reason would be choices without an effect.
    """

    condition: Condition
    status_if_false: ClassVar[Status]
    reads_position: ClassVar[bool]

    def update(self) -> Status:
        waits = self.status_if_false is RUNNING
        if waits and self.reads_position and not self.oracle.choose((True, False), _describe_position):
            return FAILURE
        try:
            return SUCCESS if self.condition.is_true() else self.status_if_false
        except ValueError as error:
            return RUNNING if waits else self.fail(f"{self.label}: {error}")


def _describe_position(measured: bool) -> str:
    return "" if measured else "the base does not measure its position"


class WaitStandIn(StandIn):
    """Stand-in for the leaf that waits: it ends at the first tick after its ``seconds``."""

    run_state = ("_until",)
    seconds: ClassVar[float]
    _until = 0.0

    def initialise(self) -> None:
        super().initialise()
        self._until = self.run.now() + self.seconds

    def update(self) -> Status:
        return SUCCESS if self.run.now() >= self._until else RUNNING


def wait_seconds(step: Step) -> float | None:
    """Return for how many seconds a step's leaf waits; None if that is unknown."""
    if step.leaf is None or not issubclass(step.leaf, Wait) or step.arguments["duration"].template is not None:
        return None
    known = step.arguments["duration"].constant
    return known if isinstance(known, float) else None


def stand_in_class(step: Step, oracle: Oracle, watch: RuleMonitor) -> type[StandIn]:
    """Return the stand-in class for the leaf of a step; equal steps share a class.

    A class for each step would make ``isinstance`` slow, which checks all subclasses of an abstract class.
    """
    alike = step.leaf, wait_seconds(step), outcomes(step), reads_position(step)
    if alike not in watch.stand_ins:
        watch.stand_ins[alike] = _make_stand_in_class(step, oracle, watch)
    return watch.stand_ins[alike]


def _make_stand_in_class(step: Step, oracle: Oracle, watch: RuleMonitor) -> type[StandIn]:
    real = step.leaf or Leaf
    declared = {
        name: getattr(real, name)
        for name in (
            "tag",
            "needs",
            "drives",
            "output_doc",
            "ends",
            "instant",
            "acts",
            "open_ended",
            "halt_limit",
            "arguments",
        )
    }
    seconds = wait_seconds(step)
    kind = SetStandIn if issubclass(real, Set) else StandIn if seconds is None else WaitStandIn
    if issubclass(real, Check | WaitUntil):
        kind, declared["status_if_false"] = ConditionStandIn, FAILURE if issubclass(real, Check) else RUNNING
        declared["reads_position"] = reads_position(step)
    return type(
        f"{real.__name__}StandIn",
        (kind,),
        declared
        | {
            "seconds": seconds,
            "__module__": __name__,
            "oracle": oracle,
            "watch": watch,
            "outcomes": outcomes(step),
            "sensor": sensor_of(real),
            "needs_new_report": _uses(real, START_TIMES),
            "never_rests": always_returns_true(real.halting),
            "lingers": real.halting is not Leaf.halting,
            "stops": not real.drives or real.terminate is Leaf.terminate or not does_nothing(real.terminate),
        },
    )


def reads_position(step: Step) -> bool:
    """Return whether a condition of a step reads a position that some bases only compute by dead reckoning."""
    reads = (read for value in step.arguments.values() if value.template is not None for read in value.template.reads)
    values = (state_value(read.name, read.member) for read in reads)
    return any(value is not None and value.is_dead_reckoned for value in values)


def outcomes(step: Step) -> tuple[TickOutcome, ...]:
    """Return the possible results of a step's leaf at a tick."""
    real = step.leaf or Leaf
    if real in FIXED_STATUSES:
        return (TickOutcome(FIXED_STATUSES[real], False),)
    if issubclass(real, Pretend) and step.arguments["outcomes"].template is None:
        statuses = list(dict.fromkeys(_statuses_in(step.arguments["outcomes"].constant)))
    else:
        ways = {"success": SUCCESS, "failure": FAILURE}
        statuses = [ways[end] for end in ("success", "failure") if end in real.ends]
        statuses += [] if real.instant else [RUNNING]
    found = [TickOutcome(status, status is SUCCESS) for status in statuses]
    early = step.output_variable is not None and RUNNING in statuses
    return (*found, EARLY_RESULT) if early else tuple(found)


def sensor_of(leaf: type[Leaf]) -> str:
    """Return the sensor whose silence can suspend a leaf, as named in messages; empty for a leaf without."""
    part = min(leaf.needs, default="")
    if leaf.instant and part and not leaf.drives:
        return SENSOR_NAMES.get(part, part)
    return (SENSOR_NAMES.get(part, part) or "sensor") if _uses(leaf, SILENCES) else ""


SHARED_SENSORS = frozenset({"base", "range"})
"""Parts with one newest report for all conditions and expressions: in a tick, all of them have it, or none has."""


def report_of(step: Step, key: str) -> str:
    """Return the report of its sensor that a step's leaf reads; equal texts mean the same report.

    Pictures and phrases may be too old for one condition and not for another, and each topic and joint has reports of
    its own. So conditions share a report only if they have equal arguments. Leaves from elsewhere share none; ``key``
    is that of the step's node.
    """
    leaf = step.leaf or Leaf
    is_ours = leaf.__module__.partition(".")[0] == "behaviours" and leaf.instant
    if is_ours and min(leaf.needs, default="") in SHARED_SENSORS:
        return sensor_of(leaf)
    constant = all(value.template is None for value in step.arguments.values())
    if not is_ours or not constant:
        return key
    arguments = sorted((name, repr(value.constant)) for name, value in step.arguments.items())
    return f"{leaf.tag} {arguments}"


SILENCES = frozenset({"suspend", "SensorSilent"})
"""Names in the code of a leaf that can be suspended."""

START_TIMES = frozenset({"elapsed", "started_at"})
"""Names in the code of a leaf that may need a report newer than its start."""


def _uses(leaf: type[Leaf], names: frozenset[str]) -> bool:
    """Return whether a start or a tick of a leaf, or of the py_trees behaviour in it, may use one of ``names``.

    Calls are followed by name, through methods of the class and functions of its modules.
    """
    made = getattr(leaf, "make", None)
    classes = [base for base in leaf.__mro__ if not issubclass(Leaf, base)]
    classes += made.__mro__ if isinstance(made, type) else ()
    waiting = [code for base in classes for name in ENTRIES if (code := _code(vars(base).get(name)))]
    found: set[str] = set()
    while waiting:
        code = waiting.pop()
        new = _names_in(code) - found
        found |= new
        spaces = [vars(base) for base in classes] + [vars(sys.modules[base.__module__]) for base in classes]
        waiting += [below for space in spaces for name in new if (below := _code(space.get(name)))]
    return bool(names & found)


ENTRIES = ("initialise", "update", "tick")
"""Methods with which a tick of a leaf or of a py_trees behaviour begins."""


def _code(found: object) -> CodeType | None:
    """Return the code of a method, a property or a function; None for anything else."""
    function = found.fget if isinstance(found, property) else getattr(found, "__func__", found)
    return function.__code__ if isinstance(function, FunctionType) else None


def _names_in(code: CodeType) -> set[str]:
    """Return the global names and attributes that a function uses, with those of the functions in it."""
    inner = (each for each in code.co_consts if isinstance(each, CodeType))
    return set(code.co_names).union(*map(_names_in, inner))


def _statuses_in(value: object) -> list[Status]:
    return [each for each in value if isinstance(each, Status)] if isinstance(value, tuple) else []


def always_returns_true(function: object) -> bool:
    """Return whether a method's source shows that it only returns True."""
    body = _function_tree(function)
    returns = [node.value for node in ast.walk(body) if isinstance(node, ast.Return)] if body else []
    ends = body is not None and isinstance(body.body[-1], ast.Return)
    return ends and all(isinstance(value, ast.Constant) and value.value is True for value in returns)


def does_nothing(function: object) -> bool:
    """Return whether a method's source shows that it does nothing."""
    body = _function_tree(function)
    idle = (ast.Pass, ast.Delete)
    return body is not None and all(
        isinstance(each, idle) or (isinstance(each, ast.Expr) and isinstance(each.value, ast.Constant))
        for each in body.body
    )


def _function_tree(function: object) -> ast.FunctionDef | None:
    if not isinstance(function, FunctionType):
        return None
    try:
        (body,) = ast.parse(textwrap.dedent(inspect.getsource(function))).body
    except (OSError, SyntaxError):
        return None
    return body if isinstance(body, ast.FunctionDef) else None
