"""Which detector finds the faces: the one that the camera section of the robot file names."""

from pathlib import Path

from drivers.api.senses import CameraKeys
from missions.assembly.models import YUNET, folder
from perception.faces import HaarFaces
from perception.finder import FaceDetector


def face_detector(camera: CameraKeys | None) -> FaceDetector:
    """Return the detector of ``camera``, Haar where nothing is said; it reads its file when the first picture comes."""
    if camera is None or camera.detector == "haar":
        return HaarFaces()
    from perception.yunet import YuNetFaces  # noqa: PLC0415 - most robots have no such file

    return YuNetFaces(yunet_file(camera))


def yunet_file(camera: CameraKeys) -> Path:
    """Return where YuNet's file is: as the robot file says, else where `mission models fetch` puts it."""
    named = camera.model if camera.detector == "yunet" else ""
    return Path(named).expanduser() if named else folder() / YUNET.file
