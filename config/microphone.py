"""The ``microphone`` section of a robot file: what the robot hears with, and how it understands."""

import re
import unicodedata
from collections.abc import Mapping
from dataclasses import dataclass, field

from config.faults import one_of
from config.fields import Fields
from config.marked import Node, Scalar
from config.units import seen

DRIVERS = ("microphone", "file")
"""What sound may come from: the sound card, or a WAV file that plays when the robot is switched on."""

RECOGNISERS = ("pocketsphinx", "vosk")

PHONES = (
    "AA", "AE", "AH", "AO", "AW", "AY", "B", "CH", "D", "DH", "EH", "ER", "EY", "F", "G", "HH", "IH", "IY", "JH", "K",
    "L", "M", "N", "NG", "OW", "OY", "P", "R", "S", "SH", "T", "TH", "UH", "UW", "V", "W", "Y", "Z", "ZH",
)  # fmt: skip
"""The sounds of which pronunciations are made, as perception knows them: a test holds the two together."""

_APOSTROPHES = str.maketrans({"\u2019": "'", "\u02bc": "'"})
_WORD = re.compile(r"[^\W\d_]+(?:'[^\W\d_]+)*")

MOST_SURE = 10.0
"""The highest threshold: so sure it never is."""


@dataclass(frozen=True, slots=True)
class MicrophoneConfig:
    """How the robot hears.

    ``source`` is a part of the sound card's name (empty: the system's choice), or the path of a WAV file. ``model`` is
    the folder of a model for Vosk. What scores ``threshold`` is accepted: 0 is as likely said as not, more is stricter.
    ``pronunciations`` are for words that the dictionary lacks: phones with blanks between, by word in small letters.
    """

    driver: str = "microphone"
    source: str = ""
    recogniser: str = "pocketsphinx"
    model: str = ""
    threshold: float = 0.0
    pronunciations: Mapping[str, str] = field(default_factory=dict)


def read_microphone(fields: Fields | None) -> MicrophoneConfig | None:
    """Read the section."""
    if fields is None:
        return None
    microphone = MicrophoneConfig(
        driver=fields.choice("driver", DRIVERS, "microphone"),
        source=fields.text("source", ""),
        recogniser=fields.choice("recogniser", RECOGNISERS, "pocketsphinx"),
        model=fields.text("model", ""),
        threshold=fields.number("threshold", 0.0, low=-MOST_SURE, high=MOST_SURE),
        pronunciations=_pronunciations(fields.section("pronunciations")),
    )
    if microphone.driver == "file" and not microphone.source:
        fields.fault(fields.node.mark, "a microphone with 'driver: file' needs 'source'", "source: commands.wav")
    if microphone.recogniser == "vosk" and not microphone.model:
        hint = "model: vosk-model-small-en-us-0.15"
        fields.fault(fields.node.mark, "a microphone with 'recogniser: vosk' needs 'model'", hint)
    fields.done()
    return microphone


def _pronunciations(fields: Fields | None) -> Mapping[str, str]:
    if fields is None:
        return {}
    return {_word(fields, key): _phones(fields, key.text, said) for key, said in fields.entries()}


def _word(fields: Fields, key: Scalar) -> str:
    """Return a word as perception listens for it: a test holds the two together."""
    word = unicodedata.normalize("NFC", key.text.casefold()).translate(_APOSTROPHES)
    if _WORD.fullmatch(word) is None:
        hint = "what is listened for is split into words, also at hyphens: give each of them its phones"
        fields.fault(key.mark, f"'pronunciations': {seen(key.text)} is not one word of letters", hint)
    return word


def _phones(fields: Fields, word: str, node: Node) -> str:
    phones = node.text.upper().split() if isinstance(node, Scalar) and node.value is not None else []
    if not phones:
        fields.fault(node.mark, f"'{word}' needs its phones", f"write '{word}: R AA D N IY'")
    for phone in phones:
        if phone not in PHONES:
            fields.fault(node.mark, f"'{word}': no phone is called {seen(phone)}", one_of(phone, PHONES))
    return " ".join(phones)
