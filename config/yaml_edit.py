"""Edits single values in YAML files written by people; comments and layout are kept."""

import re
from collections.abc import Mapping as PyMapping
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from config.diagnostics import InvalidFileError, Mark, SourceText
from config.file_io import save_file
from config.library import HERE
from config.yaml_nodes import Listing, Mapping, Node, Scalar, compose

_BOM = b"\xef\xbb\xbf"
_FLOW = re.compile(r"\[[^\[\]{}\"'#]*\]")
"""Pattern of a list of plain values on one line, such as [-90 deg, 90 deg]."""


class NotEditableError(ValueError):
    """A file that must not be edited, or lacks the place of the new value; the message says what to do instead."""


def with_value(source: SourceText, keys: Sequence[str], value: str) -> str:
    """Return the text of a YAML file with ``value`` at the path ``keys``, replaced or added.

    Raises NotEditableError if an outer mapping is missing or written elsewhere (an alias), InvalidFileError for invalid
    YAML.
    """
    node: Node = compose(source)
    for key in keys[:-1]:
        found = node.get(key) if isinstance(node, Mapping) else None
        if not isinstance(found, Mapping):
            raise NotEditableError(f"{source.name}: there is no section '{key}'")
        node = found
    if not isinstance(node, Mapping):
        raise NotEditableError(f"{source.name}: not a mapping")
    old = node.get(keys[-1])
    if isinstance(old, Scalar):
        return _replace_at(source.text, old.mark, value, length=old.mark.length)
    if isinstance(old, Listing) and (list_ := _FLOW.match(source.line(old.mark.line), old.mark.column - 1)):
        return _replace_at(source.text, old.mark, value, length=len(list_[0]))
    if old is not None:
        raise NotEditableError(f"{source.name}: '{keys[-1]}' is not a single value or a list on one line")
    return _add(source.text, node, f"{keys[-1]}: {value}")


def without_key(source: SourceText, key: str) -> str:
    """Return the text of a YAML file without a top-level ``key`` and its value; unchanged if it has none.

    Raises NotEditableError if the value shares its line or spans several, InvalidFileError for invalid YAML.
    """
    node = compose(source)
    found = [(name, value) for name, value in node.entries if name.text == key] if isinstance(node, Mapping) else []
    lines = source.text.splitlines(keepends=True)
    for name, value in found:
        line = source.line(name.mark.line)
        alone = name.mark.column == 1 and line.startswith((key, f'"{key}"', f"'{key}'"))
        if not (alone and isinstance(value, Scalar) and value.mark.line == name.mark.line and "\n" not in value.text):
            raise NotEditableError(f"{source.name}: '{key}' cannot be removed automatically: remove it by hand")
        lines[name.mark.line - 1] = ""
    return "".join(lines)


def with_values(source: SourceText, values: PyMapping[tuple[str, ...], str]) -> str:
    """Return the text of a YAML file with each of ``values`` at its keys, and all other values unchanged.

    Raises NotEditableError and InvalidFileError as ``with_value``, and NotEditableError if an anchor is used more than
    once.
    """
    expected, text = _plain_value(compose(source)), source.text
    for keys, value in values.items():
        text = with_value(SourceText(source.name, text), keys, value)
        section = expected
        for key in keys[:-1]:
            section = section[key]
        section[keys[-1]] = _plain_value(compose(SourceText(source.name, value)))
    try:
        right = _plain_value(compose(SourceText(source.name, text))) == expected
    except InvalidFileError:  # the anchor was lost
        right = False
    if not right:
        changes = "; ".join(": ".join((*keys, value)) for keys, value in values.items())
        raise NotEditableError(f"{source.name}: it cannot be edited automatically; write {changes}")
    return text


def _plain_value(node: Node) -> Any:
    if isinstance(node, Mapping):
        return {name.text: _plain_value(value) for name, value in node.entries}
    return [_plain_value(each) for each in node.items] if isinstance(node, Listing) else node.value


def _replace_at(text: str, mark: Mark, new: str, *, length: int = 0) -> str:
    """Return the text with ``length`` characters at ``mark`` replaced by ``new``."""
    lines = text.splitlines(keepends=True)
    line, at = lines[mark.line - 1], mark.column - 1
    lines[mark.line - 1] = line[:at] + new + line[at + length :]
    return "".join(lines)


def _add(text: str, mapping: Mapping, entry: str) -> str:
    """Return the text with a new first entry of a mapping: after the brace of ``{...}``, else on its own line."""
    line = text.splitlines()[mapping.mark.line - 1]
    if line[mapping.mark.column - 1 :].startswith("{"):
        behind = Mark(mapping.mark.line, mapping.mark.column + 1)
        return _replace_at(text, behind, entry + (", " if mapping.entries else ""))
    indent = line[: mapping.mark.column - 1]
    newline = "\r\n" if "\r\n" in text else "\n"
    return _replace_at(text, mapping.mark, entry + newline + indent)


def require_own(path: Path, command: str) -> None:
    """Raise NotEditableError for a file that ships with MissionTree, since an update would overwrite it.

    ``command`` is the command to suggest for copying the file; ``FILE`` in it stands for the copy.
    """
    if path.resolve().is_relative_to(HERE.resolve()):
        copy = f"my_{path.name}"
        raise NotEditableError(
            f"{path.stem} ships with MissionTree and is not written; copy it:\n"
            f"  cp {path} {copy}\n  {command.replace('FILE', copy)}"
        )


def rewrite(path: Path, text: str) -> None:
    """Replace the text of a file with ``save_file``, keeping mode and byte order mark. Raises OSError."""
    mark = _BOM if path.read_bytes().startswith(_BOM) else b""
    save_file(path, mark + text.encode())
