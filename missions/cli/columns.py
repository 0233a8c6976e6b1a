"""Tables on a terminal: rows of words under their headings, each column as wide as it must be."""

from collections.abc import Sequence


def in_columns(headings: Sequence[str], rows: Sequence[Sequence[str]], *, left: frozenset[str] = frozenset()) -> str:
    """Return lines with the headings above; columns are aligned to the right but those named in ``left``."""
    widths = [max(len(row[number]) for row in (headings, *rows)) for number in range(len(headings))]
    lines = []
    for row in (headings, *rows):
        cells = [
            word.ljust(width) if heading in left else word.rjust(width)
            for word, width, heading in zip(row, widths, headings, strict=True)
        ]
        lines.append("  ".join(cells).rstrip())
    return "\n".join(lines)
