"""What a run tells on the terminal, line by line."""

from io import StringIO

import pytest

from missions.cli.live import Watcher
from missions.executive.events import CommandSent, Event, FaultRaised, Logged, Notified


@pytest.mark.parametrize(
    ("event", "line"),
    [
        (CommandSent(1.0, 20, "screen", "face (1.1)", {"mood": "happy"}), "  face: happy"),
        (CommandSent(1.0, 20, "screen", "show (1.2)", {"show": "Hello Anna!"}), "  shows: Hello Anna!"),
        (CommandSent(1.0, 20, "screen", "show (1.2)", {"show": ""}), ""),
        (FaultRaised(0.0, "screen", "online", "screen: the face is at http://127.0.0.1:8391/"),
         "  the face is at http://127.0.0.1:8391/"),
        (FaultRaised(0.0, "base", "online", "base: reports"), ""),
        (FaultRaised(2.0, "base", "offline", "base: no report for 0.5 s", "look at its cable"),
         "   2.0 s  ! base: no report for 0.5 s\n            try: look at its cable"),
        (Logged(1.0, "voice", "Hello"), "  robot: Hello"),
        (Logged(1.0, "person", "Anna: Good day: sunny"), "  Anna: Good day: sunny"),
        (Notified(1.0, 20, "Anna was met"), "  notice: Anna was met"),
    ],
)  # fmt: skip
def test_what_people_want_to_know_is_told(event: Event, line: str) -> None:
    out = StringIO()
    with Watcher(out) as watcher:
        watcher(event)
    assert out.getvalue() == (f"{line}\n" if line else "")
