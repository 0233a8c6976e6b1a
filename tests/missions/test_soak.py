"""The long run that shows leaks: it is sampled from minute to minute, and drawn."""

from pathlib import Path
from xml.etree import ElementTree as ET

from tests.benchmarks.soak import LINES, Soak, drawn


def test_a_long_run_is_sampled_every_minute_and_drawn(tmp_path: Path) -> None:
    soak = Soak(tmp_path, 0.05)
    soak.run()
    assert soak.result == "success"
    assert len(soak.samples) >= 2
    first, last = soak.samples[0], soak.samples[-1]
    assert last[1:3] == first[1:3], "it opens no files and starts no threads as it goes on"
    assert last[3] > first[3], "its record grows"
    plots = ET.fromstring(drawn(soak.samples))  # noqa: S314 - of our own writing
    assert len([each for each in plots.iter() if each.tag.endswith("polyline")]) == len(LINES)
