"""Benchmark of face-tracking controllers: every scenario with head, base or both, as a table."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import pairwise
from math import isnan, radians, sqrt

from behaviours.tracking.fuzzy import Controller, RuleBases, controllers
from behaviours.tracking.terms import FuzzySets
from config.controller import ControllerConfig
from drivers.base.limits import BRAKING_RATIO
from missions.plugins.testing.controllers.tracking_trial import (
    BASE_LIMITS,
    HEAD_LIMITS,
    SCENARIOS,
    Scenario,
    TrackingBody,
    TrackingTrace,
    TrackingTrial,
    standing_path,
)

# Score of a trial, and its lower bound.

CENTRED_ERROR = radians(2)
"""Largest error in radians at which the face counts as centred."""

MIN_CENTRED_TIME = 0.5
"""Seconds for which a face must be followed until its motion becomes unforeseeable, to count as centred."""

_TIME_STEP = 0.0005


@dataclass(frozen=True, slots=True)
class Score:
    """Score of a controller in a trial of face tracking.

    ``centred`` is the time in seconds from which the face stayed centred, None if it never did. ``bound`` and ``known``
    are the earliest possible times: ``bound`` if the motion of the face is known from the first picture on, ``known``
    if it must first be observed. ``overshoot`` is the first overshoot and ``rms`` the root mean square error while
    following, both in radians; a ``lost`` face has no ``rms``. ``swings`` counts how often the error changes its sign
    beyond ``CENTRED_ERROR``. ``delay_error`` is the final error of the measured camera delay, None if the delay is
    unknown. ``worst_known`` is its largest error while the delay was known. Both are in seconds.
    """

    centred: float | None
    bound: float
    overshoot: float
    rms: float | None
    lost: bool
    known: float = 0.0
    swings: int = 0
    delay_error: float | None = None
    worst_known: float = 0.0

    @property
    def ratio(self) -> float | None:
        """Time to centre the face, divided by ``bound``."""
        return self.centred / self.bound if self.centred is not None and self.bound > 0 else None

    @property
    def ratio_known(self) -> float | None:
        """Time to centre the face, divided by ``known``, the bound if the motion must first be observed."""
        return self.centred / self.known if self.centred is not None and self.known > 0 else None


@dataclass(frozen=True, slots=True)
class Ability:
    """Maximum angular speed (rad/s) and acceleration (rad/s^2) with which a body turns its camera."""

    speed: float
    acceleration: float
    braking: float


ABILITIES = {
    TrackingBody.HEAD: Ability(HEAD_LIMITS.speed, HEAD_LIMITS.acceleration, HEAD_LIMITS.acceleration),
    TrackingBody.BASE: Ability(
        BASE_LIMITS.max_angular, BASE_LIMITS.angular_acceleration, BRAKING_RATIO * BASE_LIMITS.angular_acceleration
    ),
}


def ability_of(body: TrackingBody) -> Ability:
    """Return the ability of a body; for head and base together, the sums of their speeds and accelerations."""
    if body is not TrackingBody.BOTH:
        return ABILITIES[body]
    head, base = ABILITIES.values()
    return Ability(head.speed + base.speed, head.acceleration + base.acceleration, head.braking + base.braking)


def score_trial(trace: TrackingTrace, scenario: Scenario, body: TrackingBody) -> Score:
    """Return the score of the trial that produced ``trace``."""
    samples = list(zip(trace.times, trace.errors, strict=True))
    foreseen = [(time, error) for time, error in samples if time < scenario.foreseeable_until]
    outside = max((time for time, error in foreseen if abs(error) > CENTRED_ERROR), default=0.0)
    early = [error for time, error in foreseen if time < scenario.settled_from]
    late = [error**2 for time, error in samples if time >= scenario.settled_from]
    can, lag = ability_of(body), scenario.base_lag if body is TrackingBody.BASE else 0.0
    # One picture gives the position of a face; its speed needs two.
    least, picture = time_optimal_bound(scenario, can, lag), 0 if scenario.path is standing_path else 1
    seen = trace.known_times[picture] if len(trace.known_times) > picture else scenario.latency
    return Score(
        centred=None
        if trace.lost or not foreseen or outside >= scenario.foreseeable_until - MIN_CENTRED_TIME
        else outside,
        bound=least,
        overshoot=max(0.0, -min(early, default=0.0)),
        rms=None if trace.lost or not late else sqrt(sum(late) / len(late)),
        lost=trace.lost,
        known=max(least, time_optimal_bound(replace(scenario, latency=seen), can, lag)),
        swings=_swings([error for _, error in foreseen]),
        delay_error=next((error for error in trace.delay_errors[-1:] if not isnan(error)), None),
        worst_known=max((abs(error) for error in trace.delay_errors if not isnan(error)), default=0.0),
    )


def _swings(errors: Sequence[float]) -> int:
    """Return the number of sign changes among the ``errors`` that are larger than ``CENTRED_ERROR``."""
    sides = [error > 0 for error in errors if abs(error) > CENTRED_ERROR]
    return sum(before != after for before, after in pairwise(sides))


def time_optimal_bound(scenario: Scenario, ability: Ability, lag: float = 0.0) -> float:
    """Return the earliest time in seconds from which the camera can be kept within ``CENTRED_ERROR`` of the face.

    A body with this ``ability`` is simulated in its fastest motion. It stands still during the latency and a base's
    ``lag``. Then it accelerates fully, and brakes so that the face is just within the permitted error. The result is 0
    if no motion of the face can be foreseen.
    """
    if scenario.foreseeable_until <= 0.0:
        return 0.0
    time = outside = scenario.latency + lag
    angle = speed = 0.0
    while time < scenario.foreseeable_until:
        target = scenario.path(time)
        rate = (scenario.path(time + _TIME_STEP) - target) / _TIME_STEP
        error, closing = target - angle, speed - rate
        if abs(error) > CENTRED_ERROR:
            outside = time
        elif closing >= 0.0:
            return outside
        if error + CENTRED_ERROR > closing * abs(closing) / (2 * ability.braking):
            speed = min(speed + ability.acceleration * _TIME_STEP, ability.speed)
        else:
            speed = max(speed - ability.braking * _TIME_STEP, rate)
        angle += speed * _TIME_STEP
        time += _TIME_STEP
    return outside


# Description of a controller: its rule bases, with inputs and rules.

UNITS: Mapping[str, tuple[str, float]] = {
    "error": ("deg", math.degrees(1)),
    "pan": ("deg", math.degrees(1)),
    "rate": ("deg/s", math.degrees(1)),
    "edge": ("px", 1.0),
}
"""Display unit of each input of a controller, and the number of display units in one SI unit."""

OUTPUT_UNIT = ("deg/s", math.degrees(1))
"""Display unit of the outputs of controllers, which are rates, and the number of display units in one SI unit."""


def describe_controller(config: ControllerConfig) -> Iterator[str]:
    """Yield the description of a controller, line by line. Raises ValueError for an invalid controller."""
    yield f"{config.name}: {config.summary}"
    yield "acts on the prediction" if config.values.get("predict", True) else "acts on the latest picture"
    fuzzy = controllers(config.values)
    for name, values in config.values.items():
        if name in fuzzy:
            yield ""
            yield from _rule_base_lines(name, fuzzy[name])
        elif isinstance(values, Mapping):
            most = values.get("most", math.inf)
            limit = f", at most {most * OUTPUT_UNIT[1]:.4g} {OUTPUT_UNIT[0]}" if most < math.inf else ""
            yield f"\n{name}: {values['p']:g} times the error and {values['d']:g} times its rate{limit}"


def _rule_base_lines(name: str, controller: Controller) -> Iterator[str]:
    method = "Mamdani" if isinstance(controller.output, FuzzySets) else "Sugeno"
    yield f"{name}: {len(controller.rules)} rules, {method}"
    for variable in controller.inputs:
        unit, scale = UNITS[variable.name]
        terms = ", ".join(
            f"{term} {_term_centre(at.full, at.until) * scale:.4g}"
            for term, at in sorted(variable.terms.items(), key=lambda item: _term_centre(item[1].full, item[1].until))
        )
        yield f"  {variable.name} ({unit}): {terms}"
    for rule in controller.rules:
        yield f"  {rule}"


def _term_centre(full: float, until: float) -> float:
    """Return the middle of a fuzzy term's plateau, which reaches from ``full`` to ``until``.

    For a shoulder (an outermost term, with one infinite end), return the other end.
    """
    if math.isinf(full):
        return until
    return full if math.isinf(until) else (full + until) / 2


DEFAULT_CONTROLLERS = ("course", "pd", "mamdani", "face")
"""Controllers benchmarked by default: the file `course`, a PD controller, and MissionTree's rules.

`course` has the three rules of a robotics course. MissionTree's rules are tried with Mamdani's inference (`mamdani`),
and with the inference that missions use (`face`).
"""

DELAY_CONTROLLERS = ("course", "pd", "pd_ahead", "face")
"""Controllers benchmarked with unknown delays: `pd_ahead` is a PD controller that also uses the prediction.

``NO_MOTION`` is added for comparison.
"""

MAX_DELAY_ERROR = 0.015
"""Error in seconds within which a delay counts as known."""

NO_MOTION = RuleBases.from_mapping({axis: {"p": 0, "d": 0} for axis in ("pan", "tilt", "turn")})
"""Controller that commands no motion."""


@dataclass(frozen=True, slots=True)
class BenchRow:
    """Trace and score of one controller in one scenario with one body."""

    scenario: Scenario
    body: TrackingBody
    controller: str
    trace: TrackingTrace
    score: Score

    def as_dict(self) -> dict[str, object]:
        """Return the row for JSON, in seconds and degrees."""
        found = asdict(self.score) | {"ratio": self.score.ratio, "ratio_known": self.score.ratio_known}
        for name in ("overshoot", "rms"):
            found[name] = None if found[name] is None else math.degrees(found[name])
        return {"scenario": self.scenario.name, "body": str(self.body), "controller": self.controller, **found}


def run_bench(
    controllers: Mapping[str, RuleBases],
    *,
    scenarios: Sequence[Scenario] = SCENARIOS,
    bodies: Sequence[TrackingBody] = tuple(TrackingBody),
    seed: int = 0,
    lag: float = 0.0,
) -> Iterator[BenchRow]:
    """Yield a row for each scenario, body and controller. ``lag`` is the base's assumed lag in seconds."""
    for scenario in scenarios:
        for body in bodies:
            for name, rules in controllers.items():
                trace = TrackingTrial(rules, scenario, body, seed=seed, lag=lag).run()
                yield BenchRow(scenario, body, name, trace, score_trial(trace, scenario, body))


def table_lines(rows: Sequence[BenchRow]) -> Iterator[str]:
    """Yield the lines of the benchmark's table: a block for each scenario and body, a line for each controller."""
    width = max((len(row.controller) for row in rows), default=0)
    yield f"{'':<{width + 2}} {'centred':>9} {'x bound':>8} {'x known':>8} {'overshoot':>10} {'RMS error':>10}"
    block = None
    for row in rows:
        if (row.scenario, row.body) != block:
            block = row.scenario, row.body
            yield f"{row.scenario.name}, {row.body}: bound {row.score.bound:.2f} s"
        yield f"  {row.controller:<{width}} {_score_columns(row.score)}"


def delay_summary(rows: Sequence[BenchRow]) -> Iterator[str]:
    """Yield the lines of a table over several seeds: times to centre the face and RMS errors, as median and worst.

    The times are ratios to the two bounds of a ``Score``: ``bound`` and ``known``.
    """
    names = list(dict.fromkeys(row.controller for row in rows))
    yield f"{'':<24} {'':<5}" + "".join(f" {name:>37}" for name in names)
    blocks: dict[tuple[str, TrackingBody], dict[str, list[Score]]] = {}
    for row in rows:
        blocks.setdefault((row.scenario.name, row.body), {}).setdefault(row.controller, []).append(row.score)
    for (scenario, body), scores in blocks.items():
        yield f"{scenario:<24} {body:<5}" + "".join(f" {_summary_cell(scores[name]):>37}" for name in names)


def stamp_summary(rows: Sequence[BenchRow]) -> Iterator[str]:
    """Yield the lines of a table over several seeds: the measured camera delay, and the resulting tracking.

    The column ``known`` is the share of the seeds whose delay was known at the end, within ``MAX_DELAY_ERROR``;
    ``worst`` is the largest error while it was known (ms).
    """
    yield f"{'':<24} {'':<5} {'':<10} {'known':>7} {'worst':>7} {'centred':>8} {'x bound':>14} {'past':>5} {'RMS':>10}"
    blocks: dict[tuple[str, TrackingBody, str], list[Score]] = {}
    for row in rows:
        blocks.setdefault((row.scenario.name, row.body, row.controller), []).append(row.score)
    for (scenario, body, name), scores in blocks.items():
        of = len(scores)
        known = sum(score.delay_error is not None and abs(score.delay_error) <= MAX_DELAY_ERROR for score in scores)
        worst = 1000 * max(score.worst_known for score in scores)
        ratios = sorted(score.ratio for score in scores if score.ratio is not None)
        errors = sorted(math.degrees(score.rms) for score in scores if score.rms is not None)
        figures = (
            _median_and_worst(ratios, "x", 2) if ratios else "never",
            _median_and_worst(errors, "", 2) if errors else "lost",
        )
        yield (
            f"{scenario:<24} {body:<5} {name:<10} {f'{known}/{of}':>7} {worst:>4.0f} ms {f'{len(ratios)}/{of}':>8} "
            f"{figures[0]:>14} {max(score.swings for score in scores):>5} {figures[1]:>10}"
        )


def _summary_cell(scores: Sequence[Score]) -> str:
    """Return the summary of one controller in a scenario: two ratios and the RMS error in degrees, as median and worst.

    The ratios are ``Score.ratio`` and ``Score.ratio_known``. The number of failures or of lost faces replaces a value
    that some trials lack.
    """
    ratios = sorted(score.ratio for score in scores if score.ratio is not None)
    known = sorted(score.ratio_known for score in scores if score.ratio_known is not None)
    errors = sorted(math.degrees(score.rms) for score in scores if score.rms is not None)
    never, lost = len(scores) - len(ratios), len(scores) - len(errors)
    centred = (
        f"never {never}/{len(scores)}"
        if never
        else f"{_median_and_worst(ratios, 'x', 2)} {_median_and_worst(known, 'x', 2):>12}"
    )
    centred = "" if scores[0].bound == 0 else centred
    return f"{centred:>25} " + (f"lost {lost}/{len(scores)}" if lost else _median_and_worst(errors, "", 1))


def _median_and_worst(sorted_values: Sequence[float], sign: str, digits: int) -> str:
    middle, worst = sorted_values[len(sorted_values) // 2], sorted_values[-1]
    return f"{middle:.{digits}f}{sign} {worst:.{digits}f}{sign}"


def _score_columns(found: Score) -> str:
    centred = "never" if found.centred is None else f"{found.centred:.2f} s"
    ratios = " ".join("        " if found is None else f"{found:8.2f}" for found in (found.ratio, found.ratio_known))
    rms = "lost" if found.rms is None else f"{math.degrees(found.rms):.2f} deg"
    return f"{centred:>9} {ratios} {math.degrees(found.overshoot):6.2f} deg {rms:>10}"
