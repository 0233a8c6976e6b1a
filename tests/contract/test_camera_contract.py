"""What ``drivers.api.Camera`` promises, kept by the driver over a feed and over ROS 2, by the renderer and the twin."""

from collections.abc import Callable, Iterator
from math import radians
from threading import Event

import numpy as np
import pytest

from drivers.api import Camera, CameraFrame, Image
from drivers.api.driver import DriverContext
from drivers.camera.twin import CameraTwin
from drivers.clock import Clock
from drivers.errors import NotConnected
from drivers.pictures.capture import ThreadedCamera
from drivers.pictures.decode import SKIPPED_PICTURE
from drivers.ros2.declared import Ros2CameraKeys, ZenohKeys
from drivers.ros2.make import camera as make_camera
from drivers.ros2.make import graph as make_graph
from drivers.ros2.virtual import Ros2Terminal, RouterSettings, free_address
from drivers.ros2.virtual_topics import VirtualPictures
from drivers.sim.rendered_camera import RenderedCamera
from drivers.sim.viewpoint import Viewpoint
from drivers.sim.world import SimulatedWorld
from tests.contract.rigs import InRealTime, InSimulatedTime, Rig

PERIOD = 0.02
FIELD_OF_VIEW = radians(50)


def picture(time: float) -> Image:
    """A small picture that tells its time by its brightness."""
    return np.full((12, 16, 3), 20 + round(100 * time) % 200, np.uint8)


class Cable:
    """A ``Feed`` of pictures that may be unplugged."""

    source_name = "/dev/video9"
    hint = "`mission ports` lists the cameras that are there"

    def __init__(self, clock: Clock) -> None:
        self.plugged = True
        self._clock = clock

    def start(self, closing: Event) -> float | None:  # noqa: ARG002 - it waits for nothing
        if not self.plugged:
            raise NotConnected(f"camera: {self.source_name}: no such device", hint=self.hint)
        return None

    def grab(self, skip_count: Callable[[], int]) -> Image | None:
        Event().wait(PERIOD)
        if not self.plugged:
            return None
        return SKIPPED_PICTURE if skip_count() else picture(self._clock.now())

    def stop(self) -> None:
        """Hold nothing that would have to be let go."""


class CameraRig(Rig):
    device: Camera

    def frame(self) -> CameraFrame:
        """Wait for the next frame."""
        found: list[CameraFrame] = []

        def came() -> bool:
            frame = self.device.read(0.0)
            found.extend([] if frame is None else [frame])
            return bool(found)

        self.until(came)
        return found[0]

    def close(self) -> None:
        self.device.close()


class ThreadedRig(InRealTime, CameraRig):
    def __init__(self) -> None:
        super().__init__()
        self.cable = Cable(self.clock)
        self.device = ThreadedCamera(
            lambda: self.cable,
            self.clock,
            name="camera",
            field_of_view=FIELD_OF_VIEW,
            loop=False,
            retry=0.05,
            report=self.notices.append,
        )

    def unplug(self) -> None:
        self.cable.plugged = False

    def plug_in(self) -> None:
        self.cable.plugged = True


class TopicRig(InRealTime, CameraRig):
    """Its pictures come by ROS 2, from behind a router on loopback."""

    def __init__(self) -> None:
        super().__init__()
        self.robot = Ros2Terminal(RouterSettings(0, "", free_address()), self.clock)
        self.robot.devices.append(VirtualPictures(picture, "/image", rate=1 / PERIOD))
        self.robot.open()
        self.nodes = make_graph(ZenohKeys(router=self.robot.path, domain=0), DriverContext(self.clock))
        self.nodes.open()
        self.until(lambda: self.nodes.offers("/image"))
        site = DriverContext(self.clock, report=self.notices.append, needed_parts={"ros2": self.nodes})
        self.device = make_camera(Ros2CameraKeys(image="/image", field_of_view=FIELD_OF_VIEW), site)

    def unplug(self) -> None:
        self.robot.unplug()

    def plug_in(self) -> None:
        self.robot.replug()

    def close(self) -> None:
        super().close()
        self.nodes.close()
        self.robot.close()


class RenderedRig(InRealTime, CameraRig):
    def __init__(self) -> None:
        super().__init__()
        self.device = RenderedCamera(
            SimulatedWorld(),
            lambda _: Viewpoint(z=1.0),
            self.clock,
            rate=1 / PERIOD,
            size=(64, 48),
            field_of_view=FIELD_OF_VIEW,
        )

    def unplug(self) -> None:
        raise NotImplementedError("it has no plug")

    def plug_in(self) -> None:
        raise NotImplementedError("it has no plug")


class TwinRig(InSimulatedTime, CameraRig):
    def __init__(self) -> None:
        super().__init__()
        self.twin = CameraTwin(
            picture, self.clock, rate=1 / PERIOD, field_of_view=FIELD_OF_VIEW, report=self.notices.append
        )
        self.device = self.twin

    def unplug(self) -> None:
        self.twin.plug.unplug()

    def plug_in(self) -> None:
        self.twin.plug.plug_in()


PLUGGED: dict[str, type[CameraRig]] = {"threaded": ThreadedRig, "ros2": TopicRig, "twin": TwinRig}
ALL = {**PLUGGED, "rendered": RenderedRig}


@pytest.fixture(params=[*ALL.values()], ids=[*ALL])
def camera(request: pytest.FixtureRequest) -> Iterator[CameraRig]:
    rig: CameraRig = request.param()
    yield rig
    rig.close()


@pytest.fixture(params=[*PLUGGED.values()], ids=[*PLUGGED])
def plugged(request: pytest.FixtureRequest) -> Iterator[CameraRig]:
    """A camera with a plug, which is open and shows something."""
    rig: CameraRig = request.param()
    rig.device.open()
    rig.frame()
    yield rig
    rig.close()


def test_unopened_camera_is_offline_and_gives_no_picture(camera: CameraRig) -> None:
    health = camera.device.health()
    assert (health.online, health.detail != "") == (False, True)
    assert camera.device.read(0.01) is None
    assert camera.device.field_of_view == FIELD_OF_VIEW
    camera.device.rest()
    camera.device.close()


def test_pictures_are_in_order_with_increasing_stamps(camera: CameraRig) -> None:
    opened = camera.clock.now()
    camera.device.open()
    camera.device.open()
    frames = [camera.frame() for _ in range(5)]
    assert frames[0].number == 0
    numbers, stamps = [frame.number for frame in frames], [frame.stamp for frame in frames]
    assert numbers == sorted(set(numbers))
    assert stamps == sorted(set(stamps))
    assert opened <= stamps[0] < stamps[-1] <= camera.clock.now()
    assert all(frame.image.ndim == 3 and frame.image.dtype == np.uint8 for frame in frames)
    health = camera.device.health()
    assert (health.online, health.detail, health.hint) == (True, "", "")
    assert health.counters["frames"] >= 5


def test_the_same_picture_is_not_given_twice(camera: CameraRig) -> None:
    camera.device.open()
    first = camera.frame()
    second = camera.device.read(0.0)
    assert second is None or second.number > first.number


@pytest.mark.real_time
def test_newest_picture_is_read_and_unread_ones_are_dropped(camera: CameraRig) -> None:
    camera.device.open()
    first = camera.frame()
    camera.wait(10 * PERIOD)
    second = camera.frame()
    assert second.number > first.number + 2
    assert camera.clock.now() - second.stamp <= 5 * PERIOD
    assert camera.device.health().counters["dropped"] >= 2


def test_closed_camera_gives_no_picture_and_restarts_at_number_0(camera: CameraRig) -> None:
    camera.device.open()
    camera.until(lambda: camera.frame().number >= 10)
    camera.device.close()
    camera.device.close()
    assert camera.device.read(0.01) is None
    assert not camera.device.health().online
    opened = camera.clock.now()
    camera.device.open()
    assert camera.frame().number <= (camera.clock.now() - opened) / PERIOD


def test_unplugged_camera_gives_the_reason_and_resumes_once_replugged(plugged: CameraRig) -> None:
    assert [notice.kind for notice in plugged.notices] == ["online"]
    plugged.unplug()
    plugged.until(lambda: plugged.told("offline"))
    health = plugged.device.health()
    assert (health.online, health.detail != "", health.hint != "") == (False, True, True)
    assert plugged.notices[-1].hint
    plugged.notices.clear()
    plugged.device.read(0.0)
    assert plugged.device.read(0.01) is None
    plugged.plug_in()
    plugged.until(lambda: plugged.told("online"))
    assert plugged.frame().image.any()
