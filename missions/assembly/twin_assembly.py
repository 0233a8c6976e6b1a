"""Assembly of a robot from twins in one world, on one timeline and one thread."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from functools import partial
from math import inf
from random import Random
from typing import TYPE_CHECKING, Any, cast

from config.robot import RobotConfig, Section
from config.world import WorldConfig
from drivers.api import CameraFrame, Device, Image, Mood
from drivers.api.measures import Array
from drivers.api.sections import ScreenKeys, VoiceKeys
from drivers.api.sensor_sections import CameraKeys
from drivers.camera.twin import CameraTwin, black_like
from drivers.microphone.twin import HearingTwin
from drivers.screen.twin import ScreenTwin
from drivers.sim.context import SimContext
from drivers.sim.person_actions import PersonReply
from drivers.sim.timeline import Timeline
from drivers.sim.viewpoint import PinholeLens as Lens
from drivers.voice.twin import VoiceTwin
from missions.assembly.assembled_robot import AssembledRobot, RunEyes
from missions.assembly.face import FRAME_INTERVAL, MouthAnimation
from missions.assembly.half_duplex import HalfDuplex
from missions.assembly.part_factory import Hooks, gaze, make_parts, resolve_maker, with_carriers
from missions.assembly.simulated_eyes import Glimpse, SensorNoise, SteppedEyes, TrueSight
from missions.assembly.truth import TrueNames
from missions.assembly.twins import Twins
from missions.library.interests import Interests
from missions.library.worlds import build_physics, build_world
from perception.api import Gaze, Words
from perception.geometry import Pinhole
from perception.hearing.grammar import PhraseGrammar

if TYPE_CHECKING:
    from perception.eyes import Vision


# How a robot in simulated time deals with the people in its world: the twins of its voice, its ears and its face.


class Conversation:
    """Conversation of a robot with simulated people: makes its voice, ears and screen, and lets people answer.

    People and robot hear each other within earshot, unless an inner wall is in between. ``phrases`` are those that the
    robot listens for.
    """

    def __init__(self, twins: Twins, world: WorldConfig, hooks: Hooks, phrases: tuple[str, ...], seed: int) -> None:
        self._twins = twins
        self._world = world
        self._hooks = hooks
        self._phrases = phrases
        self._seed = seed

    def twin(self, kind: str, keys: Any) -> Device | None:
        """Return the simulated device for the kind "voice", "microphone" or "screen"; None for other kinds."""
        match kind:
            case "voice":
                return self._voice(keys)
            case "microphone":
                return self._microphone()
            case "screen":
                return self._screen(keys)
        return None

    def begin(self) -> None:
        """Schedule the phrases that people say without being addressed."""
        self._expect(self._twins.world.replies_between(-1.0, inf))

    def _voice(self, keys: VoiceKeys) -> VoiceTwin:
        clock, hooks = self._twins.timeline.clock, self._hooks
        return VoiceTwin(clock, self._say, default_style=keys.style, report=hooks.report, changed=hooks.on_change)

    def _microphone(self) -> HearingTwin[Words]:
        clock, hooks = self._twins.timeline.clock, self._hooks
        return HearingTwin(
            clock,
            PhraseGrammar.from_texts(self._phrases),
            Words,
            is_deaf=HalfDuplex(self._twins.parts.get("voice"), clock).may_be_own_speech,
            mishearing=self._world.physics.mishearing,
            seed=self._seed,
            report=hooks.report,
            changed=hooks.on_change,
        )

    def _screen(self, keys: ScreenKeys) -> ScreenTwin:
        timeline, voice = self._twins.timeline, self._twins.parts.get("voice")
        screen = ScreenTwin(timeline.clock, awake=Mood(keys.mood), report=self._hooks.report)
        if voice is not None:
            timeline.call_every(FRAME_INTERVAL, MouthAnimation(voice, screen, timeline.clock).step)
        return screen

    def _say(self, text: str) -> None:
        """Print a text, and schedule the answers of people."""
        twins = self._twins
        self._hooks.print_line(text)
        self._expect(twins.world.deliver_speech(text, twins.timeline.clock.now(), self._robot_position()))

    def _expect(self, replies: Iterable[PersonReply]) -> None:
        """Schedule each phrase in ``replies`` at its time on the timeline."""
        for reply in replies:
            self._twins.timeline.call_at(reply.time, partial(self._on_spoken, reply))

    def _on_spoken(self, reply: PersonReply) -> None:
        twins = self._twins
        self._hooks.on_answer(reply.speaker, reply.text)
        if twins.microphone is not None and twins.world.is_audible(
            reply.speaker, twins.timeline.clock.now(), self._robot_position()
        ):
            twins.microphone.on_reply(reply)

    def _robot_position(self) -> tuple[float, float]:
        pose = self._twins.pose()
        return pose.x, pose.y


PICTURE_INTERVAL = 0.08
"""Seconds between two searched pictures in simulated time, rendered or from the world: the rate of a small computer.

Eyes in real time skip pictures of a faster camera in the same way.
"""

DETECTION_DELAY = 0.03
"""Seconds from a picture to its percepts in simulated time, for rendered pictures and for percepts from the world."""

WHITE, BLACK = cast(Image, Array()), cast(Image, Array())
"""Placeholders without pixels for pictures that nothing searches: of an open and of a covered camera."""


def twin_robot(
    config: RobotConfig,
    chosen: frozenset[str],
    timeline: Timeline,
    world: WorldConfig,
    hooks: Hooks,
    *,
    interests: Interests,
    seed: int,
    truth: bool,
    physics: bool = False,
) -> tuple[Twins, AssembledRobot]:
    """Assemble simulated devices for the ``chosen`` parts of a robot on ``timeline``; return them, and the robot.

    With ``truth``, faces come from the world instead of pictures. With ``physics`` the robot is a body with masses.
    Raises BadRequest for a driver without a simulated device, and if physics is not available.
    """
    chosen = with_carriers(config, chosen)
    twins = Twins(timeline, build_world(world))
    if physics:
        # MuJoCo is 60 MB, which few runs need.
        from missions.assembly.physics import scene_of  # noqa: PLC0415

        twins.scene = scene_of(config, world, twins.world.start, seed)
    place = _TwinPartFactory(twins, config, world, hooks, interests, seed, truth=truth)
    robot, devices = make_parts(config, chosen, place)
    place.conversation.begin()
    steps = {part: step for part in twins.parts if (step := config.kind_of(part).step_order) is not None}
    for part in sorted(steps, key=lambda it: steps[it]):
        twin = twins.parts[part]
        timeline.call_every(twin.STEP_INTERVAL, twin.step)
    return twins, AssembledRobot(config.name, robot, devices, place.run_eyes)


class _TwinPartFactory:
    """Factory of the twins of one robot."""

    def __init__(
        self,
        twins: Twins,
        config: RobotConfig,
        world: WorldConfig,
        hooks: Hooks,
        interests: Interests,
        seed: int,
        *,
        truth: bool,
    ) -> None:
        self._twins = twins
        self._clock = twins.timeline.clock
        self._world = world
        self._hooks = hooks
        self._interests = interests
        self._seed = seed
        self._truth = truth
        self.conversation = Conversation(twins, world, hooks, interests.phrases, seed)
        self.run_eyes: RunEyes | None = None
        self._stage = SimContext(
            self._clock,
            twins.world,
            lambda _: twins.pose(),
            build_physics(world.physics),
            seed,
            hooks.report,
            hooks.on_change,
            hooks.on_steering,
            twins.parts,
            {kind: section.keys for kind, section in config.sections.items()},
            scene=twins.scene,
        )

    def make(self, kind: str, section: Section, devices: Mapping[str, Any]) -> tuple[Device, object]:  # noqa: ARG002
        parts = self._twins.parts
        if kind == "camera":
            sight = self._eyes(section.keys)
            return parts[kind], sight
        twin = self.conversation.twin(kind, section.keys)
        if twin is None:
            make = resolve_maker(section.driver.twin, section, "twin")
            twin = make(section.keys, replace(self._stage, part_name=kind))
        parts[kind] = twin
        return twin, twin

    def _eyes(self, keys: CameraKeys) -> "Vision | TrueSight":
        self._twins.place = keys.position
        upright = keys.upright()
        self._twins.lens = Lens(upright.width, upright.height, upright.field_of_view)
        sight, self.run_eyes = self.true_eyes() if self._truth else self.eyes(keys)
        return sight

    def camera(self, draw: Callable[[float], Image], black: Callable[[Image], Image] = black_like) -> CameraTwin:
        twins = self._twins
        twins.parts["camera"] = found = CameraTwin(
            draw,
            self._clock,
            field_of_view=twins.lens.field_of_view,
            report=self._hooks.report,
            dropouts=self._world.dropouts,
            seed=self._seed,
            black=black,
        )
        return found

    def eyes(self, keys: CameraKeys) -> "tuple[Vision, SteppedEyes[CameraFrame]]":
        """Return eyes that search rendered pictures of the world."""
        from drivers.sim.render import Renderer  # noqa: PLC0415 - numpy and OpenCV load for pictures alone
        from missions.assembly.eyes import vision  # noqa: PLC0415
        from missions.assembly.gallery import recogniser  # noqa: PLC0415
        from missions.assembly.models import face_detector  # noqa: PLC0415

        twins, hooks = self._twins, self._hooks
        renderer = Renderer(twins.world, twins.lens, noise=self._world.noise, seed=self._seed)
        camera = self.camera(lambda time: renderer.draw(twins.viewpoint(), time))
        sight = vision(
            self._gaze,
            self._clock,
            interests=self._interests,
            detector=face_detector(keys),
            lens=None,  # what draws the pictures is ideal
            field_of_view=twins.lens.field_of_view,
            report=hooks.report,
            seen=hooks.on_view,
            watched=hooks.on_frame,
            recogniser=recogniser(self._interests, hooks.report, drawn=self._world.people),
        )

        def take() -> CameraFrame | None:
            return camera.expose(self._clock.now())

        return sight, SteppedEyes(
            twins.timeline, take, sight.see, sight.looked, period=PICTURE_INTERVAL, delay=DETECTION_DELAY
        )

    def true_eyes(self) -> tuple[TrueSight, SteppedEyes[Glimpse]]:
        """Return eyes that take percepts from the world."""
        twins = self._twins
        lens = Pinhole(twins.lens.width, twins.lens.height, twins.lens.field_of_view)
        sight = TrueSight(
            twins.world,
            lambda _: twins.viewpoint(),
            self._gaze,
            lens,
            noise=SensorNoise(),
            seed=self._seed,
            on_view=self._hooks.on_view,
            interests=self._interests,
            names=self._true_names(),
        )
        newest = sight.glimpse(0.0, dark=True)

        def draw(time: float) -> Image:
            nonlocal newest
            newest = sight.glimpse(time)
            return WHITE

        camera = self.camera(draw, black=lambda _: BLACK)

        def take() -> Glimpse | None:
            frame = camera.expose(self._clock.now())
            if frame is None:
                return None
            if frame.image is not WHITE:
                return sight.glimpse(frame.stamp, dark=True)
            # A camera that hangs did not draw: what it shows is what was seen last.
            return replace(newest, stamp=frame.stamp, scene=replace(newest.scene, stamp=frame.stamp))

        return sight, SteppedEyes(
            twins.timeline, take, sight.see, sight.looked, period=PICTURE_INTERVAL, delay=DETECTION_DELAY
        )

    def _true_names(self) -> TrueNames | None:
        """Return the simulated face recogniser, or None if the mission does not use names of people."""
        if not self._interests.names:
            return None
        own = Random(f"names {self._seed}")  # noqa: S311 - which looks are mistaken is no secret
        return TrueNames(self._world.people, SensorNoise().mistaken, own)

    def _gaze(self, stamp: float) -> Gaze:
        parts = self._twins.parts
        return gaze(stamp, parts.get("base"), parts.get("head"))
