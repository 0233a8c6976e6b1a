"""The phones of the English model: ARPABET without stress, as in the CMU dictionary."""

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
