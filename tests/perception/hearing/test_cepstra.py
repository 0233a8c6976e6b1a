"""From sound to cepstra, as pocketsphinx has them."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from perception.hearing.acoustic_model import (
    CEPSTRUM_SIZE,
    HOP_SAMPLES,
    TYPICAL_CEPSTRA,
    TYPICAL_ROWS,
    WINDOW_SAMPLES,
    add_slopes,
    cepstra,
    normalise_cepstra,
)
from perception.hearing.sound import RATE, Samples


def voice(seconds: float = 1.0, loudness: float = 1000.0) -> Samples:
    """Buzzing at 120 Hz that comes and goes, over a little noise."""
    time = np.arange(round(seconds * RATE)) / RATE
    buzz = 2 * np.mod(120 * time, 1) - 1
    hiss = np.random.default_rng(0).standard_normal(len(time))
    return np.asarray(loudness * (buzz * np.abs(np.sin(9 * time)) + 0.02 * hiss), np.int16)


@given(st.integers(WINDOW_SAMPLES, 5000))
def test_cepstra_have_a_row_per_10_ms(count: int) -> None:
    rows = cepstra(voice()[:count])
    assert rows.shape[1] == CEPSTRUM_SIZE
    assert abs(len(rows) - count / HOP_SAMPLES) <= 2


def test_cepstra_match_pocketsphinx(tmp_path: Path) -> None:
    pocketsphinx = pytest.importorskip("pocketsphinx")
    model = pocketsphinx.get_model_path("en-us/en-us")
    engine = pocketsphinx.Decoder(hmm=model, dict=None, lm=None, cmn="batch", mfclogdir=str(tmp_path), loglevel="FATAL")
    engine.add_word("yes", "Y EH S", True)
    engine.add_fsg("yes", engine.create_fsg("yes", 0, 1, [(0, 1, 1.0, "yes")]))
    engine.activate_search("yes")
    engine.start_utt()
    engine.process_raw(voice().tobytes(), no_search=False, full_utt=True)
    engine.end_utt()
    (log,) = tmp_path.iterdir()
    theirs = np.frombuffer(log.read_bytes(), ">f4", offset=4).reshape(-1, CEPSTRUM_SIZE)
    assert np.allclose(cepstra(voice()), theirs, atol=0.01)


def test_a_louder_voice_differs_in_the_first_alone() -> None:
    quiet, loud = cepstra(voice()), cepstra(voice(loudness=4000.0))
    shift = (loud - quiet)[10:].mean(axis=0)
    assert shift[0] == pytest.approx(np.log(16) * 5, rel=0.05)
    assert np.abs(shift[1:]).max() < 0.5


def test_the_mean_of_a_long_sound_is_taken_away_and_of_a_short_one_in_part() -> None:
    rows = np.tile(np.array(TYPICAL_CEPSTRA) + 2.0, (TYPICAL_ROWS, 1))
    assert normalise_cepstra(rows) == pytest.approx(np.full((TYPICAL_ROWS, CEPSTRUM_SIZE), 1.0))
    assert np.abs(normalise_cepstra(np.tile(rows, (99, 1)))).max() == pytest.approx(0.02)


def test_slopes_are_of_5_rows_and_theirs_of_7() -> None:
    rows = np.arange(20.0)[:, None] ** 2 * np.ones(CEPSTRUM_SIZE)
    found = add_slopes(rows)
    assert found.shape == (20, 3, CEPSTRUM_SIZE)
    assert found[10, :, 0] == pytest.approx([100, 12**2 - 8**2, 13**2 - 11**2 - 9**2 + 7**2])
    assert not add_slopes(np.ones((9, CEPSTRUM_SIZE)))[:, 1:].any()
