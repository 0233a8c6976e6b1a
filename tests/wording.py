"""Check the wording of packages, docs and names: ``python -m tests.wording [PATH ...]``, part of ``make check``.

``wording.toml`` beside this module holds the word list with replacements, the packages that are checked, and the
exceptions. Without a path, all of these packages and the pages of the docs are checked.
"""

import ast
import re
import sys
import tomllib
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[1]
SETTINGS = Path(__file__).with_suffix(".toml")
MAX_SENTENCE_WORDS = 25
MAX_LINE_LENGTH = 100
PRONOUN_START = re.compile(r"(What|Who|Whom|Whose|One (?:that|who|which|is|has)|It|That|Those|They|So)\b")


@dataclass(frozen=True)
class Slip:
    """Place of a sentence or name that breaks a rule, with the rule."""

    path: str
    line: int
    subject: str
    rule: str

    def __str__(self) -> str:
        return f"{self.path}:{self.line}: {self.subject}: {self.rule}"


@dataclass(frozen=True)
class Rules:
    """Settings of the check, read from ``wording.toml``."""

    packages: tuple[str, ...]
    words: Mapping[re.Pattern[str], str]
    message_words: Mapping[re.Pattern[str], str]
    participles: frozenset[str]
    exceptions: frozenset[str]

    @classmethod
    def read(cls, path: Path = SETTINGS) -> "Rules":
        """Return the rules of a TOML file."""
        data = tomllib.loads(path.read_text(encoding="utf-8"))
        return cls(
            tuple(data["packages"]),
            _compile_words(data["words"]),
            _compile_words(data["message_words"]),
            frozenset(data["participles"]),
            frozenset(data["exceptions"]),
        )


def _compile_words(table: Mapping[str, str]) -> dict[re.Pattern[str], str]:
    return {re.compile(rf"\b(?:{word})\b", re.IGNORECASE): replacement for word, replacement in table.items()}


def split_name(name: str) -> list[str]:
    """Return the words of an identifier, in lower case."""
    return [word.lower() for word in re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|\d+", name)]


def docstrings(tree: ast.Module) -> Iterator[tuple[int, str, str]]:
    """Yield line, qualified name and text of each docstring, those of attributes included."""
    pending: list[tuple[str, ast.AST]] = [("", tree)]
    while pending:
        prefix, owner = pending.pop()
        body: list[ast.stmt] = getattr(owner, "body", [])
        for index, node in enumerate(body):
            if not isinstance(node, ast.Expr) or not isinstance(node.value, ast.Constant):
                name = f"{prefix}.{getattr(node, 'name', '')}".strip(".")
                pending.append((name, node))
                pending += [(prefix, each) for each in getattr(node, "orelse", []) if hasattr(each, "body")]
            elif isinstance(node.value.value, str):
                previous = body[index - 1] if index else None
                target = getattr(previous, "target", None) or next(iter(getattr(previous, "targets", [])), None)
                attribute = getattr(target, "id", "") if index else ""
                yield node.lineno, f"{prefix}.{attribute}".strip(".") or "module", node.value.value


def messages(tree: ast.Module) -> Iterator[tuple[int, str]]:
    """Yield line and text of the literal parts of errors, hints and printed lines."""
    for node in ast.walk(tree):
        calls = [node.exc] if isinstance(node, ast.Raise) and node.exc is not None else []
        if isinstance(node, ast.Call):
            name = getattr(node.func, "attr", getattr(node.func, "id", ""))
            calls += [node] if name in {"echo", "secho", "Fault", "Finding"} else []
            calls += [each.value for each in node.keywords if each.arg in {"hint", "help", "problem"}]
        for call in calls:
            for part in ast.walk(call):
                if isinstance(part, ast.Constant) and isinstance(part.value, str) and " " in part.value:
                    yield part.lineno, part.value


def _text_slips(path: str, line: int, subject: str, text: str, words: Mapping[re.Pattern[str], str]) -> Iterator[Slip]:
    plain = re.sub(r"``?[^`]*``?", "", text)
    for pattern, replacement in words.items():
        if match := pattern.search(plain):
            yield Slip(path, line, subject, f"'{match[0]}': {replacement}")


def code_slips(path: str, source: str, rules: Rules) -> Iterator[Slip]:
    """Yield the slips of one module: docstrings, messages, names of classes and functions."""
    tree = ast.parse(source)
    for line, subject, text in docstrings(tree):
        yield from _text_slips(path, line, subject, text, rules.words)
        if match := PRONOUN_START.match(text):
            yield Slip(path, line, subject, f"begins with '{match[0]}': name the thing")
    for line, text in messages(tree):
        yield from _text_slips(path, line, f"message {text[:40]!r}", text, rules.message_words)
    for node in ast.walk(tree):
        if (
            isinstance(node, ast.ClassDef)
            and split_name(node.name)[-1:]
            and split_name(node.name)[-1] in rules.participles
        ):
            yield Slip(path, node.lineno, node.name, "ends with a participle or pronoun: a class is a noun")
        elif (
            isinstance(node, ast.FunctionDef)
            and split_name(node.name)[:1]
            and split_name(node.name)[0] in rules.participles
        ):
            yield Slip(path, node.lineno, node.name, "begins with a participle: a function is a verb phrase")


def class_doubles(sources: Mapping[str, str]) -> Iterator[Slip]:
    """Yield each public class whose name another class has as well."""
    places: dict[str, list[tuple[str, int]]] = defaultdict(list)
    for path, source in sources.items():
        for node in ast.walk(ast.parse(source)):
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                places[node.name].append((path, node.lineno))
    for name, found in places.items():
        for path, line in found[1:]:
            yield Slip(path, line, name, f"a class of {found[0][0]} has this name: add a prefix")


def page_slips(path: str, text: str) -> Iterator[Slip]:
    """Yield long lines and long sentences of a Markdown page; code, tables and headings are left out."""
    fenced = False
    paragraph: list[str] = []
    start = 0
    for number, line in enumerate([*text.splitlines(), ""], 1):
        if line.lstrip().startswith("```"):
            fenced = not fenced
        prose = not fenced and not re.match(r"\s*(\||#|<|!|```)", line)
        if prose and len(line) > MAX_LINE_LENGTH and not re.search(r"\]\([^)]*\)\S*$|https?://\S+$", line):
            yield Slip(path, number, "line", f"{len(line)} characters: at most {MAX_LINE_LENGTH}")
        starts_item = re.match(r"\s*([-*]|\d+\.)\s", line)
        if prose and line.strip() and not starts_item:
            start = start if paragraph else number
            paragraph.append(line.strip())
            continue
        yield from _sentence_slips(path, start, " ".join(paragraph))
        paragraph, start = ([line.strip()], number) if starts_item and prose else ([], number)


def _sentence_slips(path: str, line: int, paragraph: str) -> Iterator[Slip]:
    for sentence in re.split(r"(?<=[.!?:])\s+", paragraph):
        if (count := len(sentence.split())) > MAX_SENTENCE_WORDS:
            yield Slip(path, line, f"sentence '{sentence[:40]}...'", f"{count} words: at most {MAX_SENTENCE_WORDS}")


def _files(paths: Iterable[str], suffix: str) -> Iterator[Path]:
    for path in paths:
        found = ROOT / path
        yield from sorted(found.rglob(f"*{suffix}")) if found.is_dir() else [found] if found.suffix == suffix else []


def find_slips(paths: Iterable[str], rules: Rules) -> list[Slip]:
    """Return the slips of all modules and pages below ``paths``, except the listed exceptions."""
    paths = list(paths)
    sources = {str(path.relative_to(ROOT)): path.read_text(encoding="utf-8") for path in _files(paths, ".py")}
    pages = {str(path.relative_to(ROOT)): path.read_text(encoding="utf-8") for path in _files(paths, ".md")}
    found = [slip for path, source in sources.items() for slip in code_slips(path, source, rules)]
    found += [*class_doubles(sources)]
    found += [slip for path, text in pages.items() for slip in page_slips(path, text)]
    return [slip for slip in found if f"{slip.path} {slip.subject}" not in rules.exceptions]


def main(arguments: list[str]) -> int:
    """Print the slips; return 1 if there is one."""
    rules = Rules.read()
    found = find_slips(arguments or rules.packages, rules)
    print("\n".join(map(str, found)) or "wording: no slips")  # noqa: T201 - this is a program
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
