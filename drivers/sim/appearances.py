"""Appearances of the drawn people, different enough for a face recogniser to distinguish them."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal

from drivers.sim.room import Colour

Hair = Literal["short", "long", "curly", "bald", "bun"]
"""Hair styles."""


@dataclass(frozen=True, slots=True)
class Appearance:
    """Appearance of one drawn person. Lengths in millimetres at the size of a real face."""

    skin: Colour
    hair: Hair
    hair_colour: Colour
    shirt: Colour
    trousers: Colour
    eyes: Colour = (80, 60, 44)
    face_width: float = 154.0
    eye_distance: float = 64.0
    mouth_width: float = 50.0
    brow: float = 7.0
    jaw: float = 1.0
    glasses: bool = False
    beard: bool = False


APPEARANCES: Mapping[str, Appearance] = MappingProxyType(
    {
        "anna": Appearance(
            skin=(232, 190, 162), hair="long", hair_colour=(112, 70, 38), shirt=(40, 92, 150), trousers=(52, 56, 70),
            eyes=(70, 96, 110), face_width=148, mouth_width=50, brow=5.5, jaw=0.93,
        ),
        "ben": Appearance(
            skin=(222, 176, 146), hair="short", hair_colour=(58, 42, 32), shirt=(146, 46, 42), trousers=(60, 66, 84),
            face_width=158, eye_distance=66, mouth_width=54, brow=8.5, jaw=1.08, beard=True,
        ),
        "chidi": Appearance(
            skin=(150, 104, 76), hair="bald", hair_colour=(34, 28, 26), shirt=(206, 166, 52), trousers=(46, 44, 42),
            eyes=(50, 36, 28), face_width=158, eye_distance=68, mouth_width=60, brow=7.5, jaw=1.04,
        ),
        "dora": Appearance(
            skin=(238, 202, 176), hair="bun", hair_colour=(176, 168, 158), shirt=(96, 62, 112), trousers=(72, 64, 60),
            eyes=(88, 110, 124), face_width=150, eye_distance=62, mouth_width=46, brow=6.0, jaw=0.98, glasses=True,
        ),
        "emil": Appearance(
            skin=(230, 184, 150), hair="curly", hair_colour=(182, 112, 50), shirt=(52, 122, 80), trousers=(84, 88, 96),
            eyes=(76, 100, 70), face_width=152, eye_distance=61, mouth_width=46, brow=6.0, jaw=1.0,
        ),
        "farah": Appearance(
            skin=(196, 146, 112), hair="long", hair_colour=(30, 24, 24), shirt=(188, 188, 184), trousers=(36, 40, 58),
            eyes=(56, 40, 30), face_width=146, eye_distance=65, mouth_width=56, brow=7.0, jaw=0.92,
        ),
    }
)  # fmt: skip
"""Appearances by name."""
