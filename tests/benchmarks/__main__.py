"""``make bench``: every benchmark, as a table of ratios, and with ``--json`` as one JSON list.

``python -m tests.benchmarks house`` says instead what the house is like: its rooms, arrows, imports and lines.
"""

import json
import sys
from pathlib import Path

from tests.benchmarks import (
    house,
    loading,
    noticing,
    perceiving,
    proxies,
    reacting,
    recording,
    running,
    serving_base,
    servoing,
    simulating,
    sweeping,
    teleoperating,
    ticking,
    tracking,
    waking,
    wandering,
)


def main() -> None:
    """Run the benchmarks; a ``!`` marks a ratio over its bound."""
    as_json = "--json" in sys.argv[1:]
    if not as_json:
        print(f"{'':<44} {'ours':>10} {'theirs':>10} {'ratio':>8}")
    found = []
    for module in (
        ticking,
        proxies,
        waking,
        loading,
        perceiving,
        noticing,
        simulating,
        serving_base,
        sweeping,
        tracking,
        reacting,
        wandering,
        servoing,
        teleoperating,
        recording,
        running,
    ):
        for row in module.rows():
            found.append(row.as_dict())
            if not as_json:
                print(row, flush=True)
    if as_json:
        print(json.dumps(found, indent=2))


if sys.argv[1:2] == ["house"]:
    house.main(*map(Path, sys.argv[2:3]))
else:
    main()
