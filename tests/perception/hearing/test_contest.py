"""Which of many single words a sound fits best, by the acoustic model that pocketsphinx carries."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from perception.hearing.acoustic_model import STATES_PER_PHONE, AcousticModel, StateLikelihoods, WordContest
from perception.hearing.lexicon import model_folder
from perception.hearing.sound import RATE, Floats, Samples, add_noise, enhance_speech
from tests.benchmarks.speaking import Speaking

pytest.importorskip("pocketsphinx")

WAYS = {"yes": "Y EH S", "no": "N OW", "stop": "S T AA P", "nine": "N AY N", "on": "AA N", "hello": "HH AH L OW"}


@pytest.fixture(scope="module")
def model() -> AcousticModel:
    folder = model_folder()
    assert folder is not None
    return AcousticModel(folder / "en-us")


def contest(model: AcousticModel, *words: str) -> WordContest:
    return WordContest(model, [(word, WAYS[word].split()) for word in words])


def surrounded(sound: Samples) -> Samples:
    quiet = np.zeros(RATE // 3, np.int16)
    return add_noise(enhance_speech(np.concatenate([quiet, sound, quiet]), quiet), 20.0)


def test_spoken_word_wins_and_is_listed_once(model: AcousticModel) -> None:
    pytest.importorskip("espeakng_loader")
    arena = WordContest(
        model, [*((word, ways.split()) for word, ways in WAYS.items()), ("stop", ["S", "T", "AO", "P"])]
    )
    with Speaking() as speaking:
        for word in WAYS:
            sound = speaking.say(word, "en-us", 150)
            entries = arena.rank_words(surrounded(sound))
            assert entries[0].word == word
            assert sorted(entry.word for entry in entries) == sorted(WAYS)
            assert [entry.score for entry in entries] == sorted((entry.score for entry in entries), reverse=True)
            assert 10 <= entries[0].frames <= len(sound) * 100 / RATE + 5


def test_competitors_do_not_change_a_score(model: AcousticModel) -> None:
    sound = np.random.default_rng(1).normal(0, 900, RATE).astype(np.int16)
    few, many = (
        {each.word: each.score for each in contest(model, *words).rank_words(sound)} for words in (("on",), WAYS)
    )
    assert few["on"] == pytest.approx(many["on"], rel=1e-5)


def test_too_short_sound_ranks_a_word_last(model: AcousticModel) -> None:
    (on, hello) = contest(model, "on", "hello").rank_words(np.zeros(1600, np.int16))
    assert (on.word, hello.word, hello.frames) == ("on", "hello", 0)
    assert np.isfinite(on.score)


def test_phone_states_depend_on_the_position_in_the_word(model: AcousticModel) -> None:
    no, nine, on = (model.word_states(WAYS[word].split()) for word in ("no", "nine", "on"))
    assert [len(each.numbers) for each in (no, nine, on)] == [
        2 * STATES_PER_PHONE,
        3 * STATES_PER_PHONE,
        2 * STATES_PER_PHONE,
    ]
    firsts = [tuple(no.numbers[:3]), tuple(nine.numbers[:3]), tuple(nine.numbers[-3:]), tuple(on.numbers[-3:])]
    assert len(set(firsts)) > 2
    assert set(model.phone_of[no.numbers[:3]]) == set(model.phone_of[on.numbers[-3:]])
    assert np.exp(no.log_stay) + np.exp(no.log_leave) == pytest.approx(np.ones(6))


def test_unknown_triphone_falls_back_to_its_phone(model: AcousticModel) -> None:
    odd = model.word_states(["ZH", "ZH", "ZH"]).numbers
    assert len(odd) == 3 * STATES_PER_PHONE
    with pytest.raises(KeyError):
        model.word_states(["XX"])


def test_state_fits_the_means_of_its_own_phone_best(model: AcousticModel) -> None:
    which = model.word_states(["S", "IY"]).numbers
    fits = StateLikelihoods(model, which.tolist())
    hiss, vowel = (int(model.phone_of[state]) for state in (which[1], which[4]))
    features = np.array([_mean(model, phone) for phone in (hiss, vowel)])
    found = fits(features)[:, fits.columns(which)]
    assert found[0, 1] > found[0, 4]
    assert found[1, 4] > found[1, 1]


def _mean(model: AcousticModel, phone: int) -> Floats:
    quads, lines = np.split(model.slopes[phone].astype(np.float64), 2, axis=-1)
    return np.asarray((-0.5 * lines / quads).mean(axis=1), np.float64)


@pytest.mark.parametrize(
    ("name", "spoilt", "complaint"),
    [
        ("mdef", lambda data: b"text" + data[4:], "no binary mdef"),
        ("mdef", lambda data: data[: _emitting(data)] + b"\5" + data[_emitting(data) + 1 :], "5 states in a phone"),
        ("sendump", lambda data: data[:1000], "weights of another form"),
        ("feat.params", lambda data: data.replace(b"-nfilt 25", b"-nfilt 40"), "other features: -nfilt 40"),
        ("feat.params", lambda data: data.replace(b"-svspec 0-12/13-25/26-38", b""), "other features: -svspec None"),
    ],
)
def test_unsupported_acoustic_model_is_refused(
    name: str, spoilt: Callable[[bytes], bytes], complaint: str, tmp_path: Path
) -> None:
    folder = model_folder()
    assert folder is not None
    for each in ("means", "variances", "transition_matrices", "mdef", "sendump", "feat.params"):
        data = (folder / "en-us" / each).read_bytes()
        (tmp_path / each).write_bytes(spoilt(data) if each == name else data)
    with pytest.raises(ValueError, match=complaint):
        AcousticModel(tmp_path)


def _emitting(data: bytes) -> int:
    """Where an mdef says how many states a phone has."""
    return 12 + int.from_bytes(data[8:12], "little") + 8
