"""Search for the numbers of a controller file with which the simulated robot tracks best.

The search is differential evolution (Storn and Price 1997), from SciPy. Needs the extra ``tune``.
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
"""Rule bases that can be tuned, and the body on which each is tried."""

TUNING_SCENARIOS: Sequence[Scenario] = (SCENARIOS[0], SCENARIOS[1])
"""Scenarios of the search: the step and the walk."""

FIRST_SEED = 100
"""First seed of the tuning trials. The benchmark uses other seeds, so that tuning cannot overfit to them."""

MAX_LOG_FACTOR = log2(2.5)
"""Base-2 logarithm of the largest factor by which tuning changes a number: 2.5 times larger or smaller."""

NEVER_CENTRED_COST, LOST_FACE_COST, INVALID_COST = 10.0, 50.0, 1000.0
"""Costs of never centring the face, of losing it, and of an invalid controller."""


@dataclass(frozen=True, slots=True)
class FigureGroup:
    """Numbers of a controller that are tuned together: those of one variable that are equal except for their sign."""

    name: str
    figures: tuple[TunableNumber, ...]


@dataclass(frozen=True, slots=True)
class TuningResult:
    """Result of tuning: text of the new controller file, and the costs before and after."""

    text: str
    before: float
    after: float


class ControllerTuning:
    """Search for the numbers of one rule base of the controller file ``source``.

    Raises InvalidFileError for an invalid file, ValueError for an invalid controller or one without this rule base.
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
        """Try about ``evaluations`` variants and return the best; ``on_cost`` gets the cost of each.

        ``on_better`` gets the text of each new best variant, beginning with the current numbers.
        """
        size = max(5, min(2 * len(self.groups), evaluations // 4))
        spent: list[float] = []

        def cost(factors: Sequence[float]) -> float:
            found = self.cost(factors)
            if spent and found < min(spent):  # the first are the current numbers
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
        """Return the file with each group's numbers multiplied by 2 to the power of its factor."""
        changes: dict[Mark, str] = {}
        for knob, factor in zip(self.groups, factors, strict=True):
            for figure in knob.figures:
                changes[figure.mark] = f"{figure.number * 2**factor:.4g} {figure.unit}".rstrip()
        return replace_words(self._source, changes)

    def cost(self, factors: Sequence[float]) -> float:
        """Return the mean cost of the trials with these factors; lower is better."""
        try:
            values = parse_controller(SourceText(self._source.name, self.text(factors))).values
            # The other rule bases are not used in the trials; computing them would cost time.
            rules = RuleBases.from_mapping({key: values[key] for key in (self._rules, "predict") if key in values})
        except (InvalidFileError, ValueError):
            return INVALID_COST  # disjoint terms, or corners out of order
        if not self._keeps_order(factors):
            return INVALID_COST  # "left" must not be farther out than "far left"
        costs = [
            cost_of(
                score_trial(TrackingTrial(rules, scenario, self._body, seed=FIRST_SEED + n).run(), scenario, self._body)
            )
            for n, scenario in enumerate(TUNING_SCENARIOS)
        ]
        return sum(costs) / len(costs)

    def _keeps_order(self, factors: Sequence[float]) -> bool:
        """Return whether the numbers of each variable stay in their order when they are multiplied by ``factors``."""
        order: dict[tuple[str, ...], list[tuple[float, float]]] = defaultdict(list)
        for knob, factor in zip(self.groups, factors, strict=True):
            for figure in knob.figures:
                order[figure.keys[:3]].append((figure.number, figure.number * 2**factor))
        return all(after == sorted(after) for pairs in order.values() for after in [[new for _, new in sorted(pairs)]])


def figure_groups(source: SourceText, rules: str) -> list[FigureGroup]:
    """Return the groups of numbers of one rule base; mirrored numbers share a group, so left and right stay alike."""
    found: dict[tuple[tuple[str, ...], float], list[TunableNumber]] = defaultdict(list)
    for figure in tunable_numbers(source):
        if figure.keys[0] == rules and figure.number:
            found[figure.keys[:3], abs(figure.number)].append(figure)
    return [
        FigureGroup(f"{' '.join(keys[2:] or keys)} {size:g}", tuple(members)) for (keys, size), members in found.items()
    ]


def cost_of(found: Score) -> float:
    """Return the cost of a score; lower is better.

    It is the sum of the ratio of the centring time to its bound, the overshoot in degrees, and twice the RMS error in
    degrees; each is about 1 if it is good.
    """
    if found.rms is None:
        return LOST_FACE_COST
    centred = NEVER_CENTRED_COST if found.ratio is None else min(found.ratio, NEVER_CENTRED_COST)
    return centred + degrees(found.overshoot) + 2 * degrees(found.rms)


def _initial_population(size: int, knobs: int, seed: int) -> npt.NDArray[np.float64]:
    """Return ``size`` random sets of factors for the search, as an array of shape (size, knobs).

    ``knobs`` is the number of groups to tune. The factors are base-2 logarithms; 0 leaves a number unchanged.
    """
    return (
        np.random.default_rng(seed).normal(0.0, MAX_LOG_FACTOR / 3, (size, knobs)).clip(-MAX_LOG_FACTOR, MAX_LOG_FACTOR)
    )
