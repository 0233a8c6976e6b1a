"""What the pictures that are text say of a node: a few short texts, on one line or below each other."""

from collections.abc import Iterator, Mapping

from missions.views.pictures.drawing import SIGNS, Badge, Box, Drawing, Status


class Labels:
    """The words for the nodes of a drawing. Where it shows a moment of a run, statuses come first, as ``signs``."""

    def __init__(self, drawing: Drawing, signs: Mapping[Status, str] = SIGNS) -> None:
        self._file = drawing.file
        self._live = drawing.time is not None
        self._signs = signs

    def box(self, box: Box) -> tuple[str, ...]:
        """Return title, arguments, the variable that keeps the result, the line of the file, and how it stands."""
        arguments = ", ".join(f"{name}: {text}" for name, text in box.untold.items())
        texts = (
            self.sign(box.status) + box.title,
            f"{{{arguments}}}" if arguments else "",
            f"as {box.keep_as}" if box.keep_as else "",
            self._place(box.file, box.line),
            f"and {box.folded} more below" if box.folded else "",
            *self._state(box.status, box.since, box.reason),
        )
        return tuple(filter(None, texts))

    def badge(self, box: Box, badge: Badge) -> tuple[str, ...]:
        """Return the same of a modifier of ``box``."""
        texts = (
            f"{self.sign(badge.status)}{badge.kind}: {badge.text}",
            self._place(box.file, badge.line),
            *self._state(badge.status, None, badge.reason),
        )
        return tuple(filter(None, texts))

    def sign(self, status: Status) -> str:
        """Return what a label begins with: the sign of the status, with a blank, or nothing in a mission at rest."""
        return f"{self._signs[status]} " if self._live else ""

    def _place(self, file: str, line: int) -> str:
        return f"(line {line})" if file == self._file else f"({file}:{line})"

    def _state(self, status: Status, since: float | None, reason: str) -> Iterator[str]:
        if since is not None and status != "idle":
            yield f"since {since:.2f} s"
        if reason:
            yield f"-- {reason}"
