"""Leaves of MissionTree, of installed packages, and of the user's behaviour files.

A package offers leaves by entry points of the group ``missiontree.behaviours``, each for a class or a module. A module
or a file offers the classes that are defined in it and whose names do not begin with ``_``. They can be leaves with a
``word``, or plain behaviours of py_trees.
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
from unicodedata import normalize

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

WORD = re.compile(r"[^\W\d_]\w*")
"""Form of a leaf's word: a letter of any script, then letters, digits and ``_``."""

ENTRY_POINT_GROUP = "missiontree.behaviours"
"""Group of entry points by which packages offer leaves."""

BEHAVIOURS_FOLDER = "behaviours"
"""Name of the folder with behaviour files, beside missions."""

RESERVED_WORDS = frozenset({*BRANCHES, *MODIFIERS, *BESIDE_KEYS, *MISSION_KEYS})
"""Words with another meaning in missions, which no leaf can have as its tag."""

MODULE_PREFIX = "missiontree_behaviours."
"""Prefix of the names of modules that are loaded from files."""

ARGUMENT_KINDS = frozenset({*UNITS, *EXAMPLE_VALUES, "name", "gesture", "move", "gait", "controller"})
"""Kinds that a leaf can declare for an argument."""


SENSES = frozenset({"faces", "names", "things", "markers", "motion"})
"""Detectors that a leaf can list in ``senses``."""


@dataclass(frozen=True, slots=True)
class OfferedLeaves:
    """Leaf classes that a file or an entry point offers, with its ``source`` for error messages."""

    source: SourceText
    classes: Sequence[type[Behaviour]]

    def mark(self, cls: type) -> Mark:
        """Return the place of a class in the source; the first line if it is not found."""
        try:
            tree = ast.parse(self.source.text)
        except SyntaxError:
            return Mark()
        found = (node for node in ast.walk(tree) if isinstance(node, ast.ClassDef) and node.name == cls.__name__)
        return next((Mark(node.lineno, node.col_offset + 7, len(node.name)) for node in found), Mark())


def behaviour_files_beside(mission: Path) -> list[Path]:
    """Return the behaviour files in the folder ``behaviours`` beside a mission's file, in the order of their names.

    Files whose names begin with ``_``, and Python packages, are skipped.
    """
    folder = mission.parent / BEHAVIOURS_FOLDER
    if (folder / "__init__.py").exists():
        return []
    return [path for path in sorted(folder.glob("*.py")) if not path.name.startswith("_")]


def real_path(path: Path) -> str:
    """Return the target of a path, also of a circular link, for which ``Path.resolve`` raises."""
    return os.path.realpath(path)


def load_leaves(files: Iterable[Path] = (), required_files: Iterable[Path] | None = None) -> Mapping[str, type[Leaf]]:
    """Return all leaves by their tag.

    Raises InvalidFileError with all errors in the ``required_files`` (all ``files``, if None). Other files and
    installed packages with errors are skipped with a warning, so that other missions are not affected.
    """
    own_leaves, faults = dict[str, type[Leaf]](), list[Diagnostic]()
    leaves = Catalogue(LEAF_PATHS, own_leaves)
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
                    own_leaves[leaf.tag] = leaf
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
    """Warn of a skipped file or package, once in this process."""
    sys.stderr.write(f"skipped: {words}\n")


def _check_leaf(leaf: type[Leaf], leaves: Mapping[str, type[Leaf]]) -> None:
    """Raise TypeError for a leaf with an invalid declaration."""
    word, shown = leaf.tag, f"{leaf.__name__}: the word '{leaf.tag}'"
    if not WORD.fullmatch(word) or word != normalize("NFKC", word.lower()):
        raise TypeError(f"{shown} must be lower-case letters, digits and '_', beginning with a letter")
    if word in RESERVED_WORDS:
        raise TypeError(f"{shown} is reserved in missions")
    if word in leaves:
        other = leaves[word]
        raise TypeError(f"{shown} is taken by {other.__name__} of {other.__module__.removeprefix(MODULE_PREFIX)}")
    principal = [argument.name for argument in leaf.arguments.values() if argument.principal]
    if len(principal) > 1:
        raise TypeError(f"{leaf.__name__}: only one argument can be the principal one, not {' and '.join(principal)}")
    for argument in leaf.arguments.values():
        if argument.kind not in ARGUMENT_KINDS:
            raise TypeError(
                f"{leaf.__name__}: '{argument.name}' has an unknown kind: {suggest_from(argument.kind, ARGUMENT_KINDS)}"
            )
        if argument.kind in UNITS and isinstance(argument.default, str):
            raise TypeError(f"{leaf.__name__}: the default of '{argument.name}' must be a number, in SI units")
    for sense in sorted(leaf.senses - SENSES):
        raise TypeError(f"{leaf.__name__}: unknown sense '{sense}': {suggest_from(sense, SENSES)}")
    try:
        inspect.signature(leaf).bind("name")
    except TypeError as error:
        raise TypeError(f"{leaf.__name__}: a leaf must be constructible with its name alone: {error}") from error


def _load_from_entry_point(point: "EntryPoint") -> OfferedLeaves:
    """Import an entry point. Raises InvalidFileError."""
    source = SourceText(f"entry point {describe_entry_point(point)}", "")
    owner = owner_of(point)
    try:
        found = load_entry_point(point)
    except BrokenEntryPointError as error:
        hint = f"repair or uninstall {owner}" if owner else ""
        raise InvalidFileError([Diagnostic(source, Mark(), str(error), hint)]) from error
    if issubclass(type(found), ModuleType):
        return _leaves_of_module(found, source)
    with suppress(Exception):  # a class may override anything that is called here
        if issubclass(type(found), type) and issubclass(found, Behaviour):
            return OfferedLeaves(source, [found])
    raise InvalidFileError(
        [Diagnostic(source, Mark(), f"names neither a behaviour nor a module, but {short_repr(found)}")]
    )


def _load_from_file(path: Path) -> OfferedLeaves:
    """Run a Python file as a module. Raises InvalidFileError if it raises, or contains no leaves."""
    source = read_source(path)
    if problem := find_file_problem(path):
        mark = Mark(problem.line or 1, problem.column)
        raise InvalidFileError([Diagnostic(source, mark, problem.message)])
    module = ModuleType(MODULE_PREFIX + path.stem)
    module.__file__ = str(path)
    sys.modules[module.__name__] = module  # dataclasses and others look up the module of a class here
    try:
        # Compiled here, so that no cache file is written beside the user's file.
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
        with suppress(Exception):  # a class may override anything that is called here
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
        raise InvalidFileError([Diagnostic(source, Mark(), "it contains no behaviour", hint)])
    return OfferedLeaves(source, list(dict.fromkeys(found)))
