"""Reports of test cases: text, coverage, coverage page, JSON and JUnit XML."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from html import escape
from itertools import groupby
from os.path import commonpath
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from missions.library.shipped import MISSIONS_FOLDER
from missions.plugins.testing.case_history import NodeRecord
from missions.plugins.testing.case_verdict import CaseVerdict
from missions.plugins.testing.suite import display_path

# Coverage of a mission: ticked nodes, their ends, and failure reasons.

Place = tuple[str, int, str, str]
"""Key of a node: file, line, word and name. A node of a sub-mission counts once, whichever missions run it."""


@dataclass(slots=True)
class NodeCoverage:
    """Coverage of one node: its possible ``ends``, and the ``statuses`` that the test cases have shown."""

    line: int
    kind: str
    name: str
    ends: frozenset[str]
    statuses: set[str] = field(default_factory=set)
    reasons: dict[str, None] = field(default_factory=dict)

    @property
    def was_ticked(self) -> bool:
        """Whether the node was ever ticked, for example as the chosen branch of a selector or switch."""
        return bool(self.statuses - {"idle"})

    @property
    def missing_ends(self) -> list[str]:
        """Possible ends of the node, such as failure, that no test case has shown."""
        return sorted(self.ends - set(self.statuses))

    @property
    def level(self) -> str:
        """Level of coverage: ``all``, ``part`` or ``nothing``."""
        if not self.was_ticked:
            return "nothing"
        return "part" if self.missing_ends else "all"

    def describe_gaps(self) -> str:
        """Return a short text of the missing coverage; empty if it is complete."""
        if not self.was_ticked:
            return "never reached"
        words = {"success": "succeeded", "failure": "failed", "skipped": "skipped"}
        return " or ".join(f"never {words[end]}" for end in self.missing_ends)


@dataclass(slots=True)
class FileCoverage:
    """Coverage of the nodes of one mission file, in the order of its lines."""

    file: str
    nodes: list[NodeCoverage]

    @property
    def ticked_count(self) -> int:
        """Number of nodes of the file that were ticked in any test case."""
        return sum(node.was_ticked for node in self.nodes)

    @property
    def endings(self) -> tuple[int, int]:
        """Numbers of observed and of possible ends of all nodes in the file."""
        possible = sum(len(node.ends) for node in self.nodes)
        return possible - sum(len(node.missing_ends) for node in self.nodes), possible

    def text(self) -> str | None:
        """Text of the mission file; None if it can no longer be read."""
        try:
            return Path(self.file).read_text(encoding="utf-8")
        except OSError:
            return None


def coverage(verdicts: Iterable[CaseVerdict]) -> list[FileCoverage]:
    """Return the coverage of all cases by file, passed or not."""
    found: dict[Place, NodeCoverage] = {}
    for verdict in verdicts:
        for record in verdict.nodes:
            place = (record.file, record.line, record.kind, record.name)
            node = found.setdefault(place, NodeCoverage(record.line, record.kind, record.name, frozenset(record.ends)))
            _add(node, record)
    files: dict[str, list[NodeCoverage]] = {}
    for (file, *_), node in found.items():
        files.setdefault(file, []).append(node)
    return [
        FileCoverage(display_path(Path(file)), sorted(files[file], key=lambda node: node.line))
        for file in sorted(files)
    ]


def _add(node: NodeCoverage, record: NodeRecord) -> None:
    node.statuses |= {status for status, count in record.statuses.items() if count}
    node.reasons |= dict.fromkeys(record.reasons)


def coverage_lines(files: Iterable[FileCoverage]) -> Iterator[str]:
    """Yield the coverage as text: a line for each file, and one for each node with missing coverage."""
    for each in files:
        seen, possible = each.endings
        yield f"{each.file}: {each.ticked_count} of {len(each.nodes)} nodes ticked, {seen} of {possible} endings seen"
        for node in each.nodes:
            if node.describe_gaps():
                name = node.kind if node.kind == node.name else f"{node.kind} '{node.name}'"
                yield f"  {each.file}:{node.line}: {name}: {node.describe_gaps()}"


# Coverage as one self-contained HTML page: every mission with its lines marked.

LEVEL_SIGNS = {"all": "✓", "part": "~", "nothing": "✗"}
"""Sign of each coverage level, in addition to its colour for colour-blind readers."""

STYLE = """
:root { color-scheme: light dark; --ground: #ffffff; --ink: #222222; --soft: #666666; --edge: #dddddd; --link: #1257b0;
        --all: #e6f4e6; --part: #fff4d6; --nothing: #fbe0dd; }
@media (prefers-color-scheme: dark) {
  :root { --ground: #12161b; --ink: #e5e9ee; --soft: #a3aeba; --edge: #343d48; --link: #8cc2ff;
          --all: #14302a; --part: #3a3113; --nothing: #42221f; }
}
body { font: 15px/1.5 system-ui, sans-serif; margin: 2em auto; max-width: 62em; padding: 0 1em; color: var(--ink);
       background: var(--ground); }
a { color: var(--link); }
table { border-collapse: collapse; } td, th { padding: .2em 1em .2em 0; text-align: left; }
pre { border: 1px solid var(--edge); padding: .5em 0; overflow-x: auto; line-height: 1.45; }
pre span { display: block; padding: 0 1em; }
pre b { display: inline-block; width: 5.5em; color: var(--soft); font-weight: 400; }
.all { background: var(--all); } .part { background: var(--part); } .nothing { background: var(--nothing); }
i { color: var(--soft); font-style: normal; }
"""


def coverage_page(files: Sequence[FileCoverage]) -> str:
    """Return an HTML page that marks the covered lines of the mission files."""
    titles = _titles([each.file for each in files])
    rows = "\n".join(
        f'<tr><td><a href="#{number}">{escape(title)}</a></td><td>{each.ticked_count} of {len(each.nodes)}</td>'
        f"<td>{each.endings[0]} of {each.endings[1]}</td></tr>"
        for number, (title, each) in enumerate(zip(titles, files, strict=True))
    )
    parts = "\n".join(
        _file_section(number, escape(title), each)
        for number, (title, each) in enumerate(zip(titles, files, strict=True))
    )
    key = "".join(
        f'<span class="{kind}"> {LEVEL_SIGNS[kind]} {words} </span> '
        for kind, words in (("all", "fully covered"), ("part", "partly covered"), ("nothing", "never reached"))
    )
    return (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>Test coverage</title>'
        f"<style>{STYLE}</style></head><body>\n<h1>Test coverage</h1>\n<p>{key}</p>\n"
        f"<table><tr><th>mission</th><th>nodes ticked</th><th>endings seen</th></tr>\n{rows}\n</table>\n{parts}\n"
        "</body></html>\n"
    )


def _titles(names: Sequence[str]) -> list[str]:
    """Return short titles of files, without the machine's path: from the package or the common folder on."""
    shipped = {name for name in names if Path(name).resolve().is_relative_to(MISSIONS_FOLDER)}
    others = [str(Path(name).resolve().parent) for name in names if name not in shipped]
    common = Path(commonpath(others)) if others else Path()
    return [
        (Path(MISSIONS_FOLDER.name) / Path(name).resolve().relative_to(MISSIONS_FOLDER)).as_posix()
        if name in shipped
        else Path(name).resolve().relative_to(common).as_posix()
        for name in names
    ]


def _file_section(number: int, title: str, each: FileCoverage) -> str:
    by_line: dict[int, list[NodeCoverage]] = {}
    for node in each.nodes:
        by_line.setdefault(node.line, []).append(node)
    text = each.text()
    if text is None:
        return f'<h2 id="{number}">{title}</h2>\n<p>This file can no longer be read.</p>'
    lines = "".join(
        _source_line(place, line, by_line.get(place, [])) for place, line in enumerate(text.splitlines(), start=1)
    )
    return f'<h2 id="{number}">{title}</h2>\n<pre>{lines}</pre>'


def _source_line(number: int, text: str, nodes: Iterable[NodeCoverage]) -> str:
    """Return the HTML of one source line, marked by the lowest coverage of its nodes, with the gaps as text."""
    here = list(nodes)
    if not here:
        return f"<span><b>{number}</b>{escape(text)}</span>"
    order = ("nothing", "part", "all")
    tried = min((node.level for node in here), key=order.index)
    lacks = "; ".join(f"{node.kind} {node.describe_gaps()}" for node in here if node.describe_gaps())
    reasons = "; ".join(reason for node in here for reason in node.reasons)
    title = f' title="{escape(reasons, quote=True)}"' if reasons else ""
    note = f"  <i># {escape(lacks)}</i>" if lacks else ""
    return f'<span class="{tried}"{title}><b>{number} {LEVEL_SIGNS[tried]}</b>{escape(text)}{note}</span>'


def failure_text(verdict: CaseVerdict) -> str:
    """Return the text of a failed case: unmet expectations with their positions, and the last events."""
    lines = [str(verdict.case)]
    for miss in verdict.misses:
        lines += _indent_lines(str(miss))
    lines += _indent_lines(verdict.error.rstrip())
    if verdict.last_events:
        lines.append("  last events:")
        lines += [line for event in verdict.last_events for line in _indent_lines(event)]
    return "\n".join(lines)


def summary_line(verdicts: Sequence[CaseVerdict], *, planned: int, seconds: float) -> str:
    """Return the numbers of passed and failed cases as one line."""
    failed = sum(not verdict.passed for verdict in verdicts)
    simulated = sum(verdict.seconds for verdict in verdicts)
    parts = [f"{len(verdicts) - failed} passed"] + ([f"{failed} failed"] if failed else [])
    if planned > len(verdicts):
        parts.append(f"{planned - len(verdicts)} not run")
    return f"{', '.join(parts)}: {simulated:.0f} s of simulated time in {seconds:.1f} s"


def as_dict(verdict: CaseVerdict) -> dict[str, object]:
    """Return a verdict as plain data; lines and columns count from 1."""
    return {
        "file": verdict.case.source.name,
        "line": verdict.case.mark.line,
        "case": verdict.case.title,
        "mission": verdict.case.mission,
        "passed": verdict.passed,
        "result": verdict.result,
        "reason": verdict.reason,
        "seconds": round(verdict.seconds, 6),
        "ticks": verdict.ticks,
        "failures": [
            {"line": miss.mark.line, "column": miss.mark.column, "message": miss.message} for miss in verdict.misses
        ],
        "error": verdict.error,
        "last": list(verdict.last_events),
    }


def sort_verdicts(verdicts: Sequence[CaseVerdict]) -> list[CaseVerdict]:
    """Return verdicts sorted by test file, and by the position of the case in the file."""
    return sorted(verdicts, key=lambda verdict: (verdict.case.source.name, verdict.case.mark))


def _indent_lines(text: str) -> list[str]:
    return [f"  {line}" for line in text.splitlines()]


# Verdicts as JUnit XML, which CI services show: a suite for each test file, as Jenkins' schema has it.


def junit(verdicts: Sequence[CaseVerdict]) -> bytes:
    """Return the JUnit XML in UTF-8; times are in seconds of real time."""
    root = Element("testsuites", _junit_counts(verdicts))
    for name, group in groupby(sort_verdicts(verdicts), key=lambda verdict: verdict.case.source.name):
        cases = list(group)
        suite = SubElement(root, "testsuite", {"name": name, **_junit_counts(cases)})
        for verdict in cases:
            _add_case(suite, name, verdict)
    indent(root)
    text: str = tostring(root, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n'.encode()


def _add_case(suite: Element, name: str, verdict: CaseVerdict) -> None:
    attributes = {"name": verdict.case.title, "classname": name, "time": f"{verdict.wall_seconds:.3f}"}
    case = SubElement(suite, "testcase", {key: _replace_illegal(value) for key, value in attributes.items()})
    if verdict.passed:
        return
    message = verdict.misses[0].message if verdict.misses else verdict.error.strip().splitlines()[-1]
    kind = "error" if verdict.error else "failure"
    SubElement(case, kind, {"message": _replace_illegal(message), "type": kind}).text = _replace_illegal(
        failure_text(verdict)
    )


def _junit_counts(verdicts: Sequence[CaseVerdict]) -> dict[str, str]:
    errors = sum(bool(verdict.error) for verdict in verdicts)
    failures = sum(not verdict.passed for verdict in verdicts) - errors
    seconds = sum(verdict.wall_seconds for verdict in verdicts)
    return {
        "tests": str(len(verdicts)),
        "failures": str(failures),
        "errors": str(errors),
        "time": f"{seconds:.3f}",
    }


def _replace_illegal(text: str) -> str:
    """Replace the characters that XML 1.0 forbids: most control codes, and unpaired surrogates."""
    return "".join(_legal_characters(text))


def _legal_characters(text: str) -> Iterator[str]:
    for sign in text:
        code = ord(sign)
        allowed = code in {9, 10, 13} or 0x20 <= code <= 0xD7FF or 0xE000 <= code <= 0xFFFD or code >= 0x10000
        yield sign if allowed else "\ufffd"
