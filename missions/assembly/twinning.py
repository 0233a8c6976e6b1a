"""From a robot file to twins: in one world, on one timeline, all in one thread."""

from collections.abc import Callable
from dataclasses import replace
from random import Random

import numpy as np

from behaviours.robot import Robot
from config.head import HeadConfig, NeckConfig
from config.robot import ArmConfig, BaseConfig, CameraConfig, RangeConfig, RobotConfig
from config.world import WorldConfig
from drivers.api import CameraFrame, Image
from drivers.sim.body import Body
from drivers.sim.render import Renderer
from drivers.sim.scanner import looking
from drivers.sim.timeline import Timeline
from drivers.sim.twins.base import BaseTwin
from drivers.sim.twins.camera import CameraTwin
from drivers.sim.twins.head import HeadTwin
from drivers.sim.twins.joints import JointsTwin
from drivers.sim.twins.neck import NeckTwin
from drivers.sim.twins.ranger import RangerTwin
from drivers.sim.viewpoint import Pinhole as Lens
from drivers.sim.wheels import Wheels
from missions.assembly import parts
from missions.assembly.assemble import Audience, gaze, with_carriers
from missions.assembly.assembled import Assembled, Looking
from missions.assembly.conversation import Conversation
from missions.assembly.detectors import face_detector
from missions.assembly.gallery import recogniser
from missions.assembly.interests import Interests
from missions.assembly.seeing import Flaws, Glimpse, SteppedEyes, TrueSight
from missions.assembly.truth_names import TrueNames
from missions.assembly.twins import Twins
from missions.assembly.worlds import build_battery, build_world
from perception.api import Gaze
from perception.eyes import Vision
from perception.geometry import Pinhole

PICTURE_PERIOD = 0.08
"""Seconds from one searched picture to the next, for eyes of either kind: what a small computer manages with this
detector. A camera that is quicker has its other pictures dropped by the real eyes too."""

SEEING_TIME = 0.03
"""Seconds from a picture to what it shows."""

WHITE: Image = np.full((1, 1, 3), 255, np.uint8)
"""What a camera takes for eyes that need no picture: covered, it is black."""


def twin_robot(
    config: RobotConfig,
    chosen: frozenset[str],
    timeline: Timeline,
    world: WorldConfig,
    audience: Audience,
    *,
    interests: Interests,
    seed: int,
    truth: bool,
) -> tuple[Twins, Assembled]:
    """Put together twins for the ``chosen`` parts of a robot, stepped by ``timeline``, and the robot that they make.

    With ``truth``, faces are known from the world instead of being searched for in pictures.
    """
    chosen = with_carriers(config, chosen)
    twins = Twins(timeline, build_world(world))
    make = _Maker(twins, world, config.camera, audience, interests, seed)
    if config.base is not None and "base" in chosen:
        twins.base = make.base(config.base)
    if config.arm is not None and "arm" in chosen:
        twins.arm = make.arm(config.arm)
    if isinstance(config.head, HeadConfig) and "head" in chosen:
        twins.head = make.head(config.head)
    elif isinstance(config.head, NeckConfig) and twins.arm is not None and "head" in chosen:
        twins.head = make.neck(config.head, twins.arm)
    Conversation(twins, world, audience, interests.phrases, seed).give(config, chosen)
    for twin in (twins.base, twins.head, twins.arm, twins.voice, twins.microphone):
        if twin is not None:
            timeline.every(twin.PERIOD, twin.step)
    if config.range is not None and "range" in chosen:
        twins.range = make.ranger(config.range)
        timeline.every(twins.range.period, twins.range.step)
    sight: Vision | TrueSight | None = None
    eyes: Looking | None = None
    if config.camera is not None and "camera" in chosen:
        twins.place = config.camera.position
        twins.lens = Lens(config.camera.width, config.camera.height, config.camera.field_of_view)
        sight, eyes = make.true_eyes() if truth else make.eyes()
    robot = Robot(
        base_part=twins.base,
        head_part=twins.head,
        arm_part=twins.arm,
        ranger_part=twins.range,
        voice_part=twins.voice,
        sight_part=sight,
        hearing_part=twins.microphone,
        screen_part=twins.screen,
        eye=parts.eye(config),
        groups={} if config.arm is None else config.arm.groups,
    )
    return twins, Assembled(config.name, robot, twins.devices, eyes)


class _Maker:
    """Makes the twins of one robot."""

    def __init__(
        self,
        twins: Twins,
        world: WorldConfig,
        camera: CameraConfig | None,
        audience: Audience,
        interests: Interests,
        seed: int,
    ) -> None:
        self._twins = twins
        self._clock = twins.timeline.clock
        self._world = world
        self._audience = audience
        self._interests = interests
        self._camera = camera
        self._seed = seed

    def base(self, config: BaseConfig) -> BaseTwin:
        world, physics = self._twins.world, self._world.physics
        wheels = Wheels(dead_time=physics.lag, slip=physics.slip, pose=world.start)
        return BaseTwin(
            self._clock,
            max_linear=config.max_speed,
            max_angular=config.max_turn,
            linear_acceleration=config.acceleration,
            angular_acceleration=config.turn_acceleration,
            reflexes=parts.reflexes(config),
            away=parts.away(config.away),
            report=self._audience.report,
            changed=self._audience.changed,
            steered=self._audience.steered,
            body=Body(wheels=wheels, ground=world, battery=build_battery(physics)),
            gyro_noise=physics.gyro_noise,
            dropouts=physics.dropouts,
            seed=self._seed,
        )

    def head(self, config: HeadConfig) -> HeadTwin:
        pan, tilt = parts.axis(config.pan), parts.axis(config.tilt)
        return HeadTwin(
            self._clock,
            pan=pan,
            tilt=tilt,
            speed=config.speed,
            acceleration=config.acceleration,
            away=parts.away(config.away),
            report=self._audience.report,
        )

    def neck(self, config: NeckConfig, arm: JointsTwin) -> NeckTwin:
        return NeckTwin(
            arm,
            self._clock,
            pan=parts.joint_axis(config.pan),
            tilt=parts.joint_axis(config.tilt),
            speed=config.speed,
            acceleration=config.acceleration,
            report=self._audience.report,
        )

    def arm(self, config: ArmConfig) -> JointsTwin:
        joints = parts.joints(config)
        return JointsTwin(
            joints,
            self._clock,
            at_rest=parts.at_rest(config),
            away=parts.away(config.away),
            report=self._audience.report,
        )

    def ranger(self, config: RangeConfig) -> RangerTwin:
        place, twins = parts.place(config), self._twins
        look = looking(twins.world, place, lambda _: twins.pose(), height=config.position[2])
        return RangerTwin(
            look,
            self._clock,
            model=config.model,
            place=place,
            blind=config.blind,
            report=self._audience.report,
            seed=self._seed,
        )

    def camera(self, draw: Callable[[float], Image]) -> CameraTwin:
        twins = self._twins
        twins.camera = CameraTwin(
            draw,
            self._clock,
            field_of_view=twins.lens.field_of_view,
            report=self._audience.report,
            dropouts=self._world.dropouts,
            seed=self._seed,
        )
        return twins.camera

    def eyes(self) -> tuple[Vision, SteppedEyes[CameraFrame]]:
        """Return eyes that search pictures of the world."""
        twins, audience = self._twins, self._audience
        renderer = Renderer(twins.world, twins.lens, noise=self._world.noise, seed=self._seed)
        camera = self.camera(lambda time: renderer.draw(twins.viewpoint(), time))
        vision = parts.vision(
            self._gaze,
            self._clock,
            interests=self._interests,
            detector=face_detector(self._camera),
            lens=None,  # what draws the pictures is ideal
            field_of_view=twins.lens.field_of_view,
            report=audience.report,
            seen=audience.seen,
            watched=audience.watched,
            recogniser=recogniser(self._interests, audience.report, drawn=self._world.people),
        )

        def take() -> CameraFrame | None:
            return camera.expose(self._clock.now())

        return vision, SteppedEyes(
            twins.timeline, take, vision.see, vision.looked, period=PICTURE_PERIOD, delay=SEEING_TIME
        )

    def true_eyes(self) -> tuple[TrueSight, SteppedEyes[Glimpse]]:
        """Return eyes that know who is in view."""
        twins = self._twins
        lens = Pinhole(twins.lens.width, twins.lens.height, twins.lens.field_of_view)
        sight = TrueSight(
            twins.world,
            lambda _: twins.viewpoint(),
            self._gaze,
            lens,
            flaws=Flaws(),
            seed=self._seed,
            on_view=self._audience.seen,
            interests=self._interests,
            names=self._true_names(),
        )
        newest = sight.glimpse(0.0, dark=True)

        def draw(time: float) -> Image:
            nonlocal newest
            newest = sight.glimpse(time)
            return WHITE

        camera = self.camera(draw)

        def take() -> Glimpse | None:
            frame = camera.expose(self._clock.now())
            if frame is None:
                return None
            if frame.image is not WHITE:
                return sight.glimpse(frame.stamp, dark=True)
            # A camera that hangs did not draw: what it shows is what was seen last.
            return replace(newest, stamp=frame.stamp, scene=replace(newest.scene, stamp=frame.stamp))

        return sight, SteppedEyes(
            twins.timeline, take, sight.see, sight.looked, period=PICTURE_PERIOD, delay=SEEING_TIME
        )

    def _true_names(self) -> TrueNames | None:
        """Return what knows whose faces they are; None where the mission does not ask for names."""
        if not self._interests.names:
            return None
        own = Random(f"names {self._seed}")  # noqa: S311 - which looks are mistaken is no secret
        return TrueNames(self._world.people, Flaws().mistaken, own)

    def _gaze(self, stamp: float) -> Gaze:
        return gaze(stamp, self._twins.base, self._twins.head)
