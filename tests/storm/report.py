"""Tables of a storm: how often each fault struck, which promises broke, and the command that repeats it."""

from collections import Counter
from collections.abc import Sequence

from config.units import with_article
from tests.storm.invariants import INVARIANTS
from tests.storm.play import AGAIN, Outcome

OTHERS = {
    "same_again": f"the same seed gives the same events, to the byte (every {AGAIN}th seed)",
    "raises": "no mission and no fault raises out of a run",
}
"""What is looked at beside the invariants of one run."""


def struck(outcomes: Sequence[Outcome]) -> Counter[str]:
    """Return how often each fault struck."""
    return sum((Counter(each.struck) for each in outcomes), Counter[str]())


def report(outcomes: Sequence[Outcome], wall: float) -> str:
    """Return the tables for people."""
    failed = [each for each in outcomes if each.broken]
    ends = Counter(each.result or "none" for each in outcomes)
    simulated = sum(each.seconds for each in outcomes)
    lines = [
        f"{len(outcomes)} seeds, {simulated / 3600:.1f} simulated hours in {wall:.0f} s; "
        + ", ".join(f"{count} {end}" for end, count in ends.most_common()),
        "",
        "what struck",
        *(f"  {count:7}  {what}" for what, count in struck(outcomes).most_common()),
        "",
        "what must hold",
    ]
    for name, about in {**{name: about for name, (about, _) in INVARIANTS.items()}, **OTHERS}.items():
        count = sum(name in each.broken for each in outcomes)
        lines.append(f"  {f'{count} broke' if count else 'held':>9}  {name}: {about}")
    for each in failed:
        for name, what in each.broken.items():
            lines.append(f"\nseed {each.weather.seed} breaks {name}: {what.strip().splitlines()[-1]}")
        lines.append(f"  try: python -m tests.storm --seed {each.weather.seed} --shrink")
    return "\n".join(lines)


def schedule(outcome: Outcome) -> str:
    """Return what one seed stands for, and what came of it."""
    weather = outcome.weather
    world = ", ".join((weather.world, *(f"{name} {value:g}" for name, value in weather.physics.items())))
    others = "".join(f" with {with_article(name)}" for name in weather.others)
    robot = f"{weather.robot}{others}, {weather.pace:.0%} of its speed, {weather.rate} Hz"
    return "\n".join(
        [
            f"seed {weather.seed}: {robot}; {world}; eyes: {weather.eyes}; {weather.seconds:g} s at most",
            *(f"  {line}" for line in weather.mission.splitlines()),
            "what goes wrong" if weather.faults or weather.stop_at else "nothing goes wrong",
            *(f"  {words}" for words in weather.faults),
            *([f"  run stopped in command {weather.stop_at} for {weather.stop_for:g} s"] if weather.stop_at else []),
            f"it ends after {outcome.seconds:.2f} s: {outcome.result}"
            + (f", {outcome.reason}" if outcome.reason else ""),
            *(f"  breaks {name}: {what}" for name, what in outcome.broken.items()),
        ]
    )
