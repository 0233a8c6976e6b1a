"""What was learnt of a robot's delays outlives the run, and a file that is damaged does no harm."""

import os
from pathlib import Path

import pytest

from missions.assembly.lags import ENOUGH, KNOWN, believed, keep, lags_file
from perception.delay import Delay


@pytest.fixture(autouse=True)
def state(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    return tmp_path


def known(seconds: float, *, spread: float = 0.003, pairs: int = ENOUGH) -> Delay:
    delay = Delay(seconds)
    delay.spread, delay.pairs = spread, pairs
    return delay


def test_a_delay_that_is_known_well_is_believed_by_the_next_run() -> None:
    keep("rodney", known(0.042))
    assert believed("rodney", 0.0) == 0.042
    assert believed("another", 0.01) == 0.01
    keep("../../elsewhere/rodney", known(0.05))
    assert not (lags_file("rodney").parents[2] / "elsewhere").exists()
    assert believed("../../elsewhere/rodney", 0.0) == 0.05
    lags_file("../../elsewhere/rodney").unlink()
    assert [path.name for path in lags_file("rodney").parent.iterdir()] == ["rodney.json"]


def test_what_is_hardly_known_is_not_kept() -> None:
    keep("rodney", known(0.042, spread=2 * KNOWN))
    keep("rodney", known(0.042, pairs=ENOUGH - 1))
    assert not lags_file("rodney").exists()


def test_a_file_that_is_damaged_counts_as_none() -> None:
    lags_file("rodney").parent.mkdir(parents=True)
    for text in ("", "{", "[]", "7", '{"camera": "x"}', '{"camera": 9.0}', '{"camera": NaN}', "\x00" * 5000):
        lags_file("rodney").write_text(text)
        assert believed("rodney", 0.02) == 0.02, text
    lags_file("rodney").unlink()
    os.mkfifo(lags_file("rodney"))
    assert believed("rodney", 0.02) == 0.02, "a pipe, which nobody waits for"
