"""The phones of the English model: ARPABET without stress, as in the CMU dictionary."""

from collections.abc import Sequence

# Pronunciations from a synthesiser: what espeak-ng calls its phonemes, as phones of the recogniser.
#
# For words that no dictionary has, such as names. Of 1500 words of the CMU dictionary drawn by lot, 57 % come out as
# they stand there, and 11 % of all phones differ.

_SOUNDS = {
    "p": "P", "b": "B", "t": "T", "t#": "T", "t2": "T", "d": "D", "k": "K", "g": "G", "f": "F", "v": "V", "T": "TH",
    "D": "DH", "s": "S", "z": "Z", "S": "SH", "Z": "ZH", "h": "HH", "x": "K", "tS": "CH", "dZ": "JH", "m": "M",
    "n": "N", "n-": "AH N", "N": "NG", "l": "L", "@L": "AH L", "r": "R", "r-": "AH R", "w": "W", "j": "Y",
    "a": "AE", "aa": "AE", "a#": "AH", "A:": "AA", "A@": "AA R", "0": "AA", "V": "AH", "@": "AH", "@-": "AH",
    "@2": "AH", "3": "ER", "3:": "ER", "E": "EH", "e@": "EH R", "I": "IH", "I2": "IH", "I#": "IH", "i": "IY",
    "i:": "IY", "i@": "IY AH", "i@3": "IH R", "O:": "AO", "O2": "AO", "O@": "AO R", "o@": "AO R", "U": "UH",
    "U@": "UH R", "u:": "UW", "eI": "EY", "aI": "AY", "aI@": "AY AH", "aI3": "AY ER", "OI": "OY", "aU": "AW",
    "oU": "OW",
}  # fmt: skip
"""Mnemonics of the voice en-us, without stress."""

_SILENT = frozenset(("", "_", "_:", "?", ";", "|"))


def phones_of(mnemonics: Sequence[str]) -> tuple[str, ...]:
    """Return the phones of a word from espeak-ng's phoneme events. Raises ValueError for a mnemonic of other voices."""
    found: list[str] = []
    for mnemonic in mnemonics:
        plain = mnemonic.lstrip("',%=")
        if plain in _SILENT:
            continue
        if plain not in _SOUNDS:
            raise ValueError(f"phoneme {mnemonic!r} is none of the voice en-us")
        found += _SOUNDS[plain].split()
    return tuple(found)


KINDS = {
    "vowel": ("AA", "AE", "AH", "AO", "AW", "AY", "EH", "ER", "EY", "IH", "IY", "OW", "OY", "UH", "UW"),
    "hiss": ("CH", "F", "JH", "S", "SH", "TH", "Z", "ZH"),
    "breath": ("DH", "HH", "V"),
    "stop": ("B", "D", "G", "K", "P", "T"),
    "nasal": ("M", "N", "NG"),
    "glide": ("L", "R", "W", "Y"),
}
"""The phones of each kind: those of one kind are easily mistaken for each other."""

KIND_OF = {phone: kind for kind, phones in KINDS.items() for phone in phones}
"""The kind of each phone; noises and silence have none."""

VOWELS = frozenset(KINDS["vowel"])
