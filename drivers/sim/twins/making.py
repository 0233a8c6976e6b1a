"""From the keys of a robot file to twins, each on a stage."""

from drivers.api import Away
from drivers.api.sections import BaseKeys
from drivers.arduino.declared import ArduinoKeys, SecondKeys, TwoServoKeys
from drivers.arduino.make import axis as servo
from drivers.arduino.twin import HeadTwin
from drivers.base.arbitrated import settings_of
from drivers.base.plain_twin import PlainTwin
from drivers.base.reckoning import TwoWheels
from drivers.base.twin import BaseTwin
from drivers.legs.declared import LegsKeys
from drivers.legs.make import compensation, feeling, torques
from drivers.legs.make import engine as walking
from drivers.legs.twin import LegsTwin
from drivers.pi_car.declared import PiCarKeys, PiHeadKeys
from drivers.rplidar.declared import RPLidarKeys
from drivers.rplidar.twin import RangerTwin
from drivers.servos.declared import DynamixelKeys, NeckKeys
from drivers.servos.make import axis as joint
from drivers.servos.make import joints
from drivers.servos.neck_twin import NeckTwin
from drivers.servos.rigid_twin import RigidJoints
from drivers.servos.twin import JointsTwin
from drivers.sim.scanner import looking
from drivers.sim.stage import Stage
from drivers.sim.world import World
from drivers.waveshare.declared import WaveshareKeys
from drivers.waveshare.wire import FASTEST


def base(keys: BaseKeys, stage: Stage) -> BaseTwin:
    """Return the twin of a base on two wheels, of whatever make."""
    return BaseTwin(
        stage.clock,
        **settings_of(keys, stage),
        body=stage.body(),
        gyro_noise=stage.physics.gyro_noise,
        dropouts=stage.physics.dropouts,
        seed=stage.seed,
    )


def waveshare(keys: WaveshareKeys, stage: Stage) -> PlainTwin:
    """Return the twin of a rover of Waveshare's."""
    wheels = TwoWheels(keys.track, FASTEST if keys.encoders else keys.speed_at_full)
    return plain(wheels, keys, stage, reckoned=not keys.encoders)


def pi_car(keys: PiCarKeys, stage: Stage) -> PlainTwin:
    """Return the twin of a car of a Raspberry Pi."""
    return plain(TwoWheels(keys.track, keys.speed_at_full), keys, stage, reckoned=True, gauge=False)


def plain(
    wheels: TwoWheels, keys: BaseKeys, stage: Stage, *, reckoned: bool, gauge: bool = True, gyro: bool = False
) -> PlainTwin:
    """Return the twin of a base that feels nothing: with a pose that is dead reckoning, without a ``gauge`` perhaps."""
    return PlainTwin(
        stage.clock,
        wheels=wheels,
        reckoned=reckoned,
        gauge=gauge,
        gyro=gyro,
        body=stage.body(),
        dropouts=stage.physics.dropouts,
        seed=stage.seed,
        **settings_of(keys, stage),
    )


def legs(keys: LegsKeys, stage: Stage) -> LegsTwin:
    """Return the twin of a base that walks on the arm's twin."""
    joints, walks = stage.parts["arm"], walking(keys)
    twin = LegsTwin(
        joints,
        stage.clock,
        walks,
        felt=feeling(stage.parts.get("imu")),
        compensation=None if stage.scene is None else compensation(walks, joints),
        torques=torques(walks, joints),
        at_fall=keys.at_fall,
        tucked=keys.body.tucked,
        **settings_of(keys, stage),
    )
    if stage.world is not None:
        twin.start = stage.world.start
    return twin


def head(keys: ArduinoKeys | PiHeadKeys, stage: Stage) -> HeadTwin:
    """Return the twin of a head of hobby servos."""
    return _hobby(keys, keys.away, stage)


def _hobby(keys: TwoServoKeys, away: Away, stage: Stage) -> HeadTwin:
    return HeadTwin(
        stage.clock,
        pan=servo(keys.pan),
        tilt=servo(keys.tilt),
        speed=keys.speed,
        acceleration=keys.acceleration,
        away=away,
        report=stage.report,
        name=stage.part,
    )


def second_head(keys: SecondKeys, stage: Stage) -> HeadTwin:
    """Return the twin of a second pan/tilt on the board of a head."""
    board: ArduinoKeys = stage.keys["head"]
    return _hobby(keys, board.away, stage)


def arm(keys: DynamixelKeys, stage: Stage) -> JointsTwin:
    """Return the twin of an arm, whose servos carry the robot's body where there are physics."""
    if stage.scene is not None and stage.part == "arm":  # of which the body is made
        return RigidJoints(
            joints(keys), stage.clock, stage.scene, at_rest=keys.at_end, away=keys.away, report=stage.report
        )
    return JointsTwin(
        joints(keys), stage.clock, at_rest=keys.at_end, away=keys.away, report=stage.report, name=stage.part
    )


def neck(keys: NeckKeys, stage: Stage) -> NeckTwin:
    """Return the twin of a head that is two joints of the arm's twin."""
    return NeckTwin(
        stage.parts["arm"],
        stage.clock,
        pan=joint(keys.pan),
        tilt=joint(keys.tilt),
        speed=keys.speed,
        acceleration=keys.acceleration,
        report=stage.report,
        name=stage.part,
    )


def ranger(keys: RPLidarKeys, stage: Stage) -> RangerTwin:
    """Return the twin of a range finder, which sees the world from where the base truly is."""
    world = World() if stage.world is None else stage.world
    return RangerTwin(
        looking(world, keys.place, stage.pose, height=keys.position[2]),
        stage.clock,
        model=keys.model,
        place=keys.place,
        blind=keys.blind,
        report=stage.report,
        seed=stage.seed,
    )
