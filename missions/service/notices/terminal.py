"""Notices on the terminal of the server."""

from collections.abc import Callable

from missions.service.notice import Notice


class Terminal:
    """Prints a line for each notice."""

    def __init__(self, print_line: Callable[[str], None]) -> None:
        self._print = print_line

    def __call__(self, notice: Notice) -> None:
        """Print it. Raises OSError where the terminal has gone."""
        self._print(f"{notice.time[:19]}  {notice.text}" + ("" if notice.kind != "said" else f"  (task {notice.task})"))
