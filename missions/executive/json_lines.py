"""The events of a run as lines of JSON, for other programs."""

import json
from typing import TextIO

from missions.executive.events import Event
from missions.executive.plain import plain


class JsonLines:
    """Writes events to a text file, one JSON object a line, each flushed, so that a killed run keeps its past."""

    def __init__(self, file: TextIO) -> None:
        self._file = file

    def __call__(self, event: Event) -> None:
        """Write one event."""
        self._file.write(json.dumps(event.as_dict(), default=plain, ensure_ascii=False) + "\n")
        self._file.flush()
