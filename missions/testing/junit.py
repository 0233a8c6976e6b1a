"""Verdicts as JUnit XML, which CI services show: a suite for each test file, as Jenkins' schema has it."""

from collections.abc import Iterator, Sequence
from itertools import groupby
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from missions.testing.play import Verdict
from missions.testing.report import failure, in_order


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
