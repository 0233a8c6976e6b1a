"""Shapes of the mouth for the phonemes of espeak-ng, as a face shows them."""

from collections.abc import Iterable

from drivers.api import Mouth, MouthShape

STRESSES = "',=%|!"
"""Marks that espeak puts before a phoneme: how it is stressed."""

SHAPES = {
    Mouth.CLOSED: "pbm_",
    Mouth.TEETH: "fv",
    Mouth.ROUND: "uUoOwWyYSZ",
    Mouth.WIDE: "iIeEj",
    Mouth.OPEN: "aAV0",
}
"""First letters of phonemes (docs/phonemes.md of espeak-ng); all others are sounds of the tongue, with a narrow mouth.

S and Z are those of *shoe* and *measure*, 0 and V the vowels of *lot* and *cup*, _ is a pause.
"""

_BY_LETTER = {letter: shape for shape, letters in SHAPES.items() for letter in letters}


def shape_of(phoneme: str) -> Mouth:
    """Return the shape for one phoneme, such as ``'oU``; a diphthong by its beginning, tS and dZ as S and Z."""
    bare = phoneme.lstrip(STRESSES)
    if bare in ("tS", "dZ"):
        return Mouth.ROUND
    return _BY_LETTER.get(bare[:1], Mouth.NARROW) if bare else Mouth.CLOSED


def movement(phonemes: Iterable[tuple[float, str]], end: float) -> tuple[MouthShape, ...]:
    """Return how the mouth moves with ``phonemes``, each with the second when it begins; closed from ``end`` on."""
    shapes: list[MouthShape] = []
    for at, shape in (*((at, shape_of(phoneme)) for at, phoneme in phonemes), (end, Mouth.CLOSED)):
        if not shapes or shapes[-1].shape is not shape:
            shapes.append(MouthShape(at, shape))
    return tuple(shapes)
