"""Declaration and keys of WitMotion's IMUs."""

from drivers.api.driver import Driver
from drivers.api.keys import keys
from drivers.api.sections import ImuKeys, SerialKeys


@keys
class WitMotionKeys(ImuKeys, SerialKeys):
    """Keys of a WitMotion IMU, which must be set to 115200 baud."""


WITMOTION = Driver(
    "witmotion",
    "imu",
    "An IMU of WitMotion's: JY901, WT901, BWT901.",
    WitMotionKeys,
    make="drivers.witmotion.driver:make",
    twin="drivers.witmotion.twin:imu",
    virtual="drivers.witmotion.virtual:imu",
    probe="drivers.witmotion.probe:probe",
)
