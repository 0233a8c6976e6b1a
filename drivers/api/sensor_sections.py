"""Common keys of the robot file sections of cameras and microphones.

The words that only perception interprets are repeated here; a test compares them with its modules.
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
"""Families of markers."""

RECOGNISERS = ("pocketsphinx", "vosk", "sherpa")
"""Speech recognisers; all but the first need a model from the user."""

PHONES = (
    "AA", "AE", "AH", "AO", "AW", "AY", "B", "CH", "D", "DH", "EH", "ER", "EY", "F", "G", "HH", "IH", "IY", "JH", "K",
    "L", "M", "N", "NG", "OW", "OY", "P", "R", "S", "SH", "T", "TH", "UH", "UW", "V", "W", "Y", "Z", "ZH",
)  # fmt: skip
"""Phones of pronunciations."""

MAX_THRESHOLD = 10.0
"""Highest threshold; no score reaches it."""

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

    family: str = key(default=MARKER_FAMILIES[0], among=MARKER_FAMILIES, help="The family of the markers.")
    size: float = key("length", default=0.15, low=0.01, high=2.0, help="The side of the black frame.")
    names: Mapping[str, str] = key(default={}, word="robots", help="Whose each number is, such as `{7: R2}`.")

    @property
    def robots(self) -> Mapping[int, str]:
        """Name of the robot of each marker, by number."""
        return {int(number): name for number, name in self.names.items()}

    def diagnostics(self) -> Iterator[KeyDiagnostic]:
        """Yield invalid marker numbers and empty names."""
        for number, name in self.names.items():
            if not name.strip():
                yield KeyDiagnostic(f"'{number}' needs a text", ("robots", number))
            if not re.fullmatch("[0-9]{1,9}", number):
                message = f"'{number}' is no marker's number"
                yield KeyDiagnostic(message, ("robots", number), marks_key=True, hint="robots: {7: R2}")


@keys
class IdentityKeys:
    """Method by which people are recognised, and the folder of their pictures."""

    people: str = key(default="", help="The folder of their pictures; else that of the user.")
    method: str = key(
        default="patches",
        among=("patches", "sface", "dlib"),
        help="What is built in, a network whose file you give, or one that `missiontree[people]` brings.",
    )
    model: str = key(default="", help="The file of the network, for `sface`.")

    def diagnostics(self) -> Iterator[KeyDiagnostic]:
        """Yield an error if the model of a method is missing."""
        if self.method == "sface" and not self.model:
            message = "'sface' needs 'model', the file of its network"
            yield KeyDiagnostic(message, ("method",), hint="model: ~/sface.onnx")


@keys
class CameraKeys:
    """Keys of every camera: its view, its mounting, and the objects to detect."""

    source: str = key(default="0", help="An index, a device, a file, a URL, or a folder of pictures.")
    rotate: float | Literal["0", "90", "180", "270"] = key(
        "angle",
        default="0",
        low=-1.5 * pi - 0.01,
        high=1.5 * pi + 0.01,
        help="How far to turn its pictures clockwise; the other keys are those of the unturned camera.",
    )
    flip: str = key(
        default="false",
        among=("false", "true", "horizontal", "vertical", "both"),
        help="Mirror its pictures, once they are turned: left to right (`true`, `horizontal`), top to bottom, or both.",
    )
    field_of_view: float = key(
        "angle", default=1.0471975512, low=0.2, high=2.6, help="From the left of the unturned picture to its right."
    )
    width: int = key(default=640, low=64, high=4096, help="Pixels from left to right.")
    height: int = key(default=480, low=48, high=4096, help="Pixels from top to bottom.")
    position: tuple[float, float, float] = key(
        "length",
        default=(0.0, 0.0, 1.0),
        help="Where it sits, from the middle of the base on the floor, with the head looking ahead: [x, y, z].",
    )
    centre_x: float = key(
        "share", default=0.5, low=0.1, high=0.9, help="Where the optical axis meets the picture, from its left."
    )
    centre_y: float = key("share", default=0.5, low=0.1, high=0.9, help="The same from its top.")
    distortion: DistortionKeys | None = key(
        default=None, help="How the lens bends the picture: `mission robot camera calibrate` finds it."
    )
    detector: str = key(default="haar", among=("haar", "yunet"), help="What finds faces; `yunet` needs its model.")
    model: str = key(default="", help="The file of YuNet; else where `mission robot models fetch` puts it.")
    markers: MarkerKeys | None = key(default=None, help="The markers that other robots wear.")
    identity: IdentityKeys = key(default=IdentityKeys(), help="How people are recognised.")
    delay: float = key(
        "duration",
        default=0.0,
        low=-0.1,
        high=0.25,
        help="How long after its exposure a picture is stamped, as far as known; it is learnt from there on.",
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
        """Return the keys of a camera that takes the rotated pictures: size, angle of view, centre and distortion."""
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
        """Yield a rotation that is not a multiple of 90 degrees."""
        if isinstance(self.rotate, float) and abs(self.rotate / (pi / 2) - round(self.rotate / (pi / 2))) > 1e-3:
            yield KeyDiagnostic("'rotate' must be 0, 90, 180 or 270 deg", ("rotate",), hint="rotate: 90 deg")


@keys
class MicrophoneKeys:
    """Keys of every microphone: its source, and the recognition of speech."""

    source: str = key(default="", help="A part of the sound card's name, or the path of a WAV file.")
    recogniser: str = key(default="pocketsphinx", among=RECOGNISERS, help="What understands speech.")
    model: str = key(default="", help="The folder of a model for `vosk` or `sherpa`.")
    threshold: float = key(
        default=0.0, low=-MAX_THRESHOLD, high=MAX_THRESHOLD, help="What scores less is not accepted; more is stricter."
    )
    pronunciation_texts: Mapping[
        str, Annotated[str, inside(wrong="'{}' needs its phones", hint="write '{}: R AA D N IY'")]
    ] = key(
        default={},
        word="pronunciations",
        help="How words are said that the dictionary lacks, such as `{ada: EY D AH}`.",
    )

    @property
    def pronunciations(self) -> Mapping[str, str]:
        """Phones separated by spaces, by word in lower case, as perception uses them."""
        return {
            _normalize_word(word): " ".join(phones.upper().split()) for word, phones in self.pronunciation_texts.items()
        }

    def diagnostics(self) -> Iterator[KeyDiagnostic]:
        """Yield a missing model, and invalid words and phones."""
        if self.recogniser != RECOGNISERS[0] and not self.model:
            message = f"a microphone with 'recogniser: {self.recogniser}' needs 'model'"
            yield KeyDiagnostic(message, hint="model: FOLDER, where its model is unpacked (docs/speech.md)")
        for word, phones in self.pronunciation_texts.items():
            at = ("pronunciations", word)
            if _WORD.fullmatch(_normalize_word(word)) is None:
                hint = "what is listened for is split into words, also at hyphens: give each of them its phones"
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
