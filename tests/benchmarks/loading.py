"""What reading and checking a mission costs, against PyYAML's safe loader on the same text, which checks nothing."""

from collections.abc import Iterator

import yaml

from behaviours.catalogue import LEAVES
from config.diagnostics import SourceText
from missions.language.document import check_plan
from tests.benchmarks.table import Row, compare


def text(nodes: int) -> str:
    """Return a mission of about ``nodes`` nodes."""
    branch = "    - selector:\n        - pretend: [failure]\n          name: try\n"
    branch += "        - log: hello\n        - wait: 100 ms\n"
    return "mission: bench\ntree:\n  sequence:\n" + branch * (nodes // 4)


def rows() -> Iterator[Row]:
    """Yield a row for each size."""
    for nodes in (50, 500):
        yield _row(nodes, SourceText("bench.yaml", text(nodes)))


def _row(nodes: int, source: SourceText) -> Row:
    name = f"load and check {nodes} nodes"
    return compare(name, lambda: check_plan(source, LEAVES, {}), lambda: yaml.safe_load(source.text), calls=3, rounds=5)
