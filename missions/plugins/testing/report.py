"""Verdicts as people read them, and as other programs do."""

from collections.abc import Iterator, Sequence
from itertools import groupby
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from missions.plugins.testing.play import Verdict


def failure(verdict: Verdict) -> str:
    """Say of a case that has failed what did not come true and where, and what happened last."""
    lines = [str(verdict.case)]
    for miss in verdict.misses:
        lines += _indented(str(miss))
    lines += _indented(verdict.error.rstrip())
    if verdict.last:
        lines.append("  what happened last:")
        lines += [line for event in verdict.last for line in _indented(event)]
    return "\n".join(lines)


def total(verdicts: Sequence[Verdict], *, planned: int, seconds: float) -> str:
    """Say how all of it went, in one line."""
    failed = sum(not verdict.passed for verdict in verdicts)
    simulated = sum(verdict.seconds for verdict in verdicts)
    parts = [f"{len(verdicts) - failed} passed"] + ([f"{failed} failed"] if failed else [])
    if planned > len(verdicts):
        parts.append(f"{planned - len(verdicts)} not played")
    return f"{', '.join(parts)}: {simulated:.0f} s of simulated time in {seconds:.1f} s"


def as_dict(verdict: Verdict) -> dict[str, object]:
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
        "last": list(verdict.last),
    }


def in_order(verdicts: Sequence[Verdict]) -> list[Verdict]:
    """Return verdicts in the order of the files, whichever came first."""
    return sorted(verdicts, key=lambda verdict: (verdict.case.source.name, verdict.case.mark))


def _indented(text: str) -> list[str]:
    return [f"  {line}" for line in text.splitlines()]


# Verdicts as JUnit XML, which CI services show: a suite for each test file, as Jenkins' schema has it.


def junit(verdicts: Sequence[Verdict]) -> bytes:
    """Return the XML, in UTF-8; times are seconds of real time."""
    root = Element("testsuites", _figures(verdicts))
    for name, group in groupby(in_order(verdicts), key=lambda verdict: verdict.case.source.name):
        cases = list(group)
        suite = SubElement(root, "testsuite", {"name": name, **_figures(cases)})
        for verdict in cases:
            _case(suite, name, verdict)
    indent(root)
    text: str = tostring(root, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n'.encode()


def _case(suite: Element, name: str, verdict: Verdict) -> None:
    attributes = {"name": verdict.case.title, "classname": name, "time": f"{verdict.wall:.3f}"}
    case = SubElement(suite, "testcase", {key: _legal(value) for key, value in attributes.items()})
    if verdict.passed:
        return
    told = verdict.misses[0].message if verdict.misses else verdict.error.strip().splitlines()[-1]
    kind = "error" if verdict.error else "failure"
    SubElement(case, kind, {"message": _legal(told), "type": kind}).text = _legal(failure(verdict))


def _figures(verdicts: Sequence[Verdict]) -> dict[str, str]:
    errors = sum(bool(verdict.error) for verdict in verdicts)
    failures = sum(not verdict.passed for verdict in verdicts) - errors
    seconds = sum(verdict.wall for verdict in verdicts)
    return {
        "tests": str(len(verdicts)),
        "failures": str(failures),
        "errors": str(errors),
        "time": f"{seconds:.3f}",
    }


def _legal(text: str) -> str:
    """Replace what XML 1.0 cannot hold, escaped or not: most control codes, and half of a pair."""
    return "".join(_legal_ones(text))


def _legal_ones(text: str) -> Iterator[str]:
    for sign in text:
        code = ord(sign)
        allowed = code in {9, 10, 13} or 0x20 <= code <= 0xD7FF or 0xE000 <= code <= 0xFFFD or code >= 0x10000
        yield sign if allowed else "\ufffd"
