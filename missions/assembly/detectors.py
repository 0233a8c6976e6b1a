"""Which detector finds the faces: the one that the camera section of the robot file names."""

from pathlib import Path

from config.robot import CameraConfig
from missions.models import YUNET, folder
from perception.faces import HaarFaces
from perception.finder import FaceDetector
from perception.yunet import YuNetFaces


def face_detector(camera: CameraConfig | None) -> FaceDetector:
    """Return the detector of ``camera``, Haar where nothing is said; it reads its file when the first picture comes."""
    if camera is None or camera.detector == "haar":
        return HaarFaces()
    return YuNetFaces(Path(camera.model).expanduser() if camera.model else folder() / YUNET.file)
