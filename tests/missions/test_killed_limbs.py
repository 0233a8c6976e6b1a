"""Whatever becomes of the program that moves them, arm and head come to rest: here it is killed, or stopped."""

from pathlib import Path

import pytest

from tests.missions.killing import WITHIN, campaign

pytestmark = [pytest.mark.real_time, pytest.mark.long]

KINDS = ("move", "mirror", "head sweep", "feetech sweep")
"""What is tried here; ``python -m tests.benchmarks.killing`` tries everything that moves limbs, 200 times."""


def test_a_process_killed_or_stopped_at_any_moment_leaves_arm_and_head_at_rest(tmp_path: Path) -> None:
    with campaign(tmp_path, KINDS) as trials:
        silences = [silence for way in ("kill", "stop") for silence in trials.round(way)]
    assert len(silences) == 2 * len(KINDS)
    late = [silence for silence in silences if silence.took > WITHIN]
    assert late == []
    assert any(silence.moving for silence in silences), "nothing was tried: all had come to rest by themselves"
