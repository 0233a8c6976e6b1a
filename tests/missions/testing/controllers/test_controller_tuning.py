"""Tuning: what is changed, what a variant costs, and that the search finds better ones, the same ones each time."""

import pytest

from config.controller import parse_controller
from config.diagnostics import InvalidFileError, SourceText
from config.library import shipped_files
from config.yaml_nodes import read_source
from missions.plugins.testing.controllers.bench import Score
from missions.plugins.testing.controllers.tuning import (
    INVALID_COST,
    LOST_FACE_COST,
    ControllerTuning,
    TuningResult,
    cost_of,
    figure_groups,
)

FACE = read_source(shipped_files("controllers")["face"])
WEAK = SourceText(
    "weak.yaml",
    "# By hand.\ncontroller: weak\nsummary: Far too gentle.\nturn: {p: 1.2, d: 0.1, most: 110 deg/s}\npredict: false\n",
)


def tuned(evaluations: int, seed: int = 3) -> tuple[TuningResult, list[float]]:
    costs: list[float] = []
    return ControllerTuning(WEAK, "turn").search(evaluations, seed=seed, on_cost=costs.append), costs


def test_left_and_right_are_changed_together() -> None:
    found = figure_groups(FACE, "pan")
    assert [knob.name for knob in found] == [
        "error 6", "error 2", "rate 120", "rate 40", "pan_rate 120", "pan_rate 80", "pan_rate 40",
    ]  # fmt: skip
    assert all(min(figure.number for figure in knob.figures) < 0 for knob in found)
    text = ControllerTuning(FACE, "pan").text([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    assert text == FACE.text.replace("far_right: -6 deg", "far_right: -12 deg").replace(
        "far_left: 6 deg", "far_left: 12 deg"
    )


def test_invalid_controller_has_the_highest_cost() -> None:
    tuning = ControllerTuning(FACE, "pan")
    assert tuning.cost([-2.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0]) == INVALID_COST  # left farther out than far left
    assert tuning.cost([0.0] * 7) < 5.0


def test_a_score_is_priced_by_time_overshoot_and_error_and_a_lost_face_above_all() -> None:
    good = Score(centred=0.5, bound=0.5, overshoot=0.0, rms=0.01, lost=False)
    assert cost_of(good) == pytest.approx(1.0 + 2 * 0.573, abs=0.001)
    worse = [
        Score(0.6, 0.5, 0.0, 0.01, lost=False),
        Score(0.5, 0.5, 0.1, 0.01, lost=False),
        Score(0.5, 0.5, 0.0, 0.02, lost=False),
        Score(None, 0.5, 0.0, 0.01, lost=False),
    ]
    assert all(cost_of(good) < cost_of(each) < LOST_FACE_COST for each in worse)
    assert cost_of(Score(None, 0.5, 0.0, None, lost=True)) == LOST_FACE_COST


def test_tuning_improves_a_controller_and_changes_only_numbers() -> None:
    found, costs = tuned(20)
    assert found.after < 0.9 * found.before
    assert found.after == min(costs)
    assert 10 <= len(costs) <= 20
    values = parse_controller(SourceText("new.yaml", found.text)).values["turn"]
    assert isinstance(values, dict)
    assert values["p"] > 1.5
    changed = found.text.splitlines()
    for old, new in zip(WEAK.text.splitlines(), changed, strict=True):
        assert old == new or old.startswith("turn: {p: 1.2, d: 0.1, most: 110 deg/s}")


def test_the_same_seed_finds_the_same_numbers(monkeypatch: pytest.MonkeyPatch) -> None:
    tuning, gentler = ControllerTuning(WEAK, "turn"), [-0.1] * len(figure_groups(WEAK, "turn"))
    assert tuning.cost(gentler) == tuning.cost(gentler)
    monkeypatch.setattr(ControllerTuning, "cost", lambda _, factors: sum((factor - 0.3) ** 2 for factor in factors))
    assert tuned(30)[0].text == tuned(30)[0].text != tuned(30, seed=4)[0].text


def test_controller_that_cannot_be_tuned_is_refused() -> None:
    with pytest.raises(ValueError, match=r"weak\.yaml: has no numbers under 'pan' to tune"):
        ControllerTuning(WEAK, "pan")
    with pytest.raises(ValueError, match="a PD controller needs 'd'"):
        ControllerTuning(SourceText("bad.yaml", "controller: bad\nturn: {p: 3}\n"), "turn")
    with pytest.raises(InvalidFileError):
        ControllerTuning(SourceText("bad.yaml", "turn: {p: 3"), "turn")
