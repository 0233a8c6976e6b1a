"""Writer of mission files: their YAML text from a tree of steps, with comments."""

import json
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from unicodedata import normalize

from config.diagnostics import to_snake_case
from config.units import parse_quantity
from config.yaml_nodes import plain_value
from config.yaml_writer import yaml_word

MAX_FLOW_LENGTH = 96
"""Maximum characters of a mapping on one line, in braces; a longer mapping gets a line for each key."""

MAX_WORD_BYTES = 80
"""Maximum length in UTF-8 of a mission's name, a leaf's tag or a variable made from a name of the other program."""


def identifier(text: str) -> str:
    """Return a text in which each character that a name in Python cannot have is replaced by ``_``."""
    return "".join(each if f"_{each}".isidentifier() else "_" for each in normalize("NFKC", text))


def snake_word(text: str, default: str = "") -> str:
    """Return a name of the other program in snake case, as a word of missions; ``default`` if nothing is left of it."""
    parted = re.sub(r"(?<=[A-Z])(?=[A-Z][a-z])", "_", identifier(text))  # "GPSFix" and "CheckAPlan"
    word = re.sub(r"_+", "_", to_snake_case(parted)).strip("_")
    return word.encode()[:MAX_WORD_BYTES].decode(errors="ignore") or default


PLAIN_EXPRESSION = re.compile(r"[A-Za-z_(][^#:\n]*")
"""Expressions that need no quotes in YAML, if they do not look like another value, such as a number."""


@dataclass(frozen=True, slots=True)
class Verbatim:
    """A value that is written to the mission file as it is, without quotes, such as ``150 ms`` or ``forever``."""

    text: str


@dataclass(frozen=True, slots=True)
class Computed:
    """An expression in the place of a value, written as ``"${rooms + 1}"``."""

    text: str


@dataclass(frozen=True, slots=True)
class PlainExpression:
    """An expression in the place where a mission needs one, as after ``if``, written as ``rooms == 6``."""

    text: str


@dataclass(slots=True)
class MissionStep:
    """A node of the mission that is to be written; ``word`` is its composite or leaf.

    - ``value`` is the value behind the word: None, a plain value, a mapping of arguments, or the children.
    - ``keys`` stand beside the word, in this order: ``name``, ``as`` and modifiers, each of which wraps all before it.
    - ``comments`` stand above the node; ``remarks`` are comments behind the lines of its keys.
    - ``reads`` and ``sets`` are the variables that the node itself reads and sets; ``key_reads`` are those of its keys.
    - ``origin`` is the XML element from which the node was made, None without one.
    """

    word: str
    value: object = None
    keys: dict[str, object] = field(default_factory=dict)
    comments: list[str] = field(default_factory=list)
    remarks: dict[str, str] = field(default_factory=dict)
    reads: tuple[str, ...] = ()
    sets: tuple[str, ...] = ()
    key_reads: dict[str, tuple[str, ...]] = field(default_factory=dict)
    origin: object = None

    @property
    def children(self) -> list["MissionStep"]:
        """Steps below this one: its branches, then the steps of its modifiers, such as ``finally`` and ``recover``."""
        return [*self.branches, *(value for value in self.keys.values() if isinstance(value, MissionStep))]

    @property
    def branches(self) -> list["MissionStep"]:
        """Steps in the value of this one, without those of its modifiers."""
        return list(_steps_in(self.value))

    @property
    def has_all_cases(self) -> bool:
        """True for a switch with a branch for each value: a default, or both cases of a condition."""
        value = self.value if isinstance(self.value, dict) else {}
        return "default" in value or set(value.get("cases", ())) >= {"true", "false"}

    def walk(self) -> Iterator["MissionStep"]:
        """Yield this step and all steps below it."""
        yield self
        for child in self.children:
            yield from child.walk()


def _steps_in(value: object) -> Iterator[MissionStep]:
    if isinstance(value, MissionStep):
        yield value
    elif isinstance(value, list):
        for each in value:
            yield from _steps_in(each)
    elif isinstance(value, dict):
        for each in value.values():
            yield from _steps_in(each)


def wrapped(step: MissionStep, key: str, value: object, remark: str = "", reads: tuple[str, ...] = ()) -> MissionStep:
    """Return ``step`` with one more modifier, ``key``; ``remark`` is a comment behind it, ``reads`` are its variables.

    If the step has this modifier already, the result is a sequence around it, with the new modifier.
    """
    if key in step.keys or (key in ("recover", "finally", "in_turn") and step.word == "mission"):
        step = MissionStep("sequence", [step], comments=step.comments)
        step.branches[0].comments = []
    step.keys[key] = value
    if remark:
        step.remarks[key] = remark
    if reads:
        step.key_reads[key] = reads
    return step


def mission_text(
    tree: MissionStep, header: Mapping[str, str], *, comments: Iterable[str] = (), last_comments: Iterable[str] = ()
) -> str:
    """Return the text of a mission file, with the steps of ``tree``.

    ``header`` are the other keys of the file, with their values in YAML. ``comments`` stand at the beginning of the
    file, ``last_comments`` at its end.
    """
    lines = _comment_lines(comments, 0)
    for key, value in header.items():
        if key not in ("returns", "properties"):
            lines += [*([""] if key == "params" else []), f"{key}:{value}"]
    lines += ["", *_entry_lines("tree", tree, 0)]
    lines += [f"{key}:{header[key]}" for key in ("returns", "properties") if key in header]
    ending = _comment_lines(last_comments, 0)
    return "\n".join([*lines, *(["", *ending] if ending else [])]) + "\n"


def params_text(params: Mapping[str, object], remarks: Mapping[str, str]) -> str:
    """Return the params of a mission in YAML, for its header.

    ``params`` has the default or declaration of each param, ``remarks`` the comments behind them.
    """
    items = params.items()
    return "".join(
        f"\n  {yaml_word(name)}: {scalar_text(value)}{_remark(remarks.get(name, ''))}" for name, value in items
    )


def _remark(text: str) -> str:
    return f"  # {' '.join(text.split())}" if text else ""


def _comment_lines(comments: Iterable[str], indent: int) -> list[str]:
    lines = [line.strip() for comment in comments for line in comment.strip("\n").split("\n")]
    return [f"{' ' * indent}# {line}".rstrip() for line in lines if line]


def _step_lines(step: MissionStep, indent: int) -> list[str]:
    """Return the lines of a step as a YAML mapping, with ``indent`` spaces before each."""
    lines = [*_comment_lines(step.comments, indent), *_entry_lines(yaml_word(step.word), step.value, indent)]
    for key in sorted(step.keys, key=lambda key: key not in ("name", "as", "with", "returns")):  # these wrap nothing
        lines += _entry_lines(key, step.keys[key], indent, step.remarks.get(key, ""))
    return lines


def _item_lines(step: MissionStep, indent: int) -> list[str]:
    """Return the lines of a step as an item of a YAML list; its comments stand above the dash."""
    comments, step.comments = step.comments, []
    lines = _step_lines(step, indent + 2)
    step.comments = comments
    first = lines[0][indent + 2 :]
    if len(lines) == 1 and first.endswith(":"):
        first = first.removesuffix(":")  # a word alone
    return [*_comment_lines(comments, indent), f"{' ' * indent}- {first}", *lines[1:]]


def _entry_lines(key: str, value: object, indent: int, remark: str = "") -> list[str]:
    space, behind = " " * indent, _remark(remark)
    if value is None:
        return [f"{space}{key}:{behind}"]
    if isinstance(value, MissionStep):
        if value.value is None and not value.keys and not value.comments:
            return [f"{space}{key}: {yaml_word(value.word)}{behind}"]
        return [f"{space}{key}:{behind}", *_step_lines(value, indent + 2)]
    if isinstance(value, list) and value and all(isinstance(each, MissionStep) for each in value):
        return [f"{space}{key}:{behind}", *(line for each in value for line in _item_lines(each, indent + 2))]
    if isinstance(value, dict):
        return _mapping_lines(key, value, indent, behind)
    if isinstance(value, list):
        return [f"{space}{key}: [{', '.join(scalar_text(each, flow=True) for each in value)}]{behind}"]
    return [f"{space}{key}: {scalar_text(value)}{behind}"]


def _mapping_lines(key: str, value: dict[str | Verbatim, object], indent: int, behind: str) -> list[str]:
    space = " " * indent
    if not any(isinstance(each, MissionStep | dict | list) for each in value.values()):
        inside = ", ".join(f"{_key_text(name)}: {scalar_text(each, flow=True)}" for name, each in value.items())
        line = f"{space}{key}: {{{inside}}}{behind}"
        if len(line) <= MAX_FLOW_LENGTH:
            return [line]
    lines = [f"{space}{key}:{behind}"]
    for name, each in value.items():
        lines += _entry_lines(_key_text(name), each, indent + 2)
    return lines


def _key_text(key: str | Verbatim) -> str:
    if isinstance(key, Verbatim):
        return key.text
    return key if key in ("true", "false", "on") else yaml_word(key)


def scalar_text(value: object, *, flow: bool = False) -> str:
    """Return a value without steps as YAML; ``flow`` is for a value inside braces or brackets."""
    match value:
        case Verbatim(text):
            return text
        case Computed(text):
            return json.dumps(f"${{{text}}}", ensure_ascii=False)
        case PlainExpression(text):
            return _expression_text(text, flow=flow)
        case None:
            return "null"
        case bool():
            return "true" if value else "false"
        case int():
            return str(value)
        case float():
            return str(int(value)) if value == int(value) and abs(value) < 1e15 else repr(value)
        case str():
            return yaml_word(value) if "${" not in value else json.dumps(value.replace("${", "$ {"), ensure_ascii=False)
        case list():
            return f"[{', '.join(scalar_text(each, flow=True) for each in value)}]"
    raise TypeError(f"not a value of a mission: {type(value).__name__}")


def _expression_text(text: str, *, flow: bool) -> str:
    if re.fullmatch(r"[A-Za-z_]\w*", text):
        return text  # a name, true or false
    is_plain = (
        not flow
        and PLAIN_EXPRESSION.fullmatch(text) is not None
        and plain_value(text) == text
        and parse_quantity(text) is None
        and text == text.strip()
    )
    return text if is_plain else json.dumps(text, ensure_ascii=False)
