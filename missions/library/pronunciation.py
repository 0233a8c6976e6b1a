"""Pronunciation of the words that a mission listens for: from the robot file, a dictionary or a synthesiser."""

from collections.abc import Mapping, Sequence
from importlib.util import find_spec

from drivers.api import SpeechStyle
from drivers.api.sensor_sections import MicrophoneKeys
from drivers.clock import Clock
from drivers.errors import BadRequest, DriverError, NotConnected
from drivers.sound.cancel_token import CancelToken
from drivers.sound.engines import EspeakEngine
from perception.hearing.lexicon import Lexicon, espeak_to_phones, find_confusable, load_english

DEFAULT_MANNER = SpeechStyle("en-us", 150.0)
"""Synthesiser voice and speech rate by which the pronunciation of words is found that no dictionary has."""


def find_unpronounceable(config: MicrophoneKeys, words: Sequence[str]) -> Sequence[str]:
    """Return those of ``words`` whose pronunciation is not known, so that the robot cannot listen for them.

    The synthesiser is not run: an English word counts as known if the synthesiser is installed.
    """
    lexicon = load_english(config.pronunciations) if config.recogniser == "pocketsphinx" else None
    if lexicon is None:  # other recognisers need none; a missing one is reported when it is used
        return ()
    says = find_spec("espeakng_loader") is not None
    return [word for word in lexicon.unknown_words(words) if not (says and _is_english(word))]


def find_confusable_phrases(config: MicrophoneKeys, phrases: Sequence[str]) -> Sequence[tuple[str, str]]:
    """Return the pairs of normalised phrases that the robot easily confuses, as far as known."""
    lexicon = load_english(config.pronunciations) if config.recogniser == "pocketsphinx" else None
    return () if lexicon is None else find_confusable(phrases, lexicon)


def lexicon_for(config: MicrophoneKeys, words: Sequence[str], clock: Clock) -> Lexicon:
    """Return a lexicon with all words. Raises NotConnected without pocketsphinx, BadRequest for unknown words."""
    lexicon = load_english(config.pronunciations)
    if lexicon is None:
        from perception.hearing.engines import SphinxEngine  # noqa: PLC0415 - it computes with arrays

        raise NotConnected(
            "microphone: pocketsphinx, which understands speech, is not installed", hint=SphinxEngine.hint
        )
    unknown = lexicon.unknown_words(words)
    if not unknown:
        return lexicon
    if foreign := [word for word in unknown if not _is_english(word)]:
        raise _pronunciation_error(
            foreign, "no dictionary has them, and letters beyond a to z are not for an English synthesiser"
        )
    known = load_english({**config.pronunciations, **_synthesise(unknown, clock)})
    return lexicon if known is None else known


def _synthesise(words: Sequence[str], clock: Clock) -> Mapping[str, str]:
    """Return the pronunciations of words by a synthesiser. Raises BadRequest if it fails."""
    espeak = EspeakEngine(clock, default_manner=DEFAULT_MANNER, name="microphone")
    espeak.open()
    try:
        return {word: _phones(espeak, word) for word in words}
    except (DriverError, ValueError) as error:
        raise _pronunciation_error(words, str(error)) from error
    finally:
        espeak.close()


def _is_english(word: str) -> bool:
    """Return whether an English synthesiser can pronounce a word; it would spell words with non-ASCII letters."""
    return word.isascii()


def _pronunciation_error(words: Sequence[str], reason: str) -> BadRequest:
    return BadRequest(
        f"microphone: unknown pronunciation: {', '.join(words)}: {reason}",
        hint=f"add it to the robot file: microphone: {{pronunciations: {{{words[0]}: R AA D N IY}}}}",
    )


def _phones(espeak: EspeakEngine, word: str) -> str:
    spoken = espeak.speak(word, DEFAULT_MANNER, CancelToken())
    return " ".join(espeak_to_phones([] if spoken is None else [mnemonic for _, mnemonic in spoken.phonemes]))
