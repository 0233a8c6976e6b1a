"""Plain py_trees behaviours as leaves: a class becomes a word of the language, its parameters become arguments."""

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
"""The kind of argument that a parameter becomes, by its annotation; without one it takes anything."""


class PyTreesLeaf(Leaf):
    """A leaf around a behaviour, or a whole tree, that py_trees ticks by its own rules.

    Statuses and calls are those of py_trees' own ``tick_once``, but for these, which are meant:

    =================================  ================================  =======================================
    what happens                       py_trees alone                    here
    =================================  ================================  =======================================
    halted while it does not run       ``terminate(INVALID)`` once more  nothing: it is at rest already
    something in it raises             the exception goes through;       ``stop(INVALID)`` of what had started; it has
                                       nothing is terminated             failed with the exception as its reason
    its tick gives INVALID             INVALID                           a failure whose reason says so
    before its first tick              nothing                           ``setup`` of everything in it
    =================================  ================================  =======================================

    A behaviour that raises ``drivers.errors.SensorSilent("the thermometer does not report")`` is suspended: py_trees
    ticks it again at the next tick, and initialises it again unless it was running.

    A behaviour is made when the leaf starts for the first time, and kept; made afresh only where its arguments differ.
    Running, success and failure are its own.
    """

    inner: Behaviour | None = None
    _failed_path: Sequence[Behaviour] = ()  # what a tick that raised had come to, from the root down

    @abstractmethod
    def current_behaviour(self) -> Behaviour:
        """Return what is to be ticked from this start on."""

    def initialise(self) -> None:
        """See to it that there is a behaviour, set up and with the arguments of now."""
        found = self.current_behaviour()
        if found is not self.inner:
            found.setup_with_descendants()
            self.inner = found
            self.children = [found]

    def update(self) -> Status:
        """Tick it once, and take on its status and feedback."""
        if self.inner is None:
            return self.fail("it was not started")
        self._failed_path = ()
        try:
            self.inner.tick_once()
        except BaseException as error:
            self._failed_path = _ticked_path(error)
            raise
        self.feedback_message = self.inner.feedback_message
        return self.inner.status

    def terminate(self, new_status: Status) -> None:
        """Stop it if it runs, or if it raised; one that has ended has been told so by py_trees."""
        del new_status
        raised, self._failed_path = self._failed_path, ()
        # Where the tick raised, py_trees does not know yet that these, and what runs below them, have started.
        with ExitStack() as deepest_first:
            for node in raised:
                deepest_first.callback(node.stop, Status.INVALID)
        if not raised and self.inner is not None and self.inner.status is Status.RUNNING:
            self.inner.stop(Status.INVALID)


class WrappedInstance(PyTreesLeaf):
    """A leaf around a behaviour, or the root of a tree, that was made already."""

    tag = "py_trees"

    def __init__(self, inner: Behaviour) -> None:
        super().__init__(inner.name)
        self._behaviour = inner
        self.children = [inner]

    def current_behaviour(self) -> Behaviour:
        """Return what was given."""
        return self._behaviour


class WrappedClass(PyTreesLeaf):
    """A leaf that makes its behaviour of a class, with the arguments that stand in the mission."""

    make: ClassVar[Callable[..., Behaviour]]
    takes_name: ClassVar[bool] = False
    _arguments_used: dict[str, Any] | None = None

    def current_behaviour(self) -> Behaviour:
        """Make it with the arguments of now, unless it was made with the same ones before."""
        arguments = {name: getattr(self, name) for name in self.arguments}
        if self.inner is not None and arguments == self._arguments_used:
            return self.inner
        made = type(self).make(**arguments, **({"name": self.name} if self.takes_name else {}))
        self._arguments_used = arguments
        return made


def _ticked_path(error: BaseException) -> list[Behaviour]:
    """Return the behaviours that were being ticked when ``error`` was raised, from the root down."""
    found = []
    for frame, _ in traceback.walk_tb(error.__traceback__):
        node = frame.f_locals.get("self")
        if frame.f_code.co_name == "tick" and isinstance(node, Behaviour) and node not in found:
            found.append(node)
    return found


def tag_of(cls: type) -> str:
    """Return the word for a class: ``TrackFace`` is ``track_face``, ``LEDBlink`` is ``led_blink``."""
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", "_", cls.__name__).lower()


def leaf_of(cls: type[Behaviour]) -> type[Leaf]:
    """Return a leaf for a plain py_trees class; its docstring is the entry in the catalogue.

    The constructor's parameters, ``name`` apart, become arguments by their annotations. Raises TypeError for one that
    must be given and that a mission cannot give, such as a child.
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
    """Return the argument that a parameter becomes; None for one that has a default and that a mission cannot give."""
    required = parameter.default is parameter.empty
    union = typing.get_origin(hint) in (typing.Union, types.UnionType)
    options = [option for option in typing.get_args(hint) if option is not type(None)] if union else []
    asked = options[0] if len(options) == 1 else hint  # `int | None` takes a count
    if asked is parameter.empty:
        asked = type(parameter.default)
    kind = ARGUMENT_KINDS.get(asked, "value" if hint in (parameter.empty, Any, object) else None)
    positional_only = parameter.kind is parameter.POSITIONAL_ONLY
    own = parameter.name in {*dir(WrappedClass("any")), "run", "robot", "scope"}  # attributes that every leaf has
    if kind is not None and not positional_only and not own:
        help_text = f"{parameter.name.replace('_', ' ')}, of {cls.__name__}"
        return Argument(parameter.name, kind, help_text, REQUIRED if required else parameter.default)
    if not required:
        return None
    shown = "positional only" if positional_only else getattr(hint, "__name__", str(hint))
    if kind is not None and not positional_only:
        shown = "a name that leaves use themselves"
    raise TypeError(f"{cls.__name__} needs '{parameter.name}' ({shown}), which a mission cannot give")
