"""Test of a sweep on a Dask cluster: two workers on this machine, in processes of their own."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[4]


@pytest.mark.timeout(180)
def test_a_cluster_makes_the_same_table_survives_its_workers_and_is_missed_when_gone(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "tests.missions.testing.sweep.cluster", str(tmp_path)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=170,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["cluster"] == found["here"]
    assert len(found["here"]) == 12
    assert found["first"] in range(12)
    assert found["killed"] == [[4, "success"], [5, "error"], [6, "success"]]
    message, hint = found["gone"]
    assert message.startswith("dask: no scheduler answers at tcp://127.0.0.1:")
    assert hint.startswith("start one with `dask scheduler`")
