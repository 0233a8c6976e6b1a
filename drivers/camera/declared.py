"""Declaration of the camera drivers for devices, video files, picture folders and network addresses."""

from drivers.api.driver import Driver
from drivers.api.sensor_sections import CameraKeys

OPENCV = Driver(
    "opencv",
    "camera",
    "A camera, a video, pictures or an address, as OpenCV reads them.",
    CameraKeys,
    make="drivers.camera.make:make",
    checkup="drivers.camera.checkup:checkup",
)
