"""Plain py_trees behaviours as leaves: a class gets a tag, and its constructor parameters become arguments."""

import inspect
import re
import traceback
import types
import typing
from abc import abstractmethod
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from typing import Any, ClassVar

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from behaviours.leaf import REQUIRED, Argument, Leaf

ARGUMENT_KINDS: dict[object, str] = {float: "number", int: "count", str: "text", bool: "flag"}
"""Argument kind by parameter annotation; a parameter without annotation takes any value."""


class PyTreesLeaf(Leaf):
    """Base class of leaves around a behaviour, or a whole tree, that py_trees ticks by its own rules.

    Statuses and calls are those of py_trees' own ``tick_once``, with these intended exceptions:

    =================================  ================================  =======================================
     event                              py_trees alone                    here
    =================================  ================================  =======================================
     halted while it does not run       ``terminate(INVALID)`` once more  nothing: it is at rest already
     an exception                       the exception propagates;         ``stop(INVALID)`` of all started nodes; the
                                        nothing is terminated             leaf fails with the exception as its reason
     the tick returns INVALID           INVALID                           a failure whose reason says so
     before the first tick              nothing                           ``setup`` of all nodes in it
    =================================  ================================  =======================================

    A behaviour that raises ``drivers.errors.SensorSilent("the thermometer does not report")`` is suspended. py_trees
    then ticks it again at the next tick, and initialises it again unless it was running.

    The behaviour is created when the leaf starts for the first time, and again only if its arguments have changed.
    Running, success and failure are those of the behaviour.
    """

    inner: Behaviour | None = None
    _failed_path: Sequence[Behaviour] = ()  # what a tick that raised had come to, from the root down

    @abstractmethod
    def current_behaviour(self) -> Behaviour:
        """Return the py_trees behaviour that the leaf is to tick until it ends."""

    def initialise(self) -> None:
        """Create and set up the behaviour with the present arguments, if necessary."""
        found = self.current_behaviour()
        if found is not self.inner:
            found.setup_with_descendants()
            self.inner = found
            self.children = [found]

    def update(self) -> Status:
        """Tick the behaviour once, and copy its status and feedback."""
        if self.inner is None:
            return self.fail("the behaviour was ticked before it was started")
        self._failed_path = ()
        try:
            self.inner.tick_once()
        except BaseException as error:
            self._failed_path = _ticked_path(error)
            raise
        self.feedback_message = self.inner.feedback_message
        return self.inner.status

    def terminate(self, new_status: Status) -> None:
        """Stop the behaviour if it runs or has raised; py_trees has already terminated a behaviour that has ended."""
        del new_status
        raised, self._failed_path = self._failed_path, ()
        # Where the tick raised, py_trees does not know yet that these, and what runs below them, have started.
        with ExitStack() as deepest_first:
            for node in raised:
                deepest_first.callback(node.stop, Status.INVALID)
        if not raised and self.inner is not None and self.inner.status is Status.RUNNING:
            self.inner.stop(Status.INVALID)


class WrappedInstance(PyTreesLeaf):
    """Leaf around an existing py_trees behaviour or tree."""

    tag = "py_trees"

    def __init__(self, inner: Behaviour) -> None:
        super().__init__(inner.name)
        self._behaviour = inner
        self.children = [inner]

    def current_behaviour(self) -> Behaviour:
        return self._behaviour


class WrappedClass(PyTreesLeaf):
    """Leaf that creates its py_trees behaviour from a class, with the arguments that the mission gives."""

    make: ClassVar[Callable[..., Behaviour]]
    takes_name: ClassVar[bool] = False
    _arguments_used: dict[str, Any] | None = None

    def current_behaviour(self) -> Behaviour:
        """Return a behaviour with the present arguments, a new one only if they have changed."""
        arguments = {name: getattr(self, name) for name in self.arguments}
        if self.inner is not None and arguments == self._arguments_used:
            return self.inner
        behaviour = type(self).make(**arguments, **({"name": self.name} if self.takes_name else {}))
        self._arguments_used = arguments
        return behaviour


def _ticked_path(error: BaseException) -> list[Behaviour]:
    """Return the behaviours that were being ticked when ``error`` was raised, from the root down."""
    found = []
    for frame, _ in traceback.walk_tb(error.__traceback__):
        node = frame.f_locals.get("self")
        if frame.f_code.co_name == "tick" and isinstance(node, Behaviour) and node not in found:
            found.append(node)
    return found


def tag_of(cls: type) -> str:
    """Return the tag of a class: ``TrackFace`` is ``track_face``, ``LEDBlink`` is ``led_blink``."""
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", "_", cls.__name__).lower()


def leaf_of(cls: type[Behaviour]) -> type[Leaf]:
    """Return a leaf class for a plain py_trees class; its docstring is the entry in the catalogue.

    The constructor's parameters, except ``name``, become arguments by their annotations. Raises TypeError for a
    required parameter that a mission cannot give, such as a child.
    """
    parameters = inspect.signature(cls).parameters
    hints = typing.get_type_hints(cls.__init__) if inspect.isfunction(cls.__init__) else {}
    declared = {}
    for name, parameter in parameters.items():
        if name == "name" or parameter.kind in (parameter.VAR_POSITIONAL, parameter.VAR_KEYWORD):
            continue
        found = _argument(cls, parameter, hints.get(name, parameter.empty))
        if found is not None:
            declared[name] = found
    needed = [argument for argument in declared.values() if argument.required]
    if len(needed) == 1:
        declared[needed[0].name] = Argument(needed[0].name, needed[0].kind, needed[0].help, principal=True)
    body = {
        "__doc__": inspect.getdoc(cls) or f"{cls.__name__}, a behaviour of py_trees.",
        "__module__": cls.__module__,
        "tag": tag_of(cls),
        "make": staticmethod(cls),
        "takes_name": "name" in parameters,
    }
    return type(cls.__name__, (WrappedClass,), body | declared)


def _argument(cls: type, parameter: inspect.Parameter, hint: object) -> Argument | None:
    """Return the argument for a constructor's parameter with the type ``hint``.

    None for an optional parameter that a mission cannot give.
    """
    required = parameter.default is parameter.empty
    union = typing.get_origin(hint) in (typing.Union, types.UnionType)
    options = [option for option in typing.get_args(hint) if option is not type(None)] if union else []
    kind_hint = options[0] if len(options) == 1 else hint  # `int | None` takes a count
    if kind_hint is parameter.empty:
        kind_hint = type(parameter.default)
    kind = ARGUMENT_KINDS.get(kind_hint, "value" if hint in (parameter.empty, Any, object) else None)
    positional_only = parameter.kind is parameter.POSITIONAL_ONLY
    is_taken = parameter.name in {*dir(WrappedClass("any")), "run", "robot", "scope"}  # attributes that every leaf has
    if kind is not None and not positional_only and not is_taken:
        help_text = f"{parameter.name.replace('_', ' ')}, of {cls.__name__}"
        return Argument(parameter.name, kind, help_text, REQUIRED if required else parameter.default)
    if not required:
        return None
    hint_text = "positional only" if positional_only else getattr(hint, "__name__", str(hint))
    if kind is not None and not positional_only:
        hint_text = "a name that leaves use themselves"
    raise TypeError(f"{cls.__name__} needs '{parameter.name}' ({hint_text}), which a mission cannot give")
