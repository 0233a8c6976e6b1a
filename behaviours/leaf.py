"""Base class of all leaves. Its class attributes declare a leaf to the checker, the catalogue and the docs."""

from collections.abc import Callable, Collection, Mapping
from dataclasses import replace
from typing import Any, ClassVar

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from behaviours.condition import Condition, UnmeasuredError
from behaviours.haltable_node import AT_REST, HALTING, STARTING, WORKING, HaltableNode
from behaviours.joint_ranges import REQUIRED, Argument, JointRanges, argument
from behaviours.node import sensor_timeout_reason
from behaviours.robot import Robot
from behaviours.run import log
from drivers.errors import DriverError, NotConnected, SensorSilent

# What a leaf raised or gave, in words: whatever that is, and whatever it does when it is asked for them.


def error_text(error: BaseException) -> str:
    """Return the type and message of an exception, or the type alone if the message is empty or `str` fails."""
    words = message_of(error)
    return f"{type(error).__name__}: {words}" if words else type(error).__name__


def message_of(error: BaseException) -> str:
    """Return `str(error)`, or an empty text if `str` raises."""
    try:
        return str(error)
    except BaseException:  # as in Leaf.on_tick
        return ""


def short_repr(value: object) -> str:
    """Return the first 80 characters of `repr(value)`, or the type name if `repr` raises."""
    try:
        return repr(value)[:80]
    except BaseException:  # as in message_of
        return f"a {type(value).__name__}"


# What a leaf is written with comes from one module.
__all__ = [
    "FAILURE",
    "IDLE",
    "REQUIRED",
    "RUNNING",
    "SUCCESS",
    "Argument",
    "Condition",
    "Leaf",
    "UnmeasuredError",
    "argument",
    "log",
]

RUNNING, SUCCESS, FAILURE, IDLE = Status.RUNNING, Status.SUCCESS, Status.FAILURE, Status.INVALID


RENAMED = {"word": "tag", "uses": "optional_parts", "stores": "output_doc"}
"""Old and new names of the class attributes that declare a leaf.

A class that still uses an old name is an error whose message has the new name; otherwise the leaf would be ignored.
"""


class Leaf(HaltableNode):
    """Base class of leaves: an action or condition of the robot. Subclasses declare it in class attributes.

    The docstring is the help text of the leaf: the first line describes the action, the rest when it is running,
    succeeds and fails.

    ``tag`` is the name in missions, and ``example`` a step with it. ``drives`` are the actuators that the leaf claims
    (``base``, ``head``, ``arm``, ``voice``), ``needs`` the required parts and ``optional_parts`` the optional ones
    (``range``). A leaf with the part ``camera`` lists its detectors in ``senses`` (``faces``, ``names`` of people,
    ``things``, ``markers``, ``motion``).

    ``output_doc`` describes the value that ``as: NAME`` stores, and ``output_type`` is its type as in an annotation
    (``Face``, ``drivers.api.Length``), from which the checker knows its members and dimension. The leaf assigns the
    value, in SI units, to ``result``. It is stored on success, and while running as soon as it is not None. An
    ``open_ended`` leaf takes any argument names; the values are in ``values``.

    A leaf with a ``stub`` is not written yet: it can be checked, shown and mocked, but a run is refused. The text says
    what to do.

    A leaf that ``acts`` has an effect although it drives nothing, such as ``led``: see missions.language.takeover.
    ``takes_over`` are the keys of the reactive composites whose running child is halted before the leaf starts.

    ``node_model`` is the XML declaration of the node of BehaviorTree.CPP that the leaf was imported from, for an
    export. ``as`` stores its first output port.

    ``ends`` are the possible results, so the checker finds unreachable steps. An ``instant`` leaf never runs for longer
    than a tick, except while it is suspended.

    A leaf whose sensor has not reported is *suspended*: it returns ``self.suspend("range finder")`` or raises
    ``drivers.errors.SensorSilent``, as a plain py_trees behaviour can. NotConnected suspends an ``instant`` leaf that
    drives nothing; all other leaves keep running.

    Subclasses implement ``initialise``, ``update`` and ``terminate`` of py_trees. None of them may block or sleep.
    ``initialise`` is called again if it raises NotConnected. ``terminate`` follows every call of ``initialise`` and
    must stop the actuators unless the leaf succeeded. If a class has no ``terminate``, its actuators are stopped on
    failure and halt. If a reactive composite waits for a silent sensor, the leaf is not ticked: ``on_pause`` is called,
    and the next tick resumes.
    """

    lasting_state: ClassVar[tuple[str, ...]] = ("result", "_halt_by", "_leaf_stage")
    tag: ClassVar[str] = ""
    example: ClassVar[str] = ""
    needs: ClassVar[frozenset[str]] = frozenset()
    optional_parts: ClassVar[frozenset[str]] = frozenset()
    senses: ClassVar[frozenset[str]] = frozenset({"faces"})
    output_doc: ClassVar[str] = ""
    output_type: ClassVar[Any] = None
    ends: ClassVar[frozenset[str]] = frozenset({"success", "failure"})
    instant: ClassVar[bool] = False
    acts: ClassVar[bool] = False
    stub: ClassVar[str] = ""
    node_model: ClassVar[str] = ""
    open_ended: ClassVar[bool] = False
    arguments: ClassVar[Mapping[str, Argument]] = {}
    named_parts: ClassVar[Mapping[str, str]] = {}  # by their kinds, the one that it sees as its robot's only one
    additional_parts: ClassVar[Mapping[str, str]] = {}  # the kinds of those that it means beside these, by their names

    robot: Robot
    result: object = None
    output_variable: str | None = None
    output_converter: Callable[[object], object] | None = None
    computed: Mapping[str, Callable[[], object]] = {}
    values: Mapping[str, object] = {}
    takes_over: frozenset[str] = frozenset()
    _prepares: ClassVar[bool] = False  # the class drives something, or has an initialise of its own
    _started_at: float | None = None

    def __init_subclass__(cls) -> None:
        """Collect the declared arguments, those of base classes first. Raises TypeError for an old name."""
        super().__init_subclass__()
        for old, new in RENAMED.items():
            if isinstance(vars(cls).get(old), str | frozenset) and new not in vars(cls):
                raise TypeError(f"{cls.__name__}: the attribute '{old}' of a leaf is called '{new}' now")
        declared: dict[str, Argument] = {}
        for base in reversed(cls.__mro__):
            declared |= vars(base).get("arguments", {})
        for name, value in list(vars(cls).items()):
            if isinstance(value, Argument):
                declared[value.name or name] = replace(value, name=value.name or name, attribute=name)
                delattr(cls, name) if value.required else setattr(cls, name, value.default)
        cls.arguments = declared
        cls._prepares = bool(cls.drives) or cls.initialise is not Behaviour.initialise
        cls._has_terminate = cls.terminate is not Behaviour.terminate

    @classmethod
    def senses_for(cls, arguments: Collection[str]) -> frozenset[str]:
        """Return the detectors that the leaf uses if the named ``arguments`` are given; ``senses`` by default."""
        del arguments
        return cls.senses

    @classmethod
    def with_part(cls, kind: str, name: str, *, additional: bool = False) -> "type[Leaf]":
        """Return a subclass that uses the part ``name`` as its part of ``kind``, for robots with several of a kind.

        The subclass needs and claims that part. With ``additional``, it also keeps the part that it used before.
        """
        words, first = ("needs", "drives", "optional_parts"), cls.named_parts.get(kind, kind)
        if additional:
            own: dict[str, Any] = {word: getattr(cls, word) | {name} for word in words if first in getattr(cls, word)}
            own["additional_parts"] = {**cls.additional_parts, name: kind}
        elif name == kind:
            return cls
        else:
            own = {word: frozenset(name if each == kind else each for each in getattr(cls, word)) for word in words}
            own["named_parts"] = {**cls.named_parts, kind: name}
        return type(cls.__name__, (cls,), {"__module__": cls.__module__, "__doc__": cls.__doc__, **own})

    @property
    def started_at(self) -> float:
        """Start time in seconds on the run's clock.

        The clock is read at the first access, or at the end of the first tick. So most leaves, which end in their first
        tick, never read it.
        """
        if self._started_at is None:
            self._started_at = self.run.now()
        return self._started_at

    @property
    def elapsed(self) -> float:
        """Seconds since the leaf started."""
        since = self.started_at  # which may not have been read before
        return self.run.now() - since

    def joint_violations(self, _reach: JointRanges, /) -> list[str]:
        """Return an error text for each argument that the robot's joints cannot fulfil; empty by default.

        The checker calls it if the robot is known. ``_reach`` has the robot's joints with their limits.
        """
        return []

    def update(self) -> Status:
        """Do the work of one tick. Returns RUNNING by default."""
        return RUNNING

    def fail(self, reason: str) -> Status:
        """Set the reason and return FAILURE: ``return self.fail("no face seen")``."""
        self.feedback_message = reason
        return FAILURE

    def wait(self, reason: str) -> Status:
        """Set the reason and return RUNNING: ``return self.wait("no face yet")``."""
        self.feedback_message = reason
        return RUNNING

    def suspend(self, sensor: str) -> Status:
        """Suspend the leaf because a sensor has not reported: ``return self.suspend("range finder")``.

        Returns FAILURE after the sensor timeout of the robot file, RUNNING before.
        """
        return self._suspend(f"the {sensor} does not report")

    def _suspend(self, reason: str) -> Status:
        self.suspension = self.suspension_for(reason)
        if self.suspension.timed_out:
            return self.fail(sensor_timeout_reason(reason, self.run.sensor_timeout))
        if self._leaf_stage == WORKING and self.claims:
            self._pass_unticked_time()
        return self.wait(f"waiting: {reason}")

    def on_time_passed(self) -> Status:
        if self._leaf_stage == HALTING:
            self.halt()
        elif self._leaf_stage == WORKING and self.claims:
            self._pass_unticked_time()
        return self.status

    def _pass_unticked_time(self) -> None:
        """Count time without a tick, and pause the leaf after COMMAND_TIMEOUT seconds."""
        before, self.run.active_leaf = self.run.active_leaf, self
        self._count_unticked_time()
        self.run.active_leaf = before

    def halt(self) -> bool:
        """Terminate the leaf if it runs; return whether it is at rest.

        While ``halting`` is True, it needs more ticks, but at most ``halt_limit`` seconds.
        """
        if self.status is not RUNNING:
            return True
        if self._leaf_stage != AT_REST and not self._come_to_rest():
            return False
        self.publish(IDLE)
        return True

    def _come_to_rest(self) -> bool:
        """Terminate, then poll ``halting`` each tick; return True at rest, or after ``halt_limit`` seconds."""
        before, self.run.active_leaf = self.run.active_leaf, self  # another may be waiting for it to make way
        at_rest = self._has_stopped()
        self.run.active_leaf = before
        return at_rest

    def on_tick(self) -> Status:
        """Start the leaf if necessary, update once, and convert every exception into a failure with a reason.

        This is the hot path of every tick: rare cases cost one comparison each.
        """
        run = self.run
        run.active_leaf = self
        self.visited_tick = run.tick
        before, self.suspension = self.suspension, None
        try:
            if self._leaf_stage == WORKING:
                self.feedback_message = ""
                status = self.update()
            else:
                status = self._enter_and_update()
        except BaseException as error:  # a leaf that raises has failed, whatever it raised; the tree goes on
            status = self._handle_exception(error)
        unknown = status is not SUCCESS and status is not FAILURE and status is not RUNNING
        if unknown or type(self.feedback_message) is not str:
            status = self._checked_status(status)
        if run.overrun is not None and run.overrun[:2] == (self, run.tick):
            status = self._overrun_failure(run.wall.now() - run.overrun[2])
        if status is RUNNING:
            if self._started_at is None:
                self._started_at = run.now()
        elif self._leaf_stage != AT_REST:
            self._finish(status)
        if self.output_variable is not None:
            self._store_output(self.output_variable, status)
        run.active_leaf = None
        if self.suspension is not before:
            self.show_suspension(status, before)
        return status

    def _finish(self, status: Status) -> None:
        """Return to AT_REST after success or failure, and call ``terminate`` if necessary."""
        self._leaf_stage = AT_REST
        if self._has_terminate or (status is FAILURE and (self._prepares or self.moved_parts)):
            self._terminate(status)
            if self._moved_late and status is FAILURE:
                self._stop_safely()

    def _store_output(self, name: str, status: Status) -> None:
        """Store the result in the variable ``name``, and flag the change if the value is a new object."""
        if status is not SUCCESS and (status is not RUNNING or self.result is None):
            return
        result = self.result if self.output_converter is None else self.output_converter(self.result)
        if self.scope.get(name) is not result or name not in self.scope:
            self.scope[name] = result
            self.run.variables_changed = True

    def _enter_and_update(self) -> Status:
        if self._leaf_stage == HALTING and not self._come_to_rest():
            return self.wait("still stopping")
        if self.computed:
            try:
                problem = self._compute_arguments()
            except NotConnected as error:  # an argument asks for what is not reported just now
                return self._suspend(message_of(error))
            if problem:
                return self.fail(f"{self.label}: {problem}")
        self.result = self._started_at = None
        self.moved_parts, self._moved_late = frozenset(), False
        if (self.drives or self.takes_over) and not self.run.preempt(None if self.drives else self.takes_over):
            return self.wait("waiting for another behaviour to stop")
        if self._prepares:
            self._leaf_stage = STARTING
            self.initialise()
        self._leaf_stage = WORKING
        self.feedback_message = ""
        return self.update()

    def _checked_status(self, status: Status) -> Status:
        """Return FAILURE for a value that is not a status. Replaces a feedback message that is not a text."""
        if status is RUNNING or status is SUCCESS or status is FAILURE:
            self.feedback_message = short_repr(self.feedback_message)
            return status
        return self.fail(f"{self.label}: returned {short_repr(status)} instead of a status")

    def _overrun_failure(self, seconds: float) -> Status:
        """Fail, and record the overrun, for a tick that the watchdog ended after ``seconds``."""
        self.run.overrun_failure = self.key, round(seconds, 1)
        return self.fail(f"{self.label}: blocked the tick for {seconds:.1f} s")

    def _handle_exception(self, error: BaseException) -> Status:
        """Return the status that follows from an exception. Raises KeyboardInterrupt again if it came from the user."""
        if isinstance(error, SensorSilent) or (isinstance(error, NotConnected) and self.instant and not self.drives):
            return self._suspend(message_of(error))
        if isinstance(error, NotConnected):
            # The transport is gone, and the driver is looking for it: wait for it, until our own timeout.
            return self.wait(f"waiting: {message_of(error)}")
        if isinstance(error, DriverError):
            return self.fail(message_of(error) or type(error).__name__)
        if self._is_interrupt(error):
            raise error
        log.error("%s raised", self.label, exc_info=error)
        return self.fail(f"{self.label}: {error_text(error)}")

    def _compute_arguments(self) -> str:
        """Evaluate the arguments that are expressions, and return an error text or an empty text."""
        found = {}
        for name, compute in self.computed.items():
            try:
                found[name] = compute()
            except (ValueError, LookupError) as error:
                return f"{name}: {error}"
        if self.open_ended:
            self.values = found
        else:
            for name, value in found.items():
                setattr(self, self.arguments[name].attribute if name in self.arguments else name, value)
        return ""
