"""How expressions are spelt where Python's own parser would read something else: quantities, and Python's words.

Each is replaced by a name of as many characters, so that columns stay places in the text.
"""

import ast
import keyword
import re
from collections.abc import Mapping

from config.units import UNITS, quantity

WORDS = {"true": True, "false": False, "null": None, "none": None}
"""Constants, as YAML writes them."""

RESERVED = frozenset(
    ["and", "async", "await", "else", "False", "for", "if", "in", "is", "lambda", "None", "not", "or", "True", "yield"]
)
"""Words that an expression cannot have as names: Python has a meaning for them within one."""

NAMES = "|".join(word for word in keyword.kwlist if word not in RESERVED)
OR_QUOTED = re.compile(rf"""("(?:\\.|[^"\\])*"|'(?:\\.|[^'\\])*')|\b({NAMES})\b""")

AFTER = "(?:and|or|if|else|in|not)"
"""Words that may follow a whole operand."""

BOLD_A = 0x1D41A
"""MATHEMATICAL BOLD SMALL A; the rest of the alphabet follows it."""

UNIT = "|".join(sorted(map(re.escape, {unit for units in UNITS.values() for unit in units} - {"%"}), key=len)[::-1])
LITERAL = re.compile(
    r"""("(?:\\.|[^"\\])*"|'(?:\\.|[^'\\])*')"""  # a text, which is passed over
    rf"|(?<![\w.])((?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?\s*(?:(?:{UNIT})(?![\w(])|%(?=\s*(?:$|[])<>=!,*/%+-]|{AFTER}\b))))"
)
"""A quantity within an expression: ``1.5 m/s``. A percent sign is one where nothing follows that it could divide."""

STAND_IN = "\ua66e"
"""A letter of which a quantity's stand-in is made, for Python's parser: a name of as many characters."""


def as_python(text: str) -> tuple[str, dict[int, str]]:
    """Return an expression as Python reads it, and the quantities in it, by where they begin."""
    literals = {found.start(): found[2] for found in LITERAL.finditer(text) if found[2]}
    plain = LITERAL.sub(lambda found: found[1] or STAND_IN * len(found[2]), text)
    return OR_QUOTED.sub(_as_name, plain), literals


def _as_name(found: re.Match[str]) -> str:
    """Return a word of Python's, such as ``from``, as a name of as many characters that the parser takes for it.

    Python knows its own words by their plain letters, and takes a bold one for a plain one in names alone (NFKC,
    reference manual 2.3).
    """
    quoted, word = found.groups()
    return str(quoted) if word is None else chr(BOLD_A + ord(word[0]) - ord("a")) + word[1:]


class Literals(ast.NodeTransformer):
    """Puts quantities in the places of their stand-ins."""

    def __init__(self, python: str, literals: Mapping[int, str]) -> None:
        self._python = python
        self._literals = literals

    def visit_Name(self, node: ast.Name) -> ast.expr:
        """Return the quantity that stands here, or the name."""
        written = self._literals.get(characters(self._python, node)[0]) if self._literals else None
        found = None if written is None else quantity(written)
        if found is None:
            return node
        return ast.copy_location(ast.Constant(found), node)


def characters(text: str, node: ast.expr) -> tuple[int, int]:
    """Return where in its line a node begins and ends, in characters: Python's parser counts bytes of UTF-8."""
    data = text.encode()
    end = len(data) if node.end_col_offset is None else node.end_col_offset
    return len(data[: node.col_offset].decode()), len(data[:end].decode())


def cure(text: str) -> str:
    """Say what to write for what other languages, and people, write."""
    if "${" in text:
        return "; write it without '${' and '}'"
    for sign, word in (("&&", "and"), ("||", "or")):
        if sign in text:
            return f"; write '{word}' for '{sign}'"
    if re.search(r"(?<![=!<>])=(?!=)", text):
        return "; compare with '=='"
    return "; write 'not' for '!'" if re.search("!(?!=)", text) else ""
