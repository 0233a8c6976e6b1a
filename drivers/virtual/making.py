"""From the keys of a robot file to virtual devices, each on a stage."""

from collections.abc import Callable
from dataclasses import asdict

from drivers.api import HeadPose, Pose2D
from drivers.arduino.declared import ArduinoKeys, SecondKeys, TwoServoKeys
from drivers.arduino.make import axis
from drivers.arduino.virtual import FIRST, VirtualRodney
from drivers.base.reckoning import TwoWheels
from drivers.head.axis import ServoAxis
from drivers.kobuki.declared import KobukiKeys
from drivers.kobuki.virtual import VirtualKobuki
from drivers.legs.body import body_of
from drivers.legs.declared import LegsKeys
from drivers.legs.kinematics import FootOdometry
from drivers.pi_car.declared import PiCarKeys, PiHeadKeys
from drivers.rplidar.declared import RPLidarKeys
from drivers.rplidar.virtual import VirtualLidar
from drivers.servos.declared import DynamixelKeys, NeckJointKeys, NeckKeys
from drivers.servos.virtual.chain import VirtualServoBus
from drivers.servos.virtual.servo import VirtualServo
from drivers.sim.scanner import looking
from drivers.sim.stage import Stage
from drivers.sim.world import World
from drivers.virtual.guardian import VirtualCar, VirtualServos
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


def pi_head(keys: PiHeadKeys, stage: Stage) -> Plugged:  # noqa: ARG001
    """Return a virtual pan/tilt on a PCA9685, whose chip has had power for long."""
    pan, tilt = axis(keys.pan), axis(keys.tilt)
    return _kept(VirtualServos((pan.awake, tilt.awake)), pan, tilt, "pan_tilt")


def _kept(device: VirtualServos, pan: ServoAxis, tilt: ServoAxis, wire: str) -> Plugged:
    """Return two servos in the hands of a keeper; its state are their degrees."""

    def looks(time: float) -> HeadPose:
        return HeadPose(pan.to_radians(device.angle(0, time)), tilt.to_radians(device.angle(1, time)))

    return Plugged(device, wire, looks=looks, state=lambda now: [device.angle(index, now) for index in range(2)])


def rodney(keys: ArduinoKeys, stage: Stage) -> Plugged:  # noqa: ARG001
    """Return a virtual Rodney head; its state are its four servos in degrees."""
    pan, tilt = axis(keys.pan), axis(keys.tilt)
    if keys.protocol == "lines":
        return _kept(VirtualServos((pan.awake, tilt.awake), baud=keys.baud), pan, tilt, "nano")
    own = {axis.index: axis.start for axis in (pan, tilt) if axis.start is not None}
    device = VirtualRodney(baud=keys.baud, logs=True, starts=[own.get(index, at) for index, at in enumerate(FIRST)])
    return Plugged(
        device,
        "nano",
        looks=_turned(device, keys),
        state=lambda now: [device.angle(index, now) for index in range(4)],
    )


def second_on_rodney(keys: SecondKeys, stage: Stage) -> Plugged:
    """Return a second pan/tilt on the board of a virtual Rodney head, whose wire it is on."""
    return Plugged(None, looks=_turned(stage.parts["head"].device, keys))


def _turned(device: VirtualRodney, keys: TwoServoKeys) -> Callable[[float], HeadPose]:
    pan, tilt = axis(keys.pan), axis(keys.tilt)

    def looks(time: float) -> HeadPose:
        return HeadPose(pan.to_radians(device.angle(pan.index, time)), tilt.to_radians(device.angle(tilt.index, time)))

    return looks


def servos(keys: DynamixelKeys, stage: Stage) -> Plugged:  # noqa: ARG001
    """Return a virtual bus of servos, each as its calibration says; its state are their angles in radians, by joint."""
    offsets = keys.offsets
    chain = []
    for name, joint in keys.servos.items():
        servo = VirtualServo(joint.id, model=joint.model, angle=joint.zero + offsets.get(name, 0) * joint.kind.tick)
        if name in offsets:
            servo.set("position_offset", offsets[name])
        chain.append(servo)
    bus = VirtualServoBus(chain, keys.baud)

    def state(_: float) -> object:
        # One servo a joint, whatever ID somebody has given it by now.
        return {name: servo.angle for name, servo in zip(keys.joints, bus.servos, strict=True)}

    return Plugged(bus, "servos", state=state)


def neck(keys: NeckKeys, stage: Stage) -> Plugged:
    """Return a head that is two joints of the arm, and sits on its wire."""
    arm: DynamixelKeys = stage.keys["arm"]
    bus: VirtualServoBus = stage.parts["arm"].device

    def angle(axis: NeckJointKeys) -> float:
        return _angle(bus, arm, axis.joint) - axis.trim

    return Plugged(None, looks=lambda _: HeadPose(angle(keys.pan), angle(keys.tilt)))


def _angle(bus: VirtualServoBus, arm: DynamixelKeys, name: str) -> float:
    """Return where a joint truly is, in its own angle."""
    joint = arm.servos[name]
    turned = bus.servo(joint.id).angle - joint.zero - arm.offsets.get(name, 0) * joint.kind.tick
    return -turned if joint.reverse else turned


def legs(keys: LegsKeys, stage: Stage) -> Plugged:
    """Return a base that walks on joints of the arm, and sits on its wire: where they truly are leads it."""
    arm: DynamixelKeys = stage.keys["arm"]
    bus: VirtualServoBus = stage.parts["arm"].device
    body = body_of(keys.body)
    led = FootOdometry(body, Pose2D(0.0, 0.0, 0.0) if stage.world is None else stage.world.start)

    def pose(_: float) -> Pose2D:
        return led.update(body.pose({name: _angle(bus, arm, name) for name in body.joints}))

    return Plugged(None, pose=pose, state=lambda now: asdict(pose(now)))


def lidar(keys: RPLidarKeys, stage: Stage) -> Plugged:
    """Return a virtual RPLIDAR, which sees the world from where the base truly is."""
    world = World() if stage.world is None else stage.world
    look = looking(world, keys.place, stage.pose, height=keys.position[2])
    return Plugged(VirtualLidar(look, model=keys.model, yaw=keys.yaw, seed=stage.seed), "rplidar")
