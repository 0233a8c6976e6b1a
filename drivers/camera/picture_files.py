"""Pictures and frames of files and folders, one by one, without a clock or a thread, for offline work."""

from collections.abc import Iterable, Iterator
from pathlib import Path

import cv2

from drivers.api import Image
from drivers.camera.source import PICTURES, VIDEOS
from drivers.errors import BadRequest
from drivers.pictures.decode import grab_picture, load_picture, open_video, silence_opencv

NumberedPicture = tuple[Path, int, Image]
"""Path of a picture or video file, number of a frame in the file (from 0), and the frame."""


def iter_pictures(paths: Iterable[str | Path]) -> Iterator[NumberedPicture]:
    """Yield every frame of the files at ``paths``; for a folder, of its pictures and videos, sorted by name.

    Raises BadRequest at once, naming all missing paths and empty folders. While iterating, it raises BadRequest for a
    file that cannot be decoded or is too large.
    """
    files: list[Path] = []
    faults: list[str] = []
    for path in map(Path, paths):
        found = _list_files(path)
        files += found
        if not found:
            faults.append(f"{path}: {'contains no pictures or videos' if path.is_dir() else 'no such file'}")
    if faults:
        raise BadRequest("; ".join(faults), hint=f"pictures and videos end in {' '.join(sorted(PICTURES | VIDEOS))}")
    return (picture for file in files for picture in _iter_frames(file))


def _list_files(path: Path) -> list[Path]:
    if path.is_dir():
        return sorted(file for file in path.iterdir() if file.suffix.lower() in PICTURES | VIDEOS)
    return [path] if path.is_file() else []


def _iter_frames(path: Path) -> Iterator[NumberedPicture]:
    if path.suffix.lower() in PICTURES:
        yield path, 0, load_picture(path)
        return
    number = -1
    for number, image in enumerate(_iter_video(path)):
        yield path, number, image
    if number < 0:
        raise BadRequest(
            f"{path}: cannot be decoded, {path.stat().st_size} bytes", hint=f"`file {path}` shows its type"
        )


def _iter_video(path: Path) -> Iterator[Image]:
    silence_opencv()
    video = open_video(str(path), cv2.CAP_FFMPEG, [], name=str(path))
    try:
        while (image := grab_picture(video)) is not None:
            yield image
    finally:
        video.release()
