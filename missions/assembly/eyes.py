"""Eyes of a robot: a camera, and the detectors that a mission needs."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import cv2

from config.colours import COLOURS
from config.robot import Section
from drivers.api import Base, Camera, DeviceStatus, Head, StatusCallback
from drivers.api.sensor_sections import CameraKeys
from drivers.camera.make import make
from drivers.camera.source import is_live
from drivers.clock import Clock
from drivers.errors import NotConnected
from missions.assembly.models import face_detector
from missions.assembly.part_factory import gaze
from missions.library.interests import Interests
from perception.api import Face, Frame, Gaze, Marker, Scene, Sight, Thing, ThingSpec, View, ignore
from perception.delay import CameraDelay
from perception.eyes import Eyes, Vision
from perception.face_finder import FaceDetector, FaceFinder
from perception.identity import FaceRecogniser, NamedFaceSense
from perception.scene_motion import MotionSense
from perception.senses import ActiveSenses, FaceSense, Sense
from perception.tracks import Tracker

if TYPE_CHECKING:
    from missions.assembly.assemble import RealPartFactory
    from perception.tracks import MarkerSet


class OnDemandSight:
    """View of the eyes that starts the detectors when a leaf reads percepts, and raises while the percepts are old.

    ``asks`` is a function that requests detection and returns True if the percepts are current. ``awake`` returns the
    same without requesting detection. While the percepts are not current, each read raises NotConnected, so that a leaf
    waits for the next pictures instead of seeing no face. ``passive_view`` never starts the detectors; it is for
    recorders.
    """

    def __init__(self, sight: Sight, asks: Callable[[], bool], awake: Callable[[], bool]) -> None:
        self._sight = sight
        self._asks = asks
        self._is_awake = awake

    @property
    def passive_view(self) -> "OnDemandSight":
        """View of the eyes that does not wake the detectors."""
        return OnDemandSight(self._sight, self._is_awake, self._is_awake)

    def faces(self) -> Sequence[Face]:
        return self._fresh_sight().faces()

    def things(self) -> Sequence[Thing]:
        return self._fresh_sight().things()

    def markers(self) -> Sequence[Marker]:
        return self._fresh_sight().markers()

    def looked(self) -> float | None:
        return self._fresh_sight().looked()

    def scene(self) -> Scene | None:
        return self._fresh_sight().scene()

    def _fresh_sight(self) -> Sight:
        if not self._asks():
            raise NotConnected("camera: detection was paused and has restarted")
        return self._sight


def real_eyes(factory: "RealPartFactory", section: Section, devices: Mapping[str, Any]) -> tuple[Camera, OnDemandSight]:
    """Return the camera of a robot (in a simulation, one that renders the world), and the percepts in its pictures."""
    overrides, hooks = factory.overrides, factory.hooks
    keys = _keys(factory, section)
    camera = _camera(factory, section, keys, devices)
    base: Base | None = devices.get("base")
    head: Head | None = devices.get("head")
    world = overrides.world
    if factory.simulation is None:
        cv2.setNumThreads(1)  # to share a small picture out among threads costs half as much again as to search it
    sight = vision(
        lambda stamp: gaze(stamp, base, head),
        factory.clock,
        interests=overrides.interests,
        detector=face_detector(keys),
        lens=keys.upright() if world is None else None,
        field_of_view=partial(keys.orientation.field_of_view, keys.field_of_view)
        if world is None
        else camera.field_of_view,
        report=hooks.report,
        seen=hooks.on_view,
        watched=hooks.on_frame,
        recogniser=_recogniser(factory, keys),
        delay=factory.lags.delay,
    )
    factory.eyes = eyes = Eyes(camera, sight)
    return camera, OnDemandSight(sight, eyes.wake, eyes.is_awake)


def _recogniser(factory: "RealPartFactory", keys: CameraKeys) -> FaceRecogniser | None:
    """Return the recogniser of people's faces, or None if the mission does not use names of people."""
    overrides, world = factory.overrides, factory.overrides.world
    if not overrides.interests.names:
        return None
    from missions.assembly.gallery import recogniser  # noqa: PLC0415 - most missions ask for no names

    return recogniser(
        overrides.interests,
        factory.hooks.report,
        camera=keys if world is None or overrides.camera is not None else None,
        drawn=() if world is None else world.people,
    )


def _keys(factory: "RealPartFactory", section: Section) -> CameraKeys:
    """Return the keys of the camera section, with the camera of ``--camera`` as source, if given.

    If ``--camera`` is a video or a picture, the keys for the mounting of the camera are reset, since files are upright.
    """
    keys: CameraKeys = section.keys
    source = factory.overrides.camera
    if source is None:
        return keys
    return replace(keys, source=source) if is_live(source) else replace(keys.upright(), source=source)


def _camera(factory: "RealPartFactory", section: Section, keys: CameraKeys, devices: Mapping[str, Any]) -> Camera:
    source, simulation = factory.overrides.camera, factory.simulation
    if simulation is not None and source is None:
        return simulation.rendered_camera(seed=factory.overrides.seed)
    if source is None:
        camera: Camera = factory.device(section, devices)
    else:  # whatever camera the robot has: a source is one of OpenCV's
        camera = make(keys, factory.site(section, {}))
    # A simulated head cannot turn a real camera, so its picture is turned instead.
    return camera if simulation is None else simulation.panned_camera(camera)


def vision(
    gaze: Callable[[float], Gaze | None],
    clock: Clock,
    *,
    interests: Interests,
    detector: FaceDetector,
    field_of_view: float | Callable[[int, int], float],
    lens: CameraKeys | None,
    report: StatusCallback,
    seen: Callable[[View], None],
    watched: Callable[[Frame, Gaze | None], None] = ignore,
    recogniser: FaceRecogniser | None = None,
    delay: CameraDelay | None = None,
) -> Vision:
    """Return the detection for a mission's ``interests`` in the pictures of a camera; ``detector`` finds faces.

    ``gaze`` returns the direction of the camera at a time. ``field_of_view`` is in radians, or a function of the width
    and height of a picture. ``lens`` is the lens calibration, None for an ideal lens. ``seen`` is called with the
    percepts of each picture, ``watched`` with the picture itself. ``recogniser`` names the faces. ``delay`` estimates
    the delay of the camera's time stamps.
    """
    finder = FaceFinder(detector)
    faces: Sense[Face] = FaceSense(finder, Tracker())
    senses = ActiveSenses(
        faces=(faces if recogniser is None else NamedFaceSense(faces, recogniser)) if interests.faces else None,
        things=_things(interests.objects) if interests.objects else None,
        markers=None if interests.markers is None else _markers(interests.markers),
        scene=MotionSense() if interests.motion else None,
    )
    return Vision(
        gaze,
        field_of_view=field_of_view,
        centre=(0.5, 0.5) if lens is None else lens.centre,
        distortion=() if lens is None else lens.distortion_coefficients,
        senses=senses,
        now=clock.now,
        delay=delay,
        on_resume=finder.reset,
        on_view=seen,
        on_frame=watched,
        on_trouble=lambda error: report(DeviceStatus("camera", "fault", f"a picture could not be searched: {error}")),
    )


def _things(wanted: tuple[ThingSpec, ...]) -> Sense[Thing]:
    from perception.colour_spots import ThingSense  # noqa: PLC0415 - most missions look for none

    return ThingSense(wanted, COLOURS)


def _markers(kind: "MarkerSet") -> Sense[Marker]:
    from perception.markers import MarkerSense  # noqa: PLC0415 - as above

    return MarkerSense(kind)
