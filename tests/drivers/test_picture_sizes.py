"""How large pictures are, by their headers: no reader of pictures decodes what would take gigabytes."""

import os
import struct
import zlib
from collections.abc import Sequence
from contextlib import closing
from functools import partial
from io import BytesIO
from pathlib import Path

import cv2
import numpy as np
import pytest

from drivers.api import Camera
from drivers.camera.make import open_source
from drivers.camera.picture_files import iter_pictures
from drivers.clock import SystemClock
from drivers.errors import BadRequest
from drivers.pictures.decode import decode_picture, load_picture, picture_size
from missions.library.people import People, PeopleError
from tests.waiting import wait_until

KINDS = (".png", ".jpg", ".bmp", ".webp", ".gif", ".tiff", ".ppm", ".pgm")

OTHERS = {".jpg": [cv2.IMWRITE_JPEG_PROGRESSIVE, 1], ".webp": [cv2.IMWRITE_WEBP_QUALITY, 101]}
"""How some kinds are written in another way."""


def written(kind: str, width: int, height: int, options: Sequence[int] = ()) -> bytes:
    return cv2.imencode(kind, np.zeros((height, width, 1 if kind == ".pgm" else 3), np.uint8), options)[1].tobytes()


def empty_png(width: int, height: int) -> bytes:
    """Return a PNG without a light, of a bit a pixel: it can be decoded, and is a thousandth of what comes of it."""
    rows = zlib.compress(bytes(1 + (width + 7) // 8) * height, 9)
    header = struct.pack(">IIBBBBB", width, height, 1, 0, 0, 0, 0)
    chunks = ((b"IHDR", header), (b"IDAT", rows), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data)) for name, data in chunks
    )


def _refused(camera: Camera) -> bool:
    return "has 12000 x 12000 pixels" in camera.health().detail


def test_picture_header_gives_the_size() -> None:
    wrong = []
    for kind in KINDS:
        for width, height in ((64, 48), (3, 500), (1000, 1)):
            for options in ([], OTHERS.get(kind, [])):
                data = written(kind, width, height, options)
                found = picture_size(BytesIO(data))
                if found != (width, height) or decode_picture(data) is None:
                    wrong.append((kind, options, (width, height), found))
    assert wrong == []


def test_invalid_picture_header_gives_no_size() -> None:
    random = np.random.default_rng(0)
    for kind in KINDS:
        whole = written(kind, 64, 48)
        for length in range(len(whole)):
            assert picture_size(BytesIO(whole[:length])) in (None, (64, 48)), (kind, length)
        for _ in range(200):
            picture_size(BytesIO(whole[:8] + random.bytes(400)))
    assert decode_picture(b"") is decode_picture(b"a text") is None


def test_huge_picture_is_refused_by_every_reader(tmp_path: Path) -> None:
    path = tmp_path / "huge.png"
    path.write_bytes(empty_png(12_000, 12_000))
    words = r"huge\.png: has 12000 x 12000 pixels, above the limit of 50 million"
    with pytest.raises(BadRequest, match=words):
        load_picture(path)
    with pytest.raises(BadRequest, match=words):
        list(iter_pictures([tmp_path]))
    assert decode_picture(path.read_bytes()) is None
    film = tmp_path / "huge.mp4"  # FFmpeg tells by the content what it is
    film.write_bytes(path.read_bytes())
    with pytest.raises(BadRequest, match=r"huge\.mp4: has 12000 x 12000 pixels"):
        list(iter_pictures([film]))
    for source in (film, path):
        with closing(open_source(source, SystemClock(), retry=0.02)) as camera:
            camera.open()
            wait_until(partial(_refused, camera))


def test_film_with_huge_frames_is_refused_before_decoding(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("drivers.pictures.decode.MAX_PIXELS", 3000)
    monkeypatch.setattr("drivers.pictures.decode.grab_picture", None)
    film = tmp_path / "wide.avi"
    writer = cv2.VideoWriter(str(film), cv2.VideoWriter.fourcc(*"MJPG"), 5.0, (64, 48))
    writer.write(np.zeros((48, 64, 3), np.uint8))
    writer.release()
    with pytest.raises(BadRequest, match=r"wide\.avi: has 64 x 48 pixels"):
        list(iter_pictures([film]))


def test_pipe_is_refused_as_a_picture(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.png")
    with pytest.raises(BadRequest, match=r"pipe\.png: not a regular file"):
        load_picture(tmp_path / "pipe.png")


def test_huge_portrait_is_skipped(tmp_path: Path) -> None:
    people, told = People(tmp_path), list[PeopleError]()
    people.add("Anna", [np.full((20, 20, 3), level, np.uint8) for level in (1, 2, 3)])
    (tmp_path / "Anna/004.png").write_bytes(empty_png(4_000, 4_000))
    assert len(people.portraits(told.append)["Anna"]) == 3
    assert [str(each) for each in told] == [f"{tmp_path}/Anna/004.png: is not a portrait; it is skipped"]
