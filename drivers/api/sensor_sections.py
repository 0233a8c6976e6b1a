"""Common keys of the robot file sections of cameras and microphones.

This module does not import perception, so words such as the marker families are repeated here; a test compares them
with those of perception.
"""

import re
import unicodedata
from collections.abc import Iterator, Mapping
from dataclasses import replace
from math import pi
from typing import Annotated, Literal

from drivers.api.image_orientation import ImageOrientation
from drivers.api.keys import KeyDiagnostic, inside, key, keys

MARKER_FAMILIES = ("4x4_50", "4x4_100", "5x5_100", "6x6_250", "apriltag_16h5", "apriltag_25h9", "apriltag_36h11")
"""Families of the visual markers that a camera can detect."""

RECOGNISERS = ("pocketsphinx", "vosk", "sherpa")
"""Speech recognisers; all but the first need a model from the user."""

PHONES = (
    "AA", "AE", "AH", "AO", "AW", "AY", "B", "CH", "D", "DH", "EH", "ER", "EY", "F", "G", "HH", "IH", "IY", "JH", "K",
    "L", "M", "N", "NG", "OW", "OY", "P", "R", "S", "SH", "T", "TH", "UH", "UW", "V", "W", "Y", "Z", "ZH",
)  # fmt: skip
"""Speech sounds of which the pronunciation of a word in a robot file may consist."""

MAX_THRESHOLD = 10.0
"""Largest absolute value of the score from which a phrase is accepted; scores of phrases are smaller."""

_APOSTROPHES = str.maketrans({"\u2019": "'", "\u02bc": "'"})
_WORD = re.compile(r"[^\W\d_]+(?:'[^\W\d_]+)*")


@keys
class DistortionKeys:
    """Lens distortion: the coefficients of OpenCV, in its order."""

    k1: float = key(default=0.0, low=-20.0, high=20.0, help="Radial, of the second power.")
    k2: float = key(default=0.0, low=-20.0, high=20.0, help="Radial, of the fourth power.")
    p1: float = key(default=0.0, low=-20.0, high=20.0, help="Tangential.")
    p2: float = key(default=0.0, low=-20.0, high=20.0, help="Tangential.")
    k3: float = key(default=0.0, low=-20.0, high=20.0, help="Radial, of the sixth power.")

    def coefficients(self) -> tuple[float, ...]:
        """Return the coefficients in the order of OpenCV."""
        return self.k1, self.k2, self.p1, self.p2, self.k3


@keys
class MarkerKeys:
    """Markers on other robots: their family, the side of the black frame in metres, and the robot of each number."""

    family: str = key(
        default=MARKER_FAMILIES[0], among=MARKER_FAMILIES, help="Family of the ArUco or AprilTag markers."
    )
    size: float = key("length", default=0.15, low=0.01, high=2.0, help="Side of the black frame.")
    names: Mapping[str, str] = key(default={}, word="robots", help="Robot of each marker number, such as `{7: R2}`.")

    @property
    def robots(self) -> Mapping[int, str]:
        """Name of the robot of each marker, by number."""
        return {int(number): name for number, name in self.names.items()}

    def diagnostics(self) -> Iterator[KeyDiagnostic]:
        """Yield an error for each invalid marker number and each empty name."""
        for number, name in self.names.items():
            if not name.strip():
                yield KeyDiagnostic(f"'{number}' needs a text", ("robots", number))
            if not re.fullmatch("[0-9]{1,9}", number):
                message = f"'{number}' is not a marker number"
                yield KeyDiagnostic(message, ("robots", number), marks_key=True, hint="robots: {7: R2}")


@keys
class IdentityKeys:
    """Method by which people are recognised, and the folder of their pictures."""

    people: str = key(default="", help="Folder of their pictures; by default that of the user.")
    method: str = key(
        default="patches",
        among=("patches", "sface", "dlib"),
        help="Method: built in, a network from your file, or one from `missiontree[people]`.",
    )
    model: str = key(default="", help="File of the network, for `sface`.")

    def diagnostics(self) -> Iterator[KeyDiagnostic]:
        """Yield an error if the method of recognition needs a model, and none is given."""
        if self.method == "sface" and not self.model:
            message = "'sface' needs 'model', the file of its network"
            yield KeyDiagnostic(message, ("method",), hint="model: ~/sface.onnx")


@keys
class CameraKeys:
    """Keys of every camera: its view, its mounting, and the objects to detect."""

    source: str = key(default="0", help="Index, device, file, URL, or folder of pictures.")
    rotate: float | Literal["0", "90", "180", "270"] = key(
        "angle",
        default="0",
        low=-1.5 * pi - 0.01,
        high=1.5 * pi + 0.01,
        help="Clockwise rotation of its pictures; the other keys are those of the unrotated camera.",
    )
    flip: str = key(
        default="false",
        among=("false", "true", "horizontal", "vertical", "both"),
        help="Flip of its pictures after the rotation: left to right (`true`, `horizontal`), top to bottom, or both.",
    )
    field_of_view: float = key(
        "angle", default=1.0471975512, low=0.2, high=2.6, help="Horizontal angle of view of the unrotated picture."
    )
    width: int = key(default=640, low=64, high=4096, help="Width in pixels.")
    height: int = key(default=480, low=48, high=4096, help="Height in pixels.")
    position: tuple[float, float, float] = key(
        "length",
        default=(0.0, 0.0, 1.0),
        help="Mounting position, from the middle of the base on the floor, with the head looking ahead: [x, y, z].",
    )
    centre_x: float = key("share", default=0.5, low=0.1, high=0.9, help="Optical axis in the picture, from its left.")
    centre_y: float = key("share", default=0.5, low=0.1, high=0.9, help="Optical axis in the picture, from its top.")
    distortion: DistortionKeys | None = key(
        default=None, help="Lens distortion: `mission robot camera calibrate` measures it."
    )
    detector: str = key(default="haar", among=("haar", "yunet"), help="Face detector; `yunet` needs its model.")
    model: str = key(default="", help="File of YuNet; by default where `mission robot models fetch` puts it.")
    markers: MarkerKeys | None = key(default=None, help="Markers on other robots.")
    identity: IdentityKeys = key(default=IdentityKeys(), help="Recognition of people.")
    delay: float = key(
        "duration",
        default=0.0,
        low=-0.1,
        high=0.25,
        help="Initial estimate of the time from exposure to stamp of a picture; it is refined at run time.",
    )

    @property
    def centre(self) -> tuple[float, float]:
        """Principal point, as shares of the picture's sides."""
        return self.centre_x, self.centre_y

    @property
    def distortion_coefficients(self) -> tuple[float, ...]:
        """Distortion coefficients of the lens; empty if unknown."""
        return () if self.distortion is None else self.distortion.coefficients()

    @property
    def orientation(self) -> ImageOrientation:
        """Rotation and mirroring of the pictures."""
        quarters = int(self.rotate) / 90 if isinstance(self.rotate, str) else self.rotate / (pi / 2)
        both = self.flip == "both"
        return ImageOrientation(
            round(quarters) % 4, both or self.flip in ("true", "horizontal"), both or self.flip == "vertical"
        )

    def upright(self) -> "CameraKeys":
        """Return the keys of an upright camera with the same pictures as this one after their rotation and mirroring.

        Size, angle of view, centre and distortion are converted.
        """
        turn, distortion = self.orientation, self.distortion
        width, height = turn.size(self.width, self.height)
        centre_x, centre_y = turn.point(*self.centre)
        if distortion is not None:  # the tangential coefficients are a vector: (p2, p1)
            p2, p1 = turn.vector(distortion.p2, distortion.p1)
            distortion = replace(distortion, p1=p1, p2=p2)
        return replace(
            self,
            rotate="0",
            flip="false",
            width=width,
            height=height,
            field_of_view=turn.field_of_view(self.field_of_view, width, height),
            centre_x=centre_x,
            centre_y=centre_y,
            distortion=distortion,
        )

    def diagnostics(self) -> Iterator[KeyDiagnostic]:
        """Yield an error for a rotation of the pictures that is not a multiple of 90 degrees."""
        if isinstance(self.rotate, float) and abs(self.rotate / (pi / 2) - round(self.rotate / (pi / 2))) > 1e-3:
            yield KeyDiagnostic("'rotate' must be 0, 90, 180 or 270 deg", ("rotate",), hint="rotate: 90 deg")


@keys
class MicrophoneKeys:
    """Keys of every microphone: its source, and the recognition of speech."""

    source: str = key(default="", help="Part of the sound card's name, or the path of a WAV file.")
    recogniser: str = key(default="pocketsphinx", among=RECOGNISERS, help="Speech recogniser.")
    model: str = key(default="", help="Folder of a model for `vosk` or `sherpa`.")
    threshold: float = key(
        default=0.0, low=-MAX_THRESHOLD, high=MAX_THRESHOLD, help="Minimum score of a phrase; more is stricter."
    )
    pronunciation_texts: Mapping[
        str, Annotated[str, inside(wrong="'{}' needs its phones", hint="write '{}: R AA D N IY'")]
    ] = key(
        default={},
        word="pronunciations",
        help="Pronunciations of words that the dictionary lacks, such as `{ada: EY D AH}`.",
    )

    @property
    def pronunciations(self) -> Mapping[str, str]:
        """Pronunciations of words: phones separated by spaces, by word in lower case."""
        return {
            _normalize_word(word): " ".join(phones.upper().split()) for word, phones in self.pronunciation_texts.items()
        }

    def diagnostics(self) -> Iterator[KeyDiagnostic]:
        """Yield errors for a missing speech model, and for invalid words and phones."""
        if self.recogniser != RECOGNISERS[0] and not self.model:
            message = f"a microphone with 'recogniser: {self.recogniser}' needs 'model'"
            yield KeyDiagnostic(message, hint="model: FOLDER, where its model is unpacked (docs/speech.md)")
        for word, phones in self.pronunciation_texts.items():
            at = ("pronunciations", word)
            if _WORD.fullmatch(_normalize_word(word)) is None:
                hint = "phrases are split into words, also at hyphens: give the phones of each word"
                yield KeyDiagnostic(
                    f"'pronunciations': '{word}' is not one word of letters", at, marks_key=True, hint=hint
                )
            for phone in phones.upper().split():
                if phone not in PHONES:
                    yield KeyDiagnostic(
                        f"'{word}': no phone is called '{phone}'", at, unknown_word=phone, known_words=PHONES
                    )


def _normalize_word(word: str) -> str:
    return unicodedata.normalize("NFC", word.casefold()).translate(_APOSTROPHES)
