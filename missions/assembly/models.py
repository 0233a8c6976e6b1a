"""Trained models that are downloaded on request: their sources, checksums and folder."""

import hashlib
import os
import tempfile
from collections.abc import Callable, Mapping
from contextlib import closing
from pathlib import Path
from typing import BinaryIO

from drivers.api.fast_dataclass import dataclass
from drivers.api.sensor_sections import CameraKeys
from missions.library.folders import data_folder
from perception.face_finder import FaceDetector
from perception.haar_faces import HaarFaceDetector

SERVER_TIMEOUT = 30.0
"""Seconds without data from the server before a download fails."""

CHUNK_BYTES = 1 << 16


class FetchError(RuntimeError):
    """Failed download of a trained model; ``hint`` is the command to try next."""

    def __init__(self, message: str, *, hint: str = "") -> None:
        super().__init__(message)
        self.hint = hint


@dataclass(frozen=True, slots=True)
class ModelFile:
    """File of a model: its name, URL, SHA-256 in hexadecimal and size in bytes."""

    name: str
    summary: str
    file: str
    url: str
    sha256: str
    size: int


# Sum and size as the OpenCV Zoo publishes them in its repository (Git LFS, models/face_detection_yunet).
YUNET = ModelFile(
    "yunet",
    "Finds faces, also small, dark and turned ones (OpenCV Zoo, MIT licence).",
    "face_detection_yunet_2023mar.onnx",
    "https://github.com/opencv/opencv_zoo/raw/main/models/face_detection_yunet/face_detection_yunet_2023mar.onnx",
    "8f2383e4dd3cfbb4553ea8718107fc0423210dc964f9f4280604804ed2552fa4",
    232_589,
)

MODELS: Mapping[str, ModelFile] = {model.name: model for model in (YUNET,)}


def models_folder(environment: Mapping[str, str] = os.environ) -> Path:
    """Return the folder of models, in the user's data folder."""
    return data_folder(environment) / "models"


def is_fetched(model: ModelFile, where: Path) -> bool:
    """Return True if the file of a model exists in the folder ``where`` with the right checksum."""
    path = where / model.file
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest() == model.sha256
    except OSError:
        return False


def fetch(
    model: ModelFile, where: Path, *, url: str | None = None, on_progress: Callable[[int], None] = lambda _: None
) -> Path:
    """Download a model into the folder ``where`` and return its path; ``on_progress`` gets the number of bytes."""
    source = url or model.url
    if not source.startswith(("https://", "http://")):
        raise FetchError(f"{model.name}: '{source}' is not the address of a web server", hint="https://...")
    target = where / model.file
    try:
        where.mkdir(parents=True, exist_ok=True)
        number, name = tempfile.mkstemp(dir=where, prefix=f".{model.file}.")
    except OSError as error:
        raise FetchError(f"{where}: {error.strerror}", hint="XDG_DATA_HOME says where models are kept") from error
    part = Path(name)
    try:
        with os.fdopen(number, "wb") as file:
            _download(model, source, file, on_progress)
        part.chmod(0o644)
        part.replace(target)
    except OSError as error:
        raise FetchError(f"{target}: {error.strerror}", hint=f"df -h {where}  (is there room?)") from error
    finally:
        part.unlink(missing_ok=True)
    return target


def _download(model: ModelFile, source: str, file: BinaryIO, on_progress: Callable[[int], None]) -> None:
    """Write the server's data into ``file``. Raises FetchError if it cannot be the model."""
    # What speaks to servers takes a while to import, and a run only asks where models are kept.
    from http.client import HTTPException  # noqa: PLC0415
    from urllib.error import HTTPError, URLError  # noqa: PLC0415
    from urllib.request import urlopen  # noqa: PLC0415

    who, sum256, size = f"{model.name}: {source}", hashlib.sha256(), 0
    elsewhere = f"curl -LO {source}  (does it work elsewhere? then copy it to {models_folder()})"
    try:
        with closing(urlopen(source, timeout=SERVER_TIMEOUT)) as answer:  # noqa: S310 - a web address, see fetch
            while (chunk := answer.read(CHUNK_BYTES)) and size <= model.size:
                size += len(chunk)
                sum256.update(chunk)
                file.write(chunk)
                on_progress(size)
    except HTTPError as error:
        error.close()
        raise FetchError(f"{who}: the server says {error.code} {error.reason}", hint=elsewhere) from error
    except URLError as error:
        raise FetchError(f"{who}: cannot be reached: {error.reason}", hint=elsewhere) from error
    except (HTTPException, TimeoutError, ConnectionError) as error:
        raise FetchError(f"{who}: interrupted after {size} bytes: {error}", hint="type the same again") from error
    if sum256.hexdigest() != model.sha256:
        raise FetchError(
            f"{who}: is not the file that was published: {size} bytes with SHA-256 {sum256.hexdigest()}, "
            f"not {model.size} bytes with {model.sha256}",
            hint=f"mission robot models fetch {model.name}  (again, from another network)",
        )


# Which detector finds the faces: the one that the camera section of the robot file names.


def face_detector(camera: CameraKeys | None) -> FaceDetector:
    """Return the face detector of ``camera``, Haar by default; its file is read with the first picture."""
    if camera is None or camera.detector == "haar":
        return HaarFaceDetector()
    from perception.yunet import YuNetFaceDetector  # noqa: PLC0415 - most robots have no such file

    return YuNetFaceDetector(yunet_file(camera))


def yunet_file(camera: CameraKeys) -> Path:
    """Return the path of YuNet's file: from the robot file, or in the folder of `mission robot models fetch`."""
    named = camera.model if camera.detector == "yunet" else ""
    return Path(named).expanduser() if named else models_folder() / YUNET.file
