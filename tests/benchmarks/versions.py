"""A tick, a wake-up, a record and a simulated run beside those of another version, by turns.

    python -m tests.benchmarks.versions FOLDER [ROUNDS]

``FOLDER`` is a working tree of this repository at the other version (``git worktree add``). Each benchmark that both
have runs in a process of each version, in turn; the ratio is the median of the rounds'.
"""

import json
import statistics
import subprocess
import sys
from collections import defaultdict
from pathlib import Path

from tests.benchmarks.table import Row

MODULES = ("ticking", "waking", "recording", "simulating")

ROUNDS = 5

BOUND = 1.05

CHILD = """
import json, sys
from importlib import import_module
rows = import_module("tests.benchmarks." + sys.argv[1]).rows()
print("\\n" + json.dumps({row.name: row.ours for row in rows}))
"""


def measured(folder: Path, module: str) -> dict[str, float]:
    """Return the seconds of each row of a benchmark of the version in ``folder``. Raises CalledProcessError."""
    done = subprocess.run([sys.executable, "-c", CHILD, module], cwd=folder, capture_output=True, text=True, check=True)
    found: dict[str, float] = json.loads(done.stdout.splitlines()[-1])
    return found


def main(folder: Path, rounds: int = ROUNDS) -> None:
    """Print each row that both versions have."""
    here = Path(__file__).parents[2]
    print(f"{'':<44} {'here':>10} {'there':>10} {'ratio':>8}")
    for module in MODULES:
        pairs = defaultdict[str, list[tuple[float, float]]](list)
        for _ in range(rounds):
            now, then = measured(here, module), measured(folder, module)
            for name in now.keys() & then.keys():
                pairs[name].append((now[name], then[name]))
        for name, found in pairs.items():
            ours, theirs = (statistics.median(each[place] for each in found) for place in (0, 1))
            print(Row(name, ours, theirs, statistics.median(one / other for one, other in found), BOUND), flush=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]), *map(int, sys.argv[2:]))
