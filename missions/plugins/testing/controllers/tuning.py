"""Tuning: a search for the numbers of a controller file with which the simulated robot tracks best.

The search is differential evolution (Storn and Price 1997), as SciPy has it. Needs the extra ``tune``.
"""

from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import degrees, log2
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.optimize import OptimizeResult, differential_evolution

from behaviours.tracking.fuzzy import RuleBases
from config.controller import TunableNumber, parse_controller, replace_words, tunable_numbers
from config.diagnostics import InvalidFileError, Mark, SourceText
from missions.plugins.testing.controllers.bench import Score, score_trial
from missions.plugins.testing.controllers.tracking_trial import SCENARIOS, Scenario, TrackingBody, TrackingTrial

BODY_OF_RULES: Mapping[str, TrackingBody] = {"pan": TrackingBody.HEAD, "turn": TrackingBody.BASE}
"""The rule bases that can be tuned, and the body with which each is tried."""

TUNING_SCENARIOS: Sequence[Scenario] = (SCENARIOS[0], SCENARIOS[1])
"""What they are tried in: the step and the walk."""

FIRST_SEED = 100
"""The first seed of the trials; those of the bench are others, so that nobody learns by heart what is asked."""

MAX_LOG_FACTOR = log2(2.5)
"""A number is changed by a factor of up to 2.5 either way."""

NEVER_CENTRED_COST, LOST_FACE_COST, INVALID_COST = 10.0, 50.0, 1000.0
"""What it costs to be never centred, to lose the face, and to be no controller at all."""


@dataclass(frozen=True, slots=True)
class FigureGroup:
    """Numbers that are changed together: those of one variable that are equal but for their sign."""

    name: str
    figures: tuple[TunableNumber, ...]


@dataclass(frozen=True, slots=True)
class TuningResult:
    """What came of it: the text of the new file, and the costs of the old and the new one."""

    text: str
    before: float
    after: float


class ControllerTuning:
    """The search for the numbers of one rule base of the controller file ``source``.

    Raises InvalidFileError for a file that is none, ValueError for a controller that is wrong or has no such rules.
    """

    def __init__(self, source: SourceText, rules: str) -> None:
        self._source = source
        self._rules = rules
        self._body = BODY_OF_RULES[rules]
        self.groups = figure_groups(source, rules)
        if not self.groups:
            raise ValueError(f"{source.name}: has no numbers under '{rules}' to tune")
        RuleBases.from_mapping(parse_controller(source).values)

    def search(
        self,
        evaluations: int,
        *,
        seed: int,
        on_cost: Callable[[float], object],
        on_better: Callable[[str], object] = lambda _: None,
    ) -> TuningResult:
        """Try about ``evaluations`` variants, and return the best; ``progress`` is told the cost of each.

        ``better`` is told the text of each that is better than all before it, the numbers of today among them.
        """
        size = max(5, min(2 * len(self.groups), evaluations // 4))
        spent: list[float] = []

        def cost(factors: Sequence[float]) -> float:
            found = self.cost(factors)
            if spent and found < min(spent):  # the first are the numbers of today
                on_better(self.text(factors))
            spent.append(found)
            on_cost(found)
            return found

        def enough(intermediate_result: OptimizeResult) -> bool:
            del intermediate_result
            return len(spent) + size > evaluations

        same = [0.0] * len(self.groups)
        result: Any = differential_evolution(
            cost,
            [(-MAX_LOG_FACTOR, MAX_LOG_FACTOR)] * len(self.groups),
            x0=same,
            init=_initial_population(size, len(self.groups), seed),
            maxiter=max(1, evaluations // size),
            callback=enough,
            tol=0.0,
            polish=False,
            rng=seed,
        )
        before = self.cost(same)
        if not result.fun < before:
            return TuningResult(self._source.text, before, before)
        return TuningResult(self.text(result.x), before, float(result.fun))

    def text(self, factors: Sequence[float]) -> str:
        """Return the file with each knob's numbers multiplied by 2 to the power of its factor."""
        changes: dict[Mark, str] = {}
        for knob, factor in zip(self.groups, factors, strict=True):
            for figure in knob.figures:
                changes[figure.mark] = f"{figure.number * 2**factor:.4g} {figure.unit}".rstrip()
        return replace_words(self._source, changes)

    def cost(self, factors: Sequence[float]) -> float:
        """Return how badly the controller does with these factors: the mean over the trials, least is best."""
        try:
            values = parse_controller(SourceText(self._source.name, self.text(factors))).values
            # The other rule bases play no part in the trials, and would only have to be worked out.
            rules = RuleBases.from_mapping({key: values[key] for key in (self._rules, "predict") if key in values})
        except (InvalidFileError, ValueError):
            return INVALID_COST  # terms that no longer overlap, or points that do not rise
        if not self._keeps_order(factors):
            return INVALID_COST  # "left" farther out than "far left" is no longer what the words say
        costs = [
            cost_of(
                score_trial(TrackingTrial(rules, scenario, self._body, seed=FIRST_SEED + n).run(), scenario, self._body)
            )
            for n, scenario in enumerate(TUNING_SCENARIOS)
        ]
        return sum(costs) / len(costs)

    def _keeps_order(self, factors: Sequence[float]) -> bool:
        """Say whether the numbers of each variable still stand in the order in which they stood."""
        order: dict[tuple[str, ...], list[tuple[float, float]]] = defaultdict(list)
        for knob, factor in zip(self.groups, factors, strict=True):
            for figure in knob.figures:
                order[figure.keys[:3]].append((figure.number, figure.number * 2**factor))
        return all(after == sorted(after) for pairs in order.values() for after in [[new for _, new in sorted(pairs)]])


def figure_groups(source: SourceText, rules: str) -> list[FigureGroup]:
    """Return what can be changed of one rule base: mirror images together, so that left and right stay alike."""
    found: dict[tuple[tuple[str, ...], float], list[TunableNumber]] = defaultdict(list)
    for figure in tunable_numbers(source):
        if figure.keys[0] == rules and figure.number:
            found[figure.keys[:3], abs(figure.number)].append(figure)
    return [
        FigureGroup(f"{' '.join(keys[2:] or keys)} {size:g}", tuple(members)) for (keys, size), members in found.items()
    ]


def cost_of(found: Score) -> float:
    """Return what a score costs: times the bound, degrees of overshoot and of error, all about 1 when they are good."""
    if found.rms is None:
        return LOST_FACE_COST
    centred = NEVER_CENTRED_COST if found.ratio is None else min(found.ratio, NEVER_CENTRED_COST)
    return centred + degrees(found.overshoot) + 2 * degrees(found.rms)


def _initial_population(size: int, knobs: int, seed: int) -> npt.NDArray[np.float64]:
    """Return ``size`` sets of factors to begin with, shape (size, knobs): drawn near 0, where the old numbers are."""
    return (
        np.random.default_rng(seed).normal(0.0, MAX_LOG_FACTOR / 3, (size, knobs)).clip(-MAX_LOG_FACTOR, MAX_LOG_FACTOR)
    )
