"""The common base of all leaves, and the one declaration that the checker, the catalogue and the docs read."""

from collections.abc import Callable, Collection, Mapping
from dataclasses import replace
from typing import Any, ClassVar

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from behaviours.haltable_node import AT_REST, HALTING, STARTING, WORKING, HaltableNode
from behaviours.joint_ranges import REQUIRED, Argument, JointRanges, argument
from behaviours.node import sensor_timeout_reason
from behaviours.robot import Robot
from behaviours.run import log
from drivers.errors import DriverError, NotConnected, SensorSilent

# What a leaf raised or gave, in words: whatever that is, and whatever it does when it is asked for them.


def error_text(error: BaseException) -> str:
    """Return an exception's type and words; the type alone where it has none, or cannot say them."""
    words = message_of(error)
    return f"{type(error).__name__}: {words}" if words else type(error).__name__


def message_of(error: BaseException) -> str:
    """Return an exception's words; none where it cannot say them, which may raise whatever there is."""
    try:
        return str(error)
    except BaseException:  # as in Leaf.on_tick
        return ""


def short_repr(value: object) -> str:
    """Return what a leaf gave, whatever that is, for a message."""
    try:
        return repr(value)[:80]
    except BaseException:  # as in message_of
        return f"a {type(value).__name__}"


# What a leaf is written with comes from one module.
__all__ = ["FAILURE", "IDLE", "REQUIRED", "RUNNING", "SUCCESS", "Argument", "Leaf", "argument", "log"]

RUNNING, SUCCESS, FAILURE, IDLE = Status.RUNNING, Status.SUCCESS, Status.FAILURE, Status.INVALID


class Leaf(HaltableNode):
    """A behaviour that senses or acts. A subclass declares itself and says what to do.

    Its docstring is its entry in the catalogue: the first line what it does, the rest when it is running, succeeds
    and fails. ``tag`` is its name in missions. ``claims`` are the actuators it drives (``base``, ``head``, ``arm``,
    ``voice``), ``needs`` the parts without which it is of no use, ``optional_parts`` those that it makes use of where the robot
    has them (``range``); of one that needs the ``camera``, ``senses`` say what it looks for (``faces``, ``names`` of
    people, ``things``, ``markers``, ``motion``). ``output_doc`` says what ``as: NAME`` keeps, ``output_type``
    of which type that always is, as an annotation says it (``Face``, ``drivers.api.Length``), so that the checker knows
    its members and its dimension; the subclass puts it into ``result``, in SI units: it is
    kept when the leaf succeeds, and while it runs as soon as there is one. An
    ``open_ended`` leaf takes any names: their values come in ``values``.

    ``ends`` is how it can end, for the checker to see what is never reached; one that is ``instant`` never runs for
    longer than a tick, but while it is suspended.

    A leaf that cannot answer, only because a sensor has not reported, is *suspended*: it returns ``self.suspend("range
    finder")``, or raises ``drivers.errors.SensorSilent``, which a plain py_trees behaviour can do as well. An
    ``instant`` leaf that drives nothing is suspended by NotConnected, too; for others that is an ordinary wait.

    It implements py_trees' ``initialise``, ``update`` and ``terminate``: a leaf that moved something stops it in
    ``terminate`` unless it succeeded; of one without a ``terminate``, what it drives is stopped for it when it fails or
    is halted. ``initialise`` is called again while it raises NotConnected; once it was called,
    ``terminate`` follows, whether it got to its end or not. Nothing in it may block or sleep. While a composite stands
    still for a silent sensor it is not ticked; ``on_pause`` is called then, and the next tick goes on.
    """

    lasting_state: ClassVar[tuple[str, ...]] = ("result", "_halt_by", "_leaf_stage")
    tag: ClassVar[str] = ""
    needs: ClassVar[frozenset[str]] = frozenset()
    optional_parts: ClassVar[frozenset[str]] = frozenset()
    senses: ClassVar[frozenset[str]] = frozenset({"faces"})
    output_doc: ClassVar[str] = ""
    output_type: ClassVar[Any] = None
    ends: ClassVar[frozenset[str]] = frozenset({"success", "failure"})
    instant: ClassVar[bool] = False
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
    _prepares: ClassVar[bool] = False  # the class drives something, or has an initialise of its own
    _started_at: float | None = None

    def __init_subclass__(cls) -> None:
        """Collect the arguments that the class declares, after those of its bases."""
        super().__init_subclass__()
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
        """Return what it looks for with the camera where these arguments have a value: its ``senses``, or more."""
        del arguments
        return cls.senses

    @classmethod
    def with_part(cls, kind: str, name: str, *, additional: bool = False) -> "type[Leaf]":
        """Return the leaf that means the part of this name, of a kind of which robots may have several.

        That one it needs and claims, and sees as its robot's only one; or needs and claims as well, ``beside`` the one
        that it means already.
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
    def claims(self) -> frozenset[str]:
        """The actuators it drives."""
        return self.drives

    @property
    def started_at(self) -> float:
        """When it started, on the run's clock: read when first asked for, at the end of its first tick at the latest.

        So a leaf that ends in the tick in which it starts, as most do, need not read the clock.
        """
        if self._started_at is None:
            self._started_at = self.run.now()
        return self._started_at

    @property
    def elapsed(self) -> float:
        """Seconds since it started."""
        since = self.started_at  # which may not have been read before
        return self.run.now() - since

    def joint_violations(self, _reach: JointRanges, /) -> list[str]:
        """Say what joints that reach so far cannot do of what it asks; the checker asks, where all that is known."""
        return []

    def update(self) -> Status:
        """Do one tick's work; running unless a subclass says otherwise."""
        return RUNNING

    def fail(self, reason: str) -> Status:
        """Fail, and say why: ``return self.fail("no face seen")``."""
        self.feedback_message = reason
        return FAILURE

    def wait(self, reason: str) -> Status:
        """Go on running, and say what for: ``return self.wait("no face yet")``."""
        self.feedback_message = reason
        return RUNNING

    def suspend(self, sensor: str) -> Status:
        """Wait for a sensor that has not reported: ``return self.suspend("range finder")``.

        Fails once that has lasted for the sensor timeout of the robot file, tick after tick.
        """
        return self._suspend(f"the {sensor} does not report")

    def _suspend(self, reason: str) -> Status:
        self.suspension = self.suspension_for(reason)
        if self.suspension.timed_out:
            return self.fail(sensor_timeout_reason(reason, self.run.sensor_timeout))
        if self._leaf_stage == WORKING and self.drives:
            self._pass_unticked_time()
        return self.wait(f"waiting: {reason}")

    def on_time_passed(self) -> Status:
        if self._leaf_stage == HALTING:
            self.halt()
        elif self._leaf_stage == WORKING and self.drives:
            self._pass_unticked_time()
        return self.status

    def _pass_unticked_time(self) -> None:
        """Let time pass in which it does nothing, and pause once that is too long."""
        before, self.run.active_leaf = self.run.active_leaf, self
        self._count_unticked_time()
        self.run.active_leaf = before

    def halt(self) -> bool:
        """Stop, if running: terminate once, then wait for ``halting`` to end, for ``halt_limit`` seconds at most."""
        if self.status is not RUNNING:
            return True
        if self._leaf_stage != AT_REST and not self._come_to_rest():
            return False
        self.publish(IDLE)
        return True

    def _come_to_rest(self) -> bool:
        """Terminate, then ask ``halting`` once a tick; True once it, or its time, has ended."""
        before, self.run.active_leaf = self.run.active_leaf, self  # another may be waiting for it to make way
        at_rest = self._has_stopped()
        self.run.active_leaf = before
        return at_rest

    def on_tick(self) -> Status:
        """Start if need be, update once, and turn whatever goes wrong into a failure with a reason.

        This is the hot path of every tick: what is rarely needed is asked for with one comparison.
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
        """Be at rest after an end: terminate, if the class has that to do."""
        self._leaf_stage = AT_REST
        if self._has_terminate or (self._prepares and status is FAILURE):
            self._terminate(status)

    def _store_output(self, name: str, status: Status) -> None:
        """Store the result, if there is one, with its dimension where it has one, and say so if it is a new one."""
        if status is not SUCCESS and (status is not RUNNING or self.result is None):
            return
        result = self.result if self.output_converter is None else self.output_converter(self.result)
        if self.scope.get(name) is not result or name not in self.scope:
            self.scope[name] = result
            self.run.variables_changed = True

    def _enter_and_update(self) -> Status:
        """Start, then update for the first time."""
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
        if self._prepares:
            if self.drives and not self.run.preempt():
                return self.wait("waiting for another behaviour to stop")
            self._leaf_stage = STARTING
            self.initialise()
        self._leaf_stage = WORKING
        self.feedback_message = ""
        return self.update()

    def _checked_status(self, status: Status) -> Status:
        """Return a failure for what is no status; put a text in the place of a reason that is none."""
        if status is RUNNING or status is SUCCESS or status is FAILURE:
            self.feedback_message = short_repr(self.feedback_message)
            return status
        return self.fail(f"{self.label}: returned {short_repr(status)} instead of a status")

    def _overrun_failure(self, seconds: float) -> Status:
        """Return a failure for a tick that was held for so long."""
        self.run.overrun_failure = self.key, round(seconds, 1)
        return self.fail(f"{self.label}: held the tick for {seconds:.1f} s")

    def _handle_exception(self, error: BaseException) -> Status:
        """Return the status after an exception, with a reason; a Ctrl-C goes on to the user."""
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
        """Compute the arguments that are known only now; return what is wrong with them."""
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
