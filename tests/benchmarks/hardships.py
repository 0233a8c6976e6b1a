"""Films of people and of scenes with nobody, and what makes each harder: derived, so that the truth is known."""

import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from perception.api import Box, Image
from tests.benchmarks.covering import sidelit
from tests.footage import FOOTAGE

SMALL = 22
"""Pixels of a face's width in the films whose faces are small."""

SWEEP = 48
"""Frames of a camera that sweeps over a still scene."""

Shot = tuple[Image, list[Box]]
"""A frame, and the true faces in it."""

Hardship = Callable[[list[Shot]], list[Shot]]


@dataclass(frozen=True, slots=True)
class Film:
    """A film by name: ``open`` reads it; ``tuned`` on, or kept to report on."""

    name: str
    path: Path
    truth: list[list[Box]]
    tuned: bool

    def shots(self, most: int = 300) -> list[Shot]:
        """Read its first frames."""
        film = cv2.VideoCapture(str(self.path))
        found: list[Shot] = []
        for boxes in self.truth[:most]:
            more, image = film.read()
            if not more:
                break
            found.append((np.asarray(image, np.uint8), boxes))
        film.release()
        return found


def films(kind: str) -> Iterator[Film]:
    """Yield the films in the folder ``kind`` beside the clips of people; every second one is for tuning."""
    folder = FOOTAGE.parent / kind
    if not (folder / "truth.json").is_file():
        return
    truth = json.loads((folder / "truth.json").read_text())
    names = [name for name in sorted(truth) if name.endswith((".mkv", ".mp4"))]
    for number, name in enumerate(names):
        yield Film(name, folder / name, [[Box(*box) for box in boxes] for boxes in truth[name]], number % 2 == 0)


def _each(change: Callable[[Image], Image]) -> Hardship:
    return lambda shots: [(change(image), boxes) for image, boxes in shots]


def _warped(shots: Sequence[Shot], turn: float, scale: float, size: tuple[int, int] | None = None) -> list[Shot]:
    """Turn (degrees) and scale a film about the middle of its faces; where there was nothing, its rim goes on."""
    width, height = shots[0][0].shape[1], shots[0][0].shape[0]
    centres = [box.centre for _, boxes in shots for box in boxes] or [(width / 2, height / 2)]
    middle = np.median(centres, axis=0)
    move = cv2.getRotationMatrix2D((float(middle[0]), float(middle[1])), turn, scale)
    across, down = size or (width, height)
    if size:
        move[:, 2] += (across / 2 - middle[0], down / 2 - middle[1])
    found: list[Shot] = []
    for image, boxes in shots:
        soft = cv2.GaussianBlur(image, (0, 0), 0.5 / scale) if scale < 0.7 else image
        shown = cv2.warpAffine(soft, move, (across, down), flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        kept = []
        for box in boxes:
            x, y = move @ (*box.centre, 1.0)
            half, tall = box.width * scale / 2, box.height * scale / 2
            if half <= x <= across - half and tall <= y <= down - tall:
                kept.append(Box(float(x) - half, float(y) - tall, 2 * half, 2 * tall))
        found.append((np.asarray(shown, np.uint8), kept))
    return found


def _width(shots: Sequence[Shot]) -> float:
    """Return how wide its faces are."""
    return float(np.median([box.width for _, boxes in shots for box in boxes] or [60.0]))


def _shrunk(shots: Sequence[Shot], width: int) -> list[Shot]:
    scale = width / shots[0][0].shape[1]
    return [
        (
            np.asarray(cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA), np.uint8),
            [Box(box.x * scale, box.y * scale, box.width * scale, box.height * scale) for box in boxes],
        )
        for image, boxes in shots
    ]


def _dim(shots: Sequence[Shot]) -> list[Shot]:
    """8 % of the light, and the noise of a sensor: shot noise, and two grey levels of reading."""
    random = np.random.default_rng(3)
    found: list[Shot] = []
    for image, boxes in shots:
        light = image.astype(np.float32) * np.float32(0.08)
        noise = random.standard_normal(image.shape, np.float32) * np.sqrt(0.15 * light + 2.0)
        found.append((np.clip(np.rint(light + noise), 0, 255).astype(np.uint8), boxes))
    return found


def _packed(image: Image) -> Image:
    """As a JPEG of quality 40."""
    _, data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, 40])
    return np.asarray(cv2.imdecode(data, cv2.IMREAD_COLOR), np.uint8)


def mirrored(shots: Sequence[Shot]) -> list[Shot]:
    return [
        (
            np.ascontiguousarray(image[:, ::-1]),
            [Box(image.shape[1] - box.x - box.width, box.y, box.width, box.height) for box in boxes],
        )
        for image, boxes in shots
    ]


def together(parts: Sequence[list[Shot]]) -> list[Shot]:
    """Return four films at most as one of 640 x 480, each in a quarter of the picture."""
    found: list[Shot] = []
    for shots in zip(*parts, strict=False):
        whole, boxes = np.zeros((480, 640, 3), np.uint8), list[Box]()
        for place, (image, faces) in enumerate(shots):
            down, across = (240 * (place // 2), 320 * (place % 2))
            scale = min(320 / image.shape[1], 240 / image.shape[0])
            part = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
            whole[down : down + part.shape[0], across : across + part.shape[1]] = part
            boxes += [
                Box(box.x * scale + across, box.y * scale + down, box.width * scale, box.height * scale)
                for box in faces
            ]
        found.append((whole, boxes))
    return found


HARD: dict[str, Hardship] = {
    "as it is": list,
    "rolled 15": lambda shots: _warped(shots, 15, 1.0),
    "rolled -30": lambda shots: _warped(shots, -30, 1.0),
    "22 px": lambda shots: _warped(shots, 0, SMALL / _width(shots), (640, 480)),
    "160 wide": lambda shots: _shrunk(shots, 160),
    "8 % light": _dim,
    "JPEG 40": _each(_packed),
    "mirrored": mirrored,
    "side-lit": _each(sidelit),
}
"""What makes films of people harder."""


def _sharp(image: Image) -> Image:
    soft = cv2.GaussianBlur(image, (0, 0), 2.0)
    return np.asarray(cv2.addWeighted(image, 2.2, soft, -1.2, 0), np.uint8)


def _swept(shots: Sequence[Shot]) -> list[Shot]:
    """A camera turns to and fro over the first frame, twice as large: 0 to 20 pixels a frame, blurred by its motion."""
    image = shots[0][0]
    scale = 1280 / image.shape[1]
    still = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_CUBIC)
    room, high = still.shape[1] - 640, min(480, still.shape[0])
    found: list[Shot] = []
    left = 0.0
    for number in range(SWEEP):
        before, left = left, room / 2 * (1 - np.cos(2 * np.pi * (number + 1) / SWEEP))
        top = round((still.shape[0] - high) / 2 * (1 + np.sin(number / 9)))
        seen = still[top : top + high, round(left) : round(left) + 640]
        blur = round(abs(left - before) / 3)
        found.append((np.asarray(cv2.blur(seen, (blur, 1)) if blur > 1 else seen, np.uint8), []))
    return found


EMPTY: dict[str, Hardship] = {
    "as it is": list,
    "mirrored": mirrored,
    "twice as large": lambda shots: _warped(shots, 0, 2.0),
    "sharpened": _each(_sharp),
    "more contrast": _each(lambda image: np.asarray(cv2.convertScaleAbs(image, alpha=1.6, beta=-50), np.uint8)),
    "swept": _swept,
    "160 wide": lambda shots: _shrunk(shots, 160),
    "8 % light": _dim,
    "rolled 15": lambda shots: _warped(shots, 15, 1.0),
}
"""What makes scenes with nobody harder."""
