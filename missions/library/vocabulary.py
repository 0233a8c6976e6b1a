"""Which leaves there are: those that ship with MissionTree, those of installed packages, and those of the user's files.

A package offers leaves by entry points of the group ``missiontree.behaviours``: each names a class, or a module. Of a
module, and of a file, every class is taken that it defines itself and whose name does not begin with ``_``: leaves that
declare a ``word``, and plain behaviours of py_trees.
"""

import ast
import inspect
import os
import re
import sys
from collections.abc import Iterable, Mapping, Sequence
from contextlib import redirect_stdout, suppress
from functools import lru_cache, partial
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

from py_trees.behaviour import Behaviour

from behaviours.catalogue import PLACES, Catalogue
from behaviours.foreign import leaf_of
from behaviours.leaf import Leaf
from behaviours.node import Node
from config.faults import Diagnostic, InvalidFileError, Mark, Source, one_of
from config.marked import read_source
from config.units import UNITS
from drivers.api.quick import dataclass
from missions.language.body import KEYS
from missions.language.nodes import BRANCHES, MODIFIERS
from missions.language.steps import BESIDE
from missions.library.catalogue import WRITTEN
from missions.library.trial import (
    BrokenOfferError,
    described,
    load_offer,
    offered,
    owner_of,
    place_in,
    problem_of_file,
    said,
    shown,
)

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

GROUP = "missiontree.behaviours"
"""The entry points by which packages offer leaves."""

FOLDER = "behaviours"
"""The folder beside missions in which their own leaves are."""

TAKEN = frozenset({*BRANCHES, *MODIFIERS, *BESIDE, *KEYS})
"""Words that mean something else in missions."""

PREFIX = "missiontree_behaviours."
"""The prefix of the names of modules that come from files."""

KINDS = frozenset({*UNITS, *WRITTEN, "name", "gesture", "move", "gait", "controller"})
"""The kinds of arguments."""


SENSES = frozenset({"faces", "names", "things", "markers", "motion"})
"""What a leaf may look for with the camera."""


@dataclass(frozen=True, slots=True)
class Offer:
    """The classes that one file or entry point offers, and the source in which to show what is wrong with them."""

    source: Source
    classes: Sequence[type[Behaviour]]

    def mark(self, cls: type) -> Mark:
        """Return where a class stands in the source; its beginning where that is not known."""
        try:
            tree = ast.parse(self.source.text)
        except SyntaxError:
            return Mark()
        found = (node for node in ast.walk(tree) if isinstance(node, ast.ClassDef) and node.name == cls.__name__)
        return next((Mark(node.lineno, node.col_offset + 7, len(node.name)) for node in found), Mark())


def found_beside(mission: Path) -> list[Path]:
    """Return the files of leaves in the folder ``behaviours`` beside a mission's file, in the order of their names.

    Those whose names begin with ``_`` are none, nor is anything in a package of Python.
    """
    folder = mission.parent / FOLDER
    if (folder / "__init__.py").exists():
        return []
    return [path for path in sorted(folder.glob("*.py")) if not path.name.startswith("_")]


def real_path(path: Path) -> str:
    """Return where a path leads, also for a link that leads to itself, of which ``Path.resolve`` raises."""
    return os.path.realpath(path)


def vocabulary(files: Iterable[Path] = (), given: Iterable[Path] | None = None) -> Mapping[str, type[Leaf]]:
    """Return every leaf by its word.

    Raises InvalidFileError with all that is wrong with the ``files`` that the user has ``given`` (all, if None).
    Others, and installed packages, that cannot be loaded are skipped and named in a warning: missions that do not use
    them go on.
    """
    own, faults = dict[str, type[Leaf]](), list[Diagnostic]()
    leaves = Catalogue(PLACES, own)
    by_path = {real_path(path): path for path in files}
    needed = by_path.keys() if given is None else {*map(real_path, given)}
    for read, is_needed in [
        *((partial(_from_entry_point, point), False) for point in offered(GROUP)),
        *((partial(_from_file, path), where in needed) for where, path in by_path.items()),
    ]:
        wrong = list[Diagnostic]()
        try:
            offer = read()
        except InvalidFileError as error:
            wrong += error.faults
        else:
            for cls in offer.classes:
                try:
                    leaf = cls if issubclass(cls, Leaf) else leaf_of(cls)
                    _examine(leaf, leaves)
                except Exception as error:
                    words = str(error) if isinstance(error, TypeError) else said(error)
                    wrong.append(Diagnostic(offer.source, offer.mark(cls), words))
                else:
                    own[leaf.word] = leaf
        if is_needed:
            faults += wrong
        elif wrong:
            leaves.skipped.append(wrong[0].source.name)
            _warn("\n".join(map(str, wrong)))
    if faults:
        raise InvalidFileError(faults)
    return leaves


@lru_cache(maxsize=256)
def _warn(words: str) -> None:
    """Warn of what is skipped, once in this process."""
    sys.stderr.write(f"skipped: {words}\n")


def _examine(leaf: type[Leaf], leaves: Mapping[str, type[Leaf]]) -> None:
    """Raise TypeError for a leaf that cannot be a word of the language."""
    word, shown = leaf.word, f"{leaf.__name__}: the word '{leaf.word}'"
    if re.fullmatch(r"[a-z][a-z0-9_]*", word) is None:
        raise TypeError(f"{shown} must be small letters, digits and '_', beginning with a letter")
    if word in TAKEN:
        raise TypeError(f"{shown} means something else in missions already")
    if word in leaves:
        other = leaves[word]
        raise TypeError(f"{shown} is taken by {other.__name__} of {other.__module__.removeprefix(PREFIX)}")
    principal = [argument.name for argument in leaf.arguments.values() if argument.principal]
    if len(principal) > 1:
        raise TypeError(f"{leaf.__name__}: only one argument can be the principal one, not {' and '.join(principal)}")
    for argument in leaf.arguments.values():
        if argument.kind not in KINDS:
            raise TypeError(f"{leaf.__name__}: '{argument.name}' is of no kind: {one_of(argument.kind, KINDS)}")
        if argument.kind in UNITS and isinstance(argument.default, str):
            raise TypeError(f"{leaf.__name__}: the default of '{argument.name}' must be a number, in SI units")
    for sense in sorted(leaf.senses - SENSES):
        raise TypeError(f"{leaf.__name__}: nothing senses '{sense}': {one_of(sense, SENSES)}")
    try:
        inspect.signature(leaf).bind("name")
    except TypeError as error:
        raise TypeError(f"{leaf.__name__}: a leaf is made with its name alone, but here: {error}") from error


def _from_entry_point(point: "EntryPoint") -> Offer:
    """Import what an entry point names. Raises InvalidFileError when that cannot be."""
    source = Source(f"entry point {described(point)}", "")
    owner = owner_of(point)
    try:
        found = load_offer(point)
    except BrokenOfferError as error:
        hint = f"repair or uninstall {owner}" if owner else ""
        raise InvalidFileError([Diagnostic(source, Mark(), str(error), hint)]) from error
    if issubclass(type(found), ModuleType):
        return _of_module(found, source)
    with suppress(Exception):  # of a class that is like no other
        if issubclass(type(found), type) and issubclass(found, Behaviour):
            return Offer(source, [found])
    raise InvalidFileError([Diagnostic(source, Mark(), f"names neither a behaviour nor a module, but {shown(found)}")])


def _from_file(path: Path) -> Offer:
    """Run a file of Python as a module of its own. Raises InvalidFileError when it raises, or has no leaves in it."""
    source = read_source(path)
    if problem := problem_of_file(path):
        mark = Mark(problem.line or 1, problem.column)
        raise InvalidFileError([Diagnostic(source, mark, problem.message)])
    module = ModuleType(PREFIX + path.stem)
    module.__file__ = str(path)
    sys.modules[module.__name__] = module  # where dataclasses and the like look a class's module up
    try:
        # Compiled here, so that nothing is written beside the user's file.
        with redirect_stdout(sys.stderr):
            exec(compile(source.text, str(path), "exec"), vars(module))  # noqa: S102 - running it is what was asked for
    except Exception as error:
        del sys.modules[module.__name__]
        line, column = place_in(error, str(path))
        fault = Diagnostic(source, Mark(line or 1, column), f"cannot be imported: {said(error)}")
        raise InvalidFileError([fault]) from error
    return _of_module(module, source)


def _of_module(module: ModuleType, source: Source) -> Offer:
    found: list[type[Behaviour]] = []
    for name, cls in vars(module).items():
        with suppress(Exception):  # of a class that is like no other
            if (
                issubclass(type(cls), type)
                and cls.__module__ == module.__name__
                and not name.startswith("_")
                and issubclass(cls, Behaviour)
                and not inspect.isabstract(cls)
                and (cls.word if issubclass(cls, Leaf) else not issubclass(cls, Node))
            ):
                found.append(cls)
    if not found:
        hint = "write a class that extends behaviours.leaf.Leaf and has a `word`, or a py_trees behaviour"
        raise InvalidFileError([Diagnostic(source, Mark(), "there is no behaviour in it", hint)])
    return Offer(source, list(dict.fromkeys(found)))
