"""Feetech STS servos as the driver of an arm, and its keys in a robot file."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Literal

from drivers.api.driver import Driver
from drivers.api.keys import KeyDiagnostic, key, keys
from drivers.errors import BadRequest
from drivers.servos.calibration import MotorCalibration, load_calibration
from drivers.servos.declared import UNSUPPORTED_HINT, DynamixelKeys, JointKeys
from drivers.servos.models import MODELS

STS_MODELS = tuple(name for name, model in MODELS.items() if model.protocol == "STS")
"""Feetech models that the driver supports."""


@keys
class FeetechJointKeys(JointKeys):
    """Keys of a joint that a Feetech servo turns: the servo, its mounting, and the limits of the joint."""

    written_model: str = key(
        default="STS3215", among=STS_MODELS, word="model", hint=UNSUPPORTED_HINT, help="The model of the servo."
    )
    zero_at: Literal["middle", "lowest", "highest"] = key(
        default="middle", help="Position of the joint's 0 in its calibrated range, unless `zero` is set."
    )

    def with_calibration(self, calibration: MotorCalibration) -> "FeetechJointKeys":
        """Return these keys with missing values taken from ``calibration``; keys of the robot file override it."""
        if self.ticks is not None:
            return self
        model, turned = (
            self.servo_model,
            bool(calibration.drive_mode) if self.written_reverse is None else self.written_reverse,
        )
        ends = [model.angle(end) for end in (calibration.range_min, calibration.range_max)]
        lowest, highest = reversed(ends) if turned else ends
        zero = {"middle": sum(ends) / 2, "lowest": lowest, "highest": highest}[self.zero_at]
        zero = zero if self.written_zero is None else self.written_zero
        lower, upper = sorted((end - zero) * (-1 if turned else 1) for end in ends)
        return replace(self, written_reverse=turned, written_zero=zero, limits=self.limits or (lower, upper))


@keys
class FeetechKeys(DynamixelKeys):
    """The ``arm`` section of a robot with Feetech servos on one bus."""

    joints: Mapping[str, FeetechJointKeys] = key(help="The servos, by the names of their joints.", each="joint")
    calibration: str = key(
        default="",
        help="Calibration file of LeRobot: zero and range of each joint, by name.",
    )

    @property
    def calibrations(self) -> Mapping[str, MotorCalibration]:
        """Calibrations by motor; empty without a calibration file. Raises BadRequest for an invalid one."""
        return load_calibration(self.calibration) if self.calibration else {}

    @property
    def servos(self) -> Mapping[str, FeetechJointKeys]:
        """Joints as the driver uses them, with calibration."""
        found = self.calibrations
        return {
            name: each.with_calibration(found[name]) if name in found else each for name, each in self.joints.items()
        }

    @property
    def offsets(self) -> Mapping[str, int]:
        """Position offsets (steps) that the servos must have, by joint, from the calibration file."""
        return {name: each.homing_offset for name, each in self.calibrations.items() if name in self.joints}

    def diagnostics(self) -> Iterator[KeyDiagnostic]:
        """Yield the diagnostics of DynamixelKeys, errors of the calibration file, and limits beyond its ranges."""
        at = ("calibration",)
        try:
            found = self.calibrations
        except BadRequest as error:
            yield KeyDiagnostic(str(error), at, hint=error.hint)
            return
        for name, joint in self.joints.items():
            if found and name not in found:
                yield KeyDiagnostic(
                    f"calibration {self.calibration} has no motor '{name}'", at, unknown_word=name, known_words=found
                )
            elif found and found[name].id != joint.id:
                told = f"calibration {self.calibration}: motor '{name}': 'id' is {found[name].id}"
                yield KeyDiagnostic(f"{told}, and joint '{name}' has {joint.id}", ("joints", name), marks_key=True)
        yield from DynamixelKeys.diagnostics(self)
        for name, joint in self.servos.items():
            if name in found:
                yield from (replace(each, at=("joints", name, *each.at)) for each in joint.diagnostics())


ARM = Driver(
    "feetech",
    "arm",
    "Feetech STS servos on one bus, as in the SO-100 and SO-101.",
    FeetechKeys,
    make="drivers.servos.make:arm",
    twin="drivers.servos.twin:make",
    virtual="drivers.servos.virtual.chain:make",
    probe="drivers.servos.feetech_probe:probe",
    checkup="drivers.servos.checkup:checkup",
    usb=("1a86:55d3", "1a86:7523"),
)
