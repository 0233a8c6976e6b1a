"""What a table costs against the inference that it was made of, and how soon a face is centred against the bound."""

from collections.abc import Iterator
from itertools import cycle
from math import radians

from behaviours.tracking.fuzzy import Controller
from config.controller import load_controller
from config.library import shipped_files
from missions.library.lookups import find_controller
from missions.plugins.testing.controllers.bench import run_bench
from missions.plugins.testing.controllers.tracking_trial import SCENARIOS, TrackingBody
from tests.benchmarks.table import Row, compare

PLACES = [(radians(error), radians(rate)) for error, rate in ((0.3, 5), (-1.7, 20), (4.0, -60), (-30, 0), (2.0, 130))]


def rows() -> Iterator[Row]:
    """Yield the costs, and the times of the step by head and by base."""
    for name, limit in (("face", 0.06), ("mamdani", 0.03)):
        yield _cost(name, limit)
    rules = {name: find_controller(name) for name in ("pd", "mamdani", "face")}
    for row in run_bench(rules, scenarios=SCENARIOS[:1], bodies=(TrackingBody.HEAD, TrackingBody.BASE)):
        if row.score.centred is not None and row.score.ratio is not None:
            limit_of_ours = None if row.controller == "pd" else 1.15
            name = f"{row.scenario.name}, {row.body}: {row.controller}, and the bound"
            yield Row(name, row.score.centred, row.score.bound, row.score.ratio, limit_of_ours)


def _cost(name: str, limit: float) -> Row:
    values = load_controller(shipped_files("controllers")[name]).values["pan"]
    if not isinstance(values, dict):
        raise TypeError(f"controller '{name}': its 'pan' is no rule base")
    direct = Controller.from_mapping(name, values)
    quick = direct.tabulate()
    ours, theirs = cycle(PLACES), cycle(PLACES)
    return compare(
        f"a table of {name}, and its inference", lambda: quick(*next(ours)), lambda: direct(*next(theirs)), bound=limit
    )
