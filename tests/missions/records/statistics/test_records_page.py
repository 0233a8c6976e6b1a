"""The page about records names every topic with its schema."""

import re
from pathlib import Path

from missions.plugins.records.recording.writer import TOPIC_SCHEMAS

PAGE = Path(__file__).parents[4] / "docs" / "records.md"


def test_page_lists_all_record_topics() -> None:
    rows = re.findall(r"^\| `(/[\w/]+)` \| `([\w.]+)` \|", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    assert dict(rows) == dict(TOPIC_SCHEMAS)
