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

from behaviours.catalogue import LEAF_PATHS, Catalogue
from behaviours.leaf import Leaf
from behaviours.node import Node
from behaviours.py_trees_leaf import leaf_of
from config.diagnostics import Diagnostic, InvalidFileError, Mark, SourceText, suggest_from
from config.units import UNITS
from config.yaml_nodes import read_source
from drivers.api.fast_dataclass import dataclass
from missions.language.mission_body import MISSION_KEYS
from missions.language.nodes import BRANCHES, MODIFIERS
from missions.language.steps import BESIDE_KEYS
from missions.library.catalogue import EXAMPLE_VALUES
from missions.library.import_trial import (
    BrokenEntryPointError,
    describe_entry_point,
    entry_points_of,
    error_position,
    error_text,
    find_file_problem,
    load_entry_point,
    owner_of,
    short_repr,
)

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

ENTRY_POINT_GROUP = "missiontree.behaviours"
"""The entry points by which packages offer leaves."""

BEHAVIOURS_FOLDER = "behaviours"
"""The folder beside missions in which their own leaves are."""

RESERVED_WORDS = frozenset({*BRANCHES, *MODIFIERS, *BESIDE_KEYS, *MISSION_KEYS})
"""Words that mean something else in missions."""

MODULE_PREFIX = "missiontree_behaviours."
"""The prefix of the names of modules that come from files."""

ARGUMENT_KINDS = frozenset({*UNITS, *EXAMPLE_VALUES, "name", "gesture", "move", "gait", "controller"})
"""The kinds of arguments."""


SENSES = frozenset({"faces", "names", "things", "markers", "motion"})
"""What a leaf may look for with the camera."""


@dataclass(frozen=True, slots=True)
class OfferedLeaves:
    """The classes that one file or entry point offers, and the source in which to show what is wrong with them."""

    source: SourceText
    classes: Sequence[type[Behaviour]]

    def mark(self, cls: type) -> Mark:
        """Return where a class stands in the source; its beginning where that is not known."""
        try:
            tree = ast.parse(self.source.text)
        except SyntaxError:
            return Mark()
        found = (node for node in ast.walk(tree) if isinstance(node, ast.ClassDef) and node.name == cls.__name__)
        return next((Mark(node.lineno, node.col_offset + 7, len(node.name)) for node in found), Mark())


def behaviour_files_beside(mission: Path) -> list[Path]:
    """Return the files of leaves in the folder ``behaviours`` beside a mission's file, in the order of their names.

    Those whose names begin with ``_`` are none, nor is anything in a package of Python.
    """
    folder = mission.parent / BEHAVIOURS_FOLDER
    if (folder / "__init__.py").exists():
        return []
    return [path for path in sorted(folder.glob("*.py")) if not path.name.startswith("_")]


def real_path(path: Path) -> str:
    """Return where a path leads, also for a link that leads to itself, of which ``Path.resolve`` raises."""
    return os.path.realpath(path)


def load_leaves(files: Iterable[Path] = (), required_files: Iterable[Path] | None = None) -> Mapping[str, type[Leaf]]:
    """Return every leaf by its word.

    Raises InvalidFileError with all that is wrong with the ``files`` that the user has ``given`` (all, if None).
    Others, and installed packages, that cannot be loaded are skipped and named in a warning: missions that do not use
    them go on.
    """
    own, faults = dict[str, type[Leaf]](), list[Diagnostic]()
    leaves = Catalogue(LEAF_PATHS, own)
    by_path = {real_path(path): path for path in files}
    needed = by_path.keys() if required_files is None else {*map(real_path, required_files)}
    for read, is_needed in [
        *((partial(_load_from_entry_point, point), False) for point in entry_points_of(ENTRY_POINT_GROUP)),
        *((partial(_load_from_file, path), where in needed) for where, path in by_path.items()),
    ]:
        wrong = list[Diagnostic]()
        try:
            offer = read()
        except InvalidFileError as error:
            wrong += error.diagnostics
        else:
            for cls in offer.classes:
                try:
                    leaf = cls if issubclass(cls, Leaf) else leaf_of(cls)
                    _check_leaf(leaf, leaves)
                except Exception as error:
                    words = str(error) if isinstance(error, TypeError) else error_text(error)
                    wrong.append(Diagnostic(offer.source, offer.mark(cls), words))
                else:
                    own[leaf.tag] = leaf
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


def _check_leaf(leaf: type[Leaf], leaves: Mapping[str, type[Leaf]]) -> None:
    """Raise TypeError for a leaf that cannot be a word of the language."""
    word, shown = leaf.tag, f"{leaf.__name__}: the word '{leaf.tag}'"
    if re.fullmatch(r"[a-z][a-z0-9_]*", word) is None:
        raise TypeError(f"{shown} must be small letters, digits and '_', beginning with a letter")
    if word in RESERVED_WORDS:
        raise TypeError(f"{shown} means something else in missions already")
    if word in leaves:
        other = leaves[word]
        raise TypeError(f"{shown} is taken by {other.__name__} of {other.__module__.removeprefix(MODULE_PREFIX)}")
    principal = [argument.name for argument in leaf.arguments.values() if argument.principal]
    if len(principal) > 1:
        raise TypeError(f"{leaf.__name__}: only one argument can be the principal one, not {' and '.join(principal)}")
    for argument in leaf.arguments.values():
        if argument.kind not in ARGUMENT_KINDS:
            raise TypeError(
                f"{leaf.__name__}: '{argument.name}' is of no kind: {suggest_from(argument.kind, ARGUMENT_KINDS)}"
            )
        if argument.kind in UNITS and isinstance(argument.default, str):
            raise TypeError(f"{leaf.__name__}: the default of '{argument.name}' must be a number, in SI units")
    for sense in sorted(leaf.senses - SENSES):
        raise TypeError(f"{leaf.__name__}: nothing senses '{sense}': {suggest_from(sense, SENSES)}")
    try:
        inspect.signature(leaf).bind("name")
    except TypeError as error:
        raise TypeError(f"{leaf.__name__}: a leaf is made with its name alone, but here: {error}") from error


def _load_from_entry_point(point: "EntryPoint") -> OfferedLeaves:
    """Import what an entry point names. Raises InvalidFileError when that cannot be."""
    source = SourceText(f"entry point {describe_entry_point(point)}", "")
    owner = owner_of(point)
    try:
        found = load_entry_point(point)
    except BrokenEntryPointError as error:
        hint = f"repair or uninstall {owner}" if owner else ""
        raise InvalidFileError([Diagnostic(source, Mark(), str(error), hint)]) from error
    if issubclass(type(found), ModuleType):
        return _leaves_of_module(found, source)
    with suppress(Exception):  # of a class that is like no other
        if issubclass(type(found), type) and issubclass(found, Behaviour):
            return OfferedLeaves(source, [found])
    raise InvalidFileError(
        [Diagnostic(source, Mark(), f"names neither a behaviour nor a module, but {short_repr(found)}")]
    )


def _load_from_file(path: Path) -> OfferedLeaves:
    """Run a file of Python as a module of its own. Raises InvalidFileError when it raises, or has no leaves in it."""
    source = read_source(path)
    if problem := find_file_problem(path):
        mark = Mark(problem.line or 1, problem.column)
        raise InvalidFileError([Diagnostic(source, mark, problem.message)])
    module = ModuleType(MODULE_PREFIX + path.stem)
    module.__file__ = str(path)
    sys.modules[module.__name__] = module  # where dataclasses and the like look a class's module up
    try:
        # Compiled here, so that nothing is written beside the user's file.
        with redirect_stdout(sys.stderr):
            exec(compile(source.text, str(path), "exec"), vars(module))  # noqa: S102 - running it is what was asked for
    except Exception as error:
        del sys.modules[module.__name__]
        line, column = error_position(error, str(path))
        fault = Diagnostic(source, Mark(line or 1, column), f"cannot be imported: {error_text(error)}")
        raise InvalidFileError([fault]) from error
    return _leaves_of_module(module, source)


def _leaves_of_module(module: ModuleType, source: SourceText) -> OfferedLeaves:
    found: list[type[Behaviour]] = []
    for name, cls in vars(module).items():
        with suppress(Exception):  # of a class that is like no other
            if (
                issubclass(type(cls), type)
                and cls.__module__ == module.__name__
                and not name.startswith("_")
                and issubclass(cls, Behaviour)
                and not inspect.isabstract(cls)
                and (cls.tag if issubclass(cls, Leaf) else not issubclass(cls, Node))
            ):
                found.append(cls)
    if not found:
        hint = "write a class that extends behaviours.leaf.Leaf and has a `word`, or a py_trees behaviour"
        raise InvalidFileError([Diagnostic(source, Mark(), "there is no behaviour in it", hint)])
    return OfferedLeaves(source, list(dict.fromkeys(found)))
