"""From the keys of a robot file to virtual devices, each on a stage."""

from dataclasses import asdict

from drivers.base.reckoning import TwoWheels
from drivers.kobuki.declared import KobukiKeys
from drivers.kobuki.virtual import VirtualKobuki
from drivers.pi_car.declared import PiCarKeys
from drivers.sim.stage import Stage
from drivers.virtual.guardian import VirtualCar
from drivers.virtual.plugged import Plugged
from drivers.waveshare.declared import WaveshareKeys
from drivers.waveshare.virtual import VirtualWaveshare
from drivers.waveshare.wire import FULL


def kobuki(keys: KobukiKeys, stage: Stage) -> Plugged:  # noqa: ARG001 - all makers are called with both
    """Return a virtual Kobuki."""
    device = VirtualKobuki(wheels=stage.wheels(), ground=stage.world, battery=stage.physics.battery)

    def state(now: float) -> object:
        return asdict(device.pose(now)) | asdict(device.body.velocity)

    return Plugged(device, "kobuki", pose=device.pose, state=state)


def waveshare(keys: WaveshareKeys, stage: Stage) -> Plugged:
    """Return a virtual rover of Waveshare's."""
    unit = 1.0 if keys.encoders else FULL / keys.speed_at_full
    device = VirtualWaveshare(stage.body(), track=keys.track, unit=unit, encoders=keys.encoders, baud=keys.baud)

    def state(now: float) -> object:
        return asdict(device.pose(now)) | asdict(device.body.velocity)

    return Plugged(device, "rover", pose=device.pose, state=state)


def pi_car(keys: PiCarKeys, stage: Stage) -> Plugged:
    """Return a virtual car of a Raspberry Pi: who holds its motors."""
    device = VirtualCar(stage.body(), TwoWheels(keys.track, keys.speed_at_full))

    def state(now: float) -> object:
        return asdict(device.pose(now)) | asdict(device.body.velocity)

    return Plugged(device, "car", pose=device.pose, state=state)
