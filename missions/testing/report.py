"""Verdicts as people read them, and as other programs do."""

from collections.abc import Sequence

from missions.testing.play import Verdict


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
