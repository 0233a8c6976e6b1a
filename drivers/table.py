"""Table of the built-in drivers. A declaration is imported when its driver is requested."""

from collections.abc import Mapping

BUILT_IN_DRIVERS: Mapping[str, Mapping[str, str]] = {
    "ros2": {"zenoh": "drivers.ros2.declared:ZENOH"},
    "base": {
        "kobuki": "drivers.kobuki.declared:KOBUKI",
        "waveshare": "drivers.waveshare.declared:WAVESHARE",
        "pi_car": "drivers.pi_car.declared:PI_CAR",
        "ros2": "drivers.ros2.declared:BASE",
        "legs": "drivers.legs.declared:LEGS",
    },
    "head": {
        "arduino": "drivers.arduino.declared:ARDUINO",
        "arduino_second": "drivers.arduino.declared:SECOND",
        "dynamixel": "drivers.servos.declared:NECK",
        "pca9685": "drivers.pi_car.declared:PI_HEAD",
        "ros2": "drivers.ros2.declared:HEAD",
    },
    "arm": {
        "dynamixel": "drivers.servos.declared:ARM",
        "feetech": "drivers.servos.feetech:ARM",
        "ros2": "drivers.ros2.declared:ARM",
    },
    "imu": {"witmotion": "drivers.witmotion.declared:WITMOTION"},
    "range": {"rplidar": "drivers.rplidar.declared:RPLIDAR", "ros2": "drivers.ros2.declared:RANGE"},
    "camera": {"opencv": "drivers.camera.declared:OPENCV", "ros2": "drivers.ros2.declared:CAMERA"},
    "microphone": {
        "microphone": "drivers.microphone.declared:MICROPHONE",
        "file": "drivers.microphone.declared:FILE",
    },
    "voice": {
        "auto": "drivers.voice.declared:AUTO",
        "espeak": "drivers.voice.declared:ESPEAK",
        "program": "drivers.voice.declared:PROGRAM",
        "piper": "drivers.voice.declared:PIPER",
        "command": "drivers.voice.declared:COMMAND",
        "print": "drivers.voice.declared:PRINT",
        "ros2": "drivers.ros2.declared:VOICE",
    },
    "screen": {"page": "drivers.screen.declared:PAGE", "print": "drivers.screen.declared:PRINT"},
}
"""Dotted name of each driver's declaration, by kind and name."""
