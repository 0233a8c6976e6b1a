"""Makes a storm that breaks something smaller: the fewest faults with which it still does; and writes it as a test."""

from collections.abc import Callable
from dataclasses import fields, replace
from pprint import pformat
from typing import Any

from tests.storm.play import Outcome, play, played_twice
from tests.storm.weather import Weather

SAME = "same_again"
"""What shows only when a weather is played twice."""


def shrunk(outcome: Outcome, told: Callable[[Outcome], object] = lambda _: None) -> Outcome:
    """Return the smallest weather that still breaks one of the invariants that this one breaks.

    Faults are left out one after another, until none can be; then all that is unusual of robot and world.
    """
    wanted = set(outcome.broken)
    again = played_twice if wanted == {SAME} else play

    def tried(weather: Weather) -> bool:
        nonlocal outcome
        found = again(weather)
        if wanted & set(found.broken):
            outcome = found
            told(found)
            return True
        return False

    place = 0
    while place < len(outcome.weather.faults):
        faults = outcome.weather.faults
        if not tried(replace(outcome.weather, faults=faults[:place] + faults[place + 1 :])):
            place += 1
    easier: list[dict[str, Any]] = [
        {"physics": {}},
        {"pace": 1.0},
        {"rate": 20},
        {"world": "empty"},
        {"others": ()},
        {"stop_at": 0},
        {"hangs": 0.0},
        {"alone": False},
        {"limbs": 1.0},
        {"record": ""},
        {"crowd": 0},
    ]
    for each in easier:
        weather = replace(outcome.weather, **each)
        if weather != outcome.weather:
            tried(weather)
    return outcome


def as_test(outcome: Outcome) -> str:
    """Return the text of a test, for pytest, that fails as long as this is broken."""
    weather = outcome.weather
    given = "".join(
        f"        {each.name}={pformat(getattr(weather, each.name), width=100)},\n" for each in fields(weather)
    )
    return (
        f'"""What seed {weather.seed} of the storm has found: {", ".join(outcome.broken)}."""\n\n'
        "from tests.storm.play import played_twice\n"
        "from tests.storm.weather import Weather\n\n\n"
        f"def test_what_seed_{weather.seed}_of_the_storm_has_found() -> None:\n"
        f"    weather = Weather(\n{given}    )\n"
        "    assert played_twice(weather).broken == {}\n"
    )
