"""Declaration of the RPLIDAR driver, and the keys of its section in a robot file."""

from drivers.api.driver import Driver
from drivers.api.keys import key, keys
from drivers.api.sections import RangeKeys, SerialKeys
from drivers.rplidar.models import MODELS


@keys
class RPLidarKeys(RangeKeys, SerialKeys):
    """Keys of the ``range`` section of a robot file for an RPLIDAR."""

    model: str = key(default="a1", among=MODELS, help="The model.")


RPLIDAR = Driver(
    "rplidar",
    "range",
    "An RPLIDAR A1 or A2.",
    RPLidarKeys,
    make="drivers.rplidar.make:make",
    twin="drivers.rplidar.twin:make",
    virtual="drivers.rplidar.virtual:make",
    probe="drivers.rplidar.probe:probe",
    checkup="drivers.rplidar.checkup:checkup",
    usb=("10c4:ea60",),
)
