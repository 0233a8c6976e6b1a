"""Translation of scripts of BehaviorTree.CPP, such as ``x := 1; y = x > 0 ? 'a' : 'b'``, to expressions of missions.

In such scripts, true and false are the numbers 1 and 0. ``&&`` and ``||`` have the same precedence: a chain of both is
evaluated from left to right.
"""

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field

MAX_NUMBER = 1e15
"""Maximum absolute value of a number in a script, which is also the maximum in expressions of missions."""

MAX_SCRIPT_LENGTH = 5_000
MAX_SCRIPT_DEPTH = 40
"""Maximum nesting of parentheses, signs and ``?:`` in a script."""

NUMBER, FLAG, TEXT = "number", "flag", "text"
"""Kinds of values; None is the kind of an unknown value."""

TOKEN = re.compile(
    r"\s*(?:(?P<number>0[xX][0-9a-fA-F]+|(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?)"
    r"|(?P<name>@?[A-Za-z_][A-Za-z0-9_]*)"
    r"|'(?P<text>[^']*)'|\"(?P<double>[^\"]*)\""
    r"|(?P<sign>:=|\+=|-=|\*=|/=|==|!=|<=|>=|&&|\|\||\.\.|[-+*/<>=!?:;()~&|^]))"
)
ASSIGNMENTS = (":=", "=", "+=", "-=", "*=", "/=")
COMPARISONS = ("==", "!=", "<", "<=", ">", ">=")
OPPOSITES = {"==": "!=", "!=": "==", "<": ">=", ">=": "<", ">": "<=", "<=": ">"}
WITHOUT_EQUIVALENT = {
    "&": "the bit operator '&'",
    "|": "the bit operator '|'",
    "^": "the bit operator '^'",
    "~": "the bit operator '~'",
}


class ScriptError(ValueError):
    """Raised for a script that has a syntax error, or that missions cannot express."""


@dataclass(frozen=True, slots=True)
class Formula:
    """A part of a script as an expression of a mission: ``text`` is the expression, ``kind`` the kind of its value.

    - ``reads`` are the blackboard entries that it reads.
    - ``binding`` is the precedence of its operator: a higher one binds more tightly.
    - ``constant`` is its value if it is only a number, a flag or a text, else None.
    - ``parts`` are the joined texts if it joins several.
    - ``opposite`` is the negated expression if it is a comparison, else empty.
    - ``is_template`` is true if the parts are written as one text: ``${a}, ${b}``.
    """

    text: str
    kind: str | None
    reads: tuple[str, ...] = ()
    binding: int = 9
    constant: float | bool | str | None = None
    parts: tuple["Formula", ...] = ()
    is_template: bool = False
    opposite: str = ""

    @property
    def is_condition(self) -> bool:
        """True if the value of the expression is a flag: true or false, and not a number or a text."""
        return self.kind == FLAG

    def within(self, binding: int) -> str:
        """Return the expression as an operand, in parentheses if it binds less tightly than ``binding``."""
        return self.text if self.binding >= binding else f"({self.text})"


@dataclass(frozen=True, slots=True)
class Assignment:
    """One assignment of a script: a blackboard entry, and its new value as an expression."""

    entry: str
    formula: Formula


@dataclass(slots=True)
class Script:
    """A parsed script: its ``assignments`` in order, and its last statement as ``condition`` if it is no assignment."""

    assignments: list[Assignment] = field(default_factory=list)
    condition: Formula | None = None

    @property
    def reads(self) -> tuple[str, ...]:
        """Blackboard entries whose value before the script matters: the script reads them before it sets them."""
        found, known = dict[str, None](), set[str]()
        for each in self.assignments:
            found |= dict.fromkeys(name for name in each.formula.reads if name not in known)
            known.add(each.entry)
        if self.condition is not None:
            found |= dict.fromkeys(name for name in self.condition.reads if name not in known)
        return tuple(found)


Rename = Callable[[str], str]
"""Function that returns the name of the mission's variable for a blackboard entry."""

LOGIC, COMPARISON, SUM, PRODUCT, SIGN, ATOM = 2, 4, 5, 6, 7, 9


def keep_name(name: str) -> str:
    """Return ``name`` unchanged: a ``Rename`` for scripts whose expressions are not written to a mission."""
    return name


def parse_script(text: str, rename: Rename = keep_name, kinds: Mapping[str, str | None] | None = None) -> Script:
    """Parse a script of BehaviorTree.CPP; ``rename`` returns the variable for each blackboard entry.

    ``kinds`` are the known kinds of the entries' values. Raises ScriptError.
    """
    return _Parser(text, rename, kinds or {}).script()


class _Parser:
    """Recursive-descent parser of one script; it makes expressions of missions from the tokens."""

    def __init__(self, text: str, rename: Rename, kinds: Mapping[str, str | None]) -> None:
        if len(text) > MAX_SCRIPT_LENGTH:
            raise ScriptError(f"a script of more than {MAX_SCRIPT_LENGTH:,} characters")
        self._tokens = list(_tokens(text))
        self._at = 0
        self._depth = 0
        self._rename = rename
        self._kinds = dict(kinds)

    def script(self) -> Script:
        found = Script()
        while self._peek() != ("", ""):
            if self._take(";"):
                continue
            kind, word = self._peek()
            following = self._tokens[self._at + 1] if self._at + 1 < len(self._tokens) else ("", "")
            if kind == "name" and following[0] == "sign" and following[1] in ASSIGNMENTS:
                self._at += 2
                found.assignments.append(self._assignment(word, following[1]))
                found.condition = None
            else:
                found.condition = self._choice()
            if self._peek() != ("", "") and not self._take(";"):
                raise ScriptError(f"unexpected '{self._peek()[1]}'")
        return found

    def _assignment(self, entry: str, sign: str) -> Assignment:
        value = self._choice()
        if sign not in (":=", "="):
            value = _combine(sign[0], self._variable(entry), value)
        self._kinds[entry] = value.kind
        return Assignment(entry, value)

    def _variable(self, entry: str) -> Formula:
        return Formula(self._rename(entry), self._kinds.get(entry), (entry,))

    def _choice(self) -> Formula:
        with_condition = self._logic()
        if not self._take("?"):
            return with_condition
        self._deeper()
        one = self._choice()
        if not self._take(":"):
            raise ScriptError("':' is missing")
        other = self._choice()
        self._depth -= 1
        one, other = _of_one_kind(one, other)
        text = f"{one.within(LOGIC)} if {with_condition.within(LOGIC)} else {other.within(1)}"
        return Formula(
            text,
            one.kind if one.kind == other.kind else None,
            (*with_condition.reads, *one.reads, *other.reads),
            binding=1,
        )

    def _logic(self) -> Formula:
        left = self._comparison()
        joined = ""
        while self._peek() in (("sign", "&&"), ("sign", "||")):
            word = "and" if self._next()[1] == "&&" else "or"
            right = self._comparison()
            # A chain of one word needs no parentheses; a change of words does, since ours bind differently.
            first = left.text if joined == word else left.within(COMPARISON)
            text = f"{first} {word} {right.within(COMPARISON)}"
            left, joined = Formula(text, FLAG, (*left.reads, *right.reads), LOGIC), word
        return left

    def _comparison(self) -> Formula:
        left = self._sum()
        if self._peek()[1] not in COMPARISONS or self._peek()[0] != "sign":
            return left
        parts, reads, before = list[str](), list(left.reads), left
        while self._peek()[0] == "sign" and self._peek()[1] in COMPARISONS:
            sign = self._next()[1]
            right = self._sum()
            one, other = _of_one_kind(before, right)
            parts += [*([] if parts else [one.within(SUM)]), sign, other.within(SUM)]
            reads += right.reads
            before = right
        opposite = f"{parts[0]} {OPPOSITES[parts[1]]} {parts[2]}" if len(parts) == 3 else ""
        whole = Formula(" ".join(parts), FLAG, tuple(reads), COMPARISON, opposite=opposite)
        return (_simple_flag_test(left, parts) if len(parts) == 3 else None) or whole

    def _sum(self) -> Formula:
        left = self._product()
        while self._peek() in (("sign", "+"), ("sign", "-"), ("sign", "..")):
            left = _combine(self._next()[1], left, self._product())
        return left

    def _product(self) -> Formula:
        left = self._sign()
        while self._peek() in (("sign", "*"), ("sign", "/")):
            left = _combine(self._next()[1], left, self._sign())
        return left

    def _sign(self) -> Formula:
        if self._peek() not in (("sign", "!"), ("sign", "-")):
            return self._atom()
        sign = self._next()[1]
        self._deeper()
        part = self._sign()
        self._depth -= 1
        if sign == "!":
            return Formula(f"not {part.within(SIGN)}", FLAG, part.reads, LOGIC + 1)
        negative = -part.constant if isinstance(part.constant, float) else None
        return Formula(f"-{part.within(SIGN)}", NUMBER, part.reads, SIGN, constant=negative)

    def _atom(self) -> Formula:
        kind, word = self._next()
        if kind == "number":
            value = float(int(word[:40], 16)) if word[:2].lower() == "0x" else float(word)
            if abs(value) > MAX_NUMBER:
                raise ScriptError("a number out of range")
            return Formula(number_text(value), NUMBER, constant=value)
        if kind == "text":
            return text_formula(word)
        if kind == "name":
            if word in ("true", "false"):
                return Formula(word, FLAG, constant=word == "true")
            return self._variable(word)
        if (kind, word) == ("sign", "("):
            self._deeper()
            inner = self._choice()
            self._depth -= 1
            if self._peek()[1] in ASSIGNMENTS:
                raise ScriptError("an assignment inside an expression")
            if not self._take(")"):
                raise ScriptError("')' is missing")
            return inner
        if word in WITHOUT_EQUIVALENT:
            raise ScriptError(WITHOUT_EQUIVALENT[word])
        raise ScriptError(f"unexpected '{word}'" if word else "a value is missing at its end")

    def _deeper(self) -> None:
        self._depth += 1
        if self._depth > MAX_SCRIPT_DEPTH:
            raise ScriptError(f"nested too deeply: at most {MAX_SCRIPT_DEPTH} levels")

    def _peek(self) -> tuple[str, str]:
        found = self._tokens[self._at] if self._at < len(self._tokens) else ("", "")
        if found[0] == "sign" and found[1] in ("&", "|", "^") and self._at:
            raise ScriptError(WITHOUT_EQUIVALENT[found[1]])
        return found

    def _next(self) -> tuple[str, str]:
        found = self._peek()
        self._at += 1
        return found

    def _take(self, sign: str) -> bool:
        taken = self._peek() == ("sign", sign)
        self._at += taken
        return taken


def _tokens(text: str) -> Iterator[tuple[str, str]]:
    at = 0
    while text[at:].strip():
        found = TOKEN.match(text, at)
        if found is None:
            raise ScriptError(f"unexpected '{text[at:].strip()[0]}'")
        kind = str(found.lastgroup)
        yield "text" if kind == "double" else kind, found[kind]
        at = found.end()


def number_text(value: float) -> str:
    """Return a number as it is written in an expression: "6", "0.25"."""
    return str(int(value)) if value == int(value) and abs(value) < 1e15 else repr(value)


def text_formula(text: str) -> Formula:
    """Return a text as a constant expression, in quotes."""
    escaped = text.replace("\\", "\\\\").replace("\n", " ").replace("\r", " ")
    quote = '"' if "'" in escaped else "'"
    return Formula(f"{quote}{escaped.replace(quote, chr(92) + quote)}{quote}", TEXT, constant=text)


def _combine(sign: str, left: Formula, right: Formula) -> Formula:
    reads = (*left.reads, *right.reads)
    if sign == ".." or (sign == "+" and TEXT in (left.kind, right.kind)):
        return _join(left, right, reads, is_template=sign == "..")
    binding = SUM if sign in "+-" else PRODUCT
    text = f"{left.within(binding)} {sign} {right.within(binding + 1)}"
    return Formula(text, NUMBER if sign != "+" or NUMBER in (left.kind, right.kind) else None, reads, binding)


def _join(left: Formula, right: Formula, reads: tuple[str, ...], *, is_template: bool) -> Formula:
    """Return an expression that joins two texts; ``reads`` are the blackboard entries that both read.

    It keeps its parts, because an expression cannot join a number to a text; ``"${a}${b}"`` can.
    """
    parts = (*(left.parts or (left,)), *(right.parts or (right,)))
    is_template = is_template or any(part.kind != TEXT for part in parts)
    text = f"{left.within(SUM)} + {right.within(PRODUCT)}"
    return Formula(text, TEXT, reads, SUM, parts=parts, is_template=is_template)


def _of_one_kind(one: Formula, other: Formula) -> tuple[Formula, Formula]:
    """Return two values that a script compares or chooses from, written with the same kind of value if possible.

    A constant number beside a flag becomes a flag; beside a text it becomes a text.
    """
    return _as_kind(one, other.kind), _as_kind(other, one.kind)


def _as_kind(formula: Formula, kind: str | None) -> Formula:
    value = formula.constant
    if kind == FLAG and isinstance(value, float) and value in (0, 1):
        return Formula("true" if value else "false", FLAG, constant=bool(value))
    if kind == NUMBER and formula.kind == FLAG:
        if isinstance(value, bool):
            return Formula(str(int(value)), NUMBER, constant=float(value))
        return Formula(f"1 if {formula.within(LOGIC)} else 0", NUMBER, formula.reads, 1)
    if kind == NUMBER and isinstance(value, str) and re.fullmatch(r"-?\d+(\.\d*)?", value):
        return Formula(number_text(float(value)), NUMBER, constant=float(value))
    if kind == TEXT and isinstance(value, float) and not isinstance(value, bool):
        return text_formula(number_text(value))
    return formula


def _simple_flag_test(left: Formula, parts: list[str]) -> Formula | None:
    """Return a shorter form of a comparison of ``left`` with a constant flag: ``x`` for ``x == true``.

    ``x == false`` becomes ``not x``. A value of an unknown kind is taken as a flag, since missions compare no such
    value with one. ``parts`` are the texts of left side, operator and right side. None for other comparisons.
    """
    if left.kind not in (FLAG, None) or parts[2] not in ("true", "false") or parts[1] not in ("==", "!="):
        return None
    return as_condition(left) if (parts[1] == "==") == (parts[2] == "true") else negate(left)


def negate(formula: Formula) -> Formula:
    """Return the negated condition, as ``x >= 1`` for ``x < 1``."""
    if formula.opposite:
        return Formula(formula.opposite, FLAG, formula.reads, COMPARISON, opposite=formula.text)
    if formula.text.startswith("not ") and formula.binding == LOGIC + 1:
        return _without_parentheses(Formula(formula.text.removeprefix("not "), FLAG, formula.reads, LOGIC))
    return Formula(f"not {formula.within(SIGN)}", FLAG, formula.reads, LOGIC + 1)


def _without_parentheses(formula: Formula) -> Formula:
    """Return a condition without parentheses around all of it."""
    text, depth = formula.text, 0
    if not text.startswith("("):
        return formula
    for place, letter in enumerate(text):
        depth += (letter == "(") - (letter == ")")
        if letter in "'\"" or (depth == 0 and place < len(text) - 1):
            return formula
    return Formula(text[1:-1], FLAG, formula.reads, 1)


def as_condition(formula: Formula) -> Formula:
    """Return an expression that is true or false; a number is true unless it is 0."""
    if formula.is_condition:
        return formula
    return Formula(f"not not {formula.within(SIGN)}", FLAG, formula.reads, LOGIC + 1)
