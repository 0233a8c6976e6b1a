"""What tells a phrase that was said from one that was not."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from perception.hearing.acceptance import MODEL_FILE, AcceptanceModel, load_acceptance
from perception.hearing.features import DECODER_FRAME, Decoding, acceptance_features
from perception.hearing.lexicon import edit_distance
from perception.hearing.sound import Clip

letters = st.lists(st.sampled_from("ABC"), max_size=6)


def answer(**others: Any) -> dict[str, Any]:
    """What the recogniser says of "yes" in the middle of 60 frames, where the loop heard the same but for the end."""
    return {
        "phrase": "yes",
        "frames": 60,
        "words": [["<sil>", 0, 20, -200.0], ["yes", 20, 30, -900.0], ["<sil>", 50, 10, -100.0]],
        "aligned": [["SIL", 0, 20, -200.0], ["Y", 20, 5, -150.0], ["EH", 25, 10, -300.0], ["S", 35, 15, -450.0],
                    ["SIL", 50, 10, -100.0]],
        "loop": [["SIL", 0, 20, -200.0], ["Y", 20, 5, -150.0], ["EH", 25, 10, -200.0], ["F", 35, 15, -300.0],
                 ["SIL", 50, 10, -100.0]],
        **others,
    }  # fmt: skip


def clip(loud: slice = slice(20, 50)) -> Clip:
    rng = np.random.default_rng(0)
    sound = rng.standard_normal((60, DECODER_FRAME)) * 30
    sound[loud] *= 100
    noise = rng.standard_normal(RATE_HALF) * 30
    return Clip(1.0, 1.3, 0.2, sound.ravel().astype(np.int16), noise.astype(np.int16))


RATE_HALF = 8000


def figures(**others: Any) -> dict[str, float]:
    said = Decoding.from_answer(answer(**others))
    assert said is not None
    return acceptance_features(said, clip())


def test_acceptance_figures_match_their_definitions() -> None:
    found = figures()
    assert found["ratio"] == pytest.approx((-1200 + 950) / 30)
    assert found["goodness"] == pytest.approx((0 * 5 - 10 * 10 - 10 * 15) / 30)
    assert [found["worst"], found["worst two"]] == pytest.approx([-10, -10])
    assert (found["silence"], found["pauses"]) == (0, 0)
    assert found["changes"] == pytest.approx(1 / 3)
    assert (found["changes of kind"], found["surplus"]) == (0, 0)
    assert np.exp([found["phones"], found["shortest"], found["middle"], found["longest"]]) == pytest.approx(
        [3, 5, 10, 15]
    )
    assert found["above noise"] == pytest.approx(40, abs=2)
    assert found["covered"] > 0.85


def test_loud_sound_beside_the_words_shows() -> None:
    said = Decoding.from_answer(answer())
    assert said is not None
    within, beside = acceptance_features(said, clip()), acceptance_features(said, clip(slice(0, 60)))
    assert beside["outside"] > within["outside"] + 1
    assert beside["covered"] < 0.7


def test_silence_fitting_worse_than_a_phone_shows_in_the_figures() -> None:
    loop = [["AA", 0, 20, -20.0], *answer()["loop"][1:]]
    assert figures(loop=loop)["silence"] < -5
    assert figures(loop=loop)["worst silence"] < -8


@pytest.mark.parametrize(
    "nothing",
    [
        {"phrase": ""},
        {"aligned": []},
        {"loop": []},
        {"aligned": [["SIL", 0, 60, -1.0]]},
    ],
)
def test_empty_answer_has_no_figures(nothing: dict[str, Any]) -> None:
    assert Decoding.from_answer(answer(**nothing)) is None


@given(letters, letters, letters)
def test_changes_are_a_distance(one: list[str], two: list[str], three: list[str]) -> None:
    assert edit_distance(one, one) == 0
    assert edit_distance(one, two) == edit_distance(two, one) <= max(len(one), len(two))
    assert edit_distance(one, three) <= edit_distance(one, two) + edit_distance(two, three)
    assert edit_distance(one, [*one, "D"]) == 1


def test_average_figures_score_the_bias_and_each_contribution_is_limited() -> None:
    taught = AcceptanceModel(("a", "b"), (1.0, 2.0), (0.5, 1.0), (2.0, -1.0), 0.25)
    assert taught.score({"a": 1.0, "b": 2.0}) == pytest.approx(0.25)
    assert taught.score({"a": 1.5, "b": 2.0}) == pytest.approx(2.25)
    assert taught.score({"a": 1e9, "b": 2.0}) == pytest.approx(8.25)


def test_shipped_acceptance_model_covers_all_figures_and_prefers_good_fits() -> None:
    taught = load_acceptance()
    assert sorted(taught.names) == sorted(figures())
    assert json.loads(MODEL_FILE.read_text())["names"] == list(taught.names)
    good = figures(loop=answer()["aligned"])
    misfit = [[name, start, length, score * 5] for name, start, length, score in answer()["aligned"]]
    bad = figures(aligned=misfit, loop=[["SIL", 0, 20, -200.0], ["AA", 20, 30, -90.0], ["M", 50, 10, -20.0]])
    assert taught.score(good) > 0 > taught.score(bad)


def test_acceptance_model_is_read_from_a_file(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    path.write_text('{"names": ["a"], "mean": [0], "deviation": [1], "weights": [3], "bias": 1}')
    assert load_acceptance(path).score({"a": 2.0}) == pytest.approx(7)
