"""Summary of a sweep as a plain-text table."""

from collections.abc import Callable, Iterator, Sequence

from missions.plugins.testing.sweep.summary import Rate, Summary
from missions.plugins.testing.sweep.variation import SweepRow


def report(summary: Summary, describe_run: Callable[[SweepRow], Sequence[str]]) -> str:
    """Return a sweep's table; ``describe_run`` returns a run's drawn values and the command that repeats the run."""
    parts = [_overall(summary), _causes(summary), *_variation_tables(summary), _worst(summary.worst, describe_run)]
    return "\n\n".join("\n".join(part) for part in parts if part)


def percent(share: float) -> str:
    """Return a share (0..1) as a percentage: "93.4 %"."""
    return f"{100 * share:.1f} %"


def interval(rate: Rate) -> str:
    """Return a confidence interval as text: 91.7 to 94.8 %."""
    low, high = rate.interval
    return f"{100 * low:.1f} to {100 * high:.1f} %"


def _overall(summary: Summary) -> list[str]:
    rate, times = summary.rate, summary.times
    lines = [f"success   {percent(rate.share)}   ({rate.successes} of {rate.runs}; 95 % interval {interval(rate)})"]
    if times is not None:
        middle = f"median {times.median:.1f} s, 5 % below {times.p5:.1f} s, 5 % above {times.p95:.1f} s"
        lines.append(f"time      {middle}, longest {times.longest:.1f} s   (simulated, of the successes)")
    return lines


def _causes(summary: Summary) -> list[str]:
    rows = [(cause.text, str(cause.runs), str(cause.seed)) for cause in summary.causes]
    return _table(("causes of failure", "runs", "first seed"), rows) if rows else []


def _variation_tables(summary: Summary) -> Iterator[list[str]]:
    for title, bins in summary.bins.items():
        rows = [
            (
                each.label,
                str(each.rate.runs),
                *((percent(each.rate.share), interval(each.rate)) if each.rate.runs else ("", "")),
            )
            for each in bins
        ]
        yield _table((title, "runs", "success", "95 % interval"), rows)


def _worst(rows: Sequence[SweepRow], again: Callable[[SweepRow], Sequence[str]]) -> list[str]:
    lines = ["the worst runs, and the commands that repeat them"]
    for row in rows:
        reason = f": {row.reason}" if row.reason else ""
        lines.append(f"  seed {row.seed}: {row.result} after {row.seconds:.1f} s{reason}")
        lines += [f"    {line}" for line in again(row) if line]
    return lines if rows else []


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Return the lines of a table with aligned columns: the first column to the left, all others to the right."""
    widths = [max(len(row[column]) for row in (head, *rows)) for column in range(len(head))]
    return [
        "   ".join(
            text.ljust(width) if column == 0 else text.rjust(width)
            for column, (text, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in (head, *rows)
    ]
