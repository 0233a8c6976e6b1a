"""Leaves that the user has written in the files of stub leaves of earlier imports; another import keeps them."""

import ast
import re
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from config.diagnostics import Diagnostic, InvalidFileError, Mark, SourceText


@dataclass(frozen=True, slots=True)
class MergedStubs:
    """Text of a stub file after another import, with the tags of the leaves that the import ``added``.

    ``outdated`` are the tags of kept stubs whose attributes differ from those of the import.
    """

    text: str
    added: tuple[str, ...]
    outdated: tuple[str, ...]


LeafClasses = dict[str, ast.ClassDef]
"""Classes of the leaves in a Python file, by their tags."""


def tags_in(source: SourceText) -> LeafClasses:
    """Return the classes of a Python file that declare a ``tag``, by the tag. Raises InvalidFileError."""
    return _leaf_classes(_parse(source))


def _leaf_classes(tree: ast.Module) -> LeafClasses:
    return {tag: cls for cls in tree.body if isinstance(cls, ast.ClassDef) for tag in _texts(cls, "tag")}


def find_written_tags(files: Mapping[Path, LeafClasses]) -> set[str]:
    """Return the tags of all leaves in Python files, without those of stubs."""
    return {tag for tags in files.values() for tag, cls in tags.items() if not any(_texts(cls, "stub"))}


def head_of(text: str) -> str:
    """Return the docstring and the imports of a stub file, without its classes."""
    first = next(each for each in ast.parse(text).body if isinstance(each, ast.ClassDef))
    return "\n".join(text.split("\n")[: first.lineno - 1])


def merge_stubs(source: SourceText, new: str, elsewhere: Collection[str]) -> MergedStubs:
    """Return the stub file ``source`` as it is, with those classes of the stub file ``new`` that it lacks at its end.

    ``elsewhere`` are the tags in other files of the folder, which need no stub. Raises InvalidFileError.
    """
    tree, fresh = _parse(source), ast.parse(new)
    present, offered = _leaf_classes(tree), _leaf_classes(fresh)
    missing = {tag: cls for tag, cls in offered.items() if tag not in present and tag not in elsewhere}
    outdated = (
        tag
        for tag, cls in present.items()
        if tag in offered and any(_texts(cls, "stub")) and _attributes(cls) != _attributes(offered[tag])
    )
    if not missing:
        return MergedStubs(source.text, (), tuple(outdated))
    taken = set(_bound_names(tree))
    imports = [each for each in fresh.body if isinstance(each, ast.ImportFrom) and not taken.issuperset(_names(each))]
    lines = new.split("\n")
    parts = ["\n".join(map(ast.unparse, imports))] if imports else []
    for cls in missing.values():
        name = cls.name
        while name in taken:
            name += "_"
        taken.add(name)
        text = "\n".join(lines[cls.lineno - 1 : cls.end_lineno])
        parts.append(re.sub(rf"^class {re.escape(cls.name)}\b", f"class {name}", text))
    return MergedStubs("\n\n\n".join([source.text.rstrip(), *parts]) + "\n", tuple(missing), tuple(outdated))


def _parse(source: SourceText) -> ast.Module:
    try:
        return ast.parse(source.text)
    except (SyntaxError, ValueError) as error:
        line, reason = getattr(error, "lineno", None) or 1, getattr(error, "msg", error)
        hint = "correct it, or choose another folder: an import keeps the leaves in it"
        raise InvalidFileError([Diagnostic(source, Mark(line), f"not valid Python: {reason}", hint)]) from error


def _texts(cls: ast.ClassDef, attribute: str) -> Iterator[str]:
    """Yield the text that a class assigns to one of its attributes, if it does."""
    for each in cls.body:
        match each:
            case (
                ast.Assign(targets=[ast.Name(id=name)], value=ast.Constant(value=str(text)))
                | ast.AnnAssign(target=ast.Name(id=name), value=ast.Constant(value=str(text)))
            ) if name == attribute:
                yield text


def _attributes(cls: ast.ClassDef) -> list[str]:
    """Return the attributes that a class declares, such as its arguments, in a form for comparison."""
    return [ast.dump(each) for each in cls.body if isinstance(each, ast.Assign | ast.AnnAssign)]


def _names(statement: ast.ImportFrom) -> list[str]:
    return [each.asname or each.name for each in statement.names]


def _bound_names(tree: ast.Module) -> Iterator[str]:
    """Yield the names that the imports and classes at the top of a file define."""
    for each in tree.body:
        if isinstance(each, ast.ImportFrom | ast.Import):
            yield from (alias.asname or alias.name for alias in each.names)
        elif isinstance(each, ast.ClassDef | ast.FunctionDef):
            yield each.name
