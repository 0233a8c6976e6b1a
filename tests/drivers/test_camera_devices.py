"""Listing cameras, on a system made of files and a device that answers as V4L2 does."""

import errno
import os
import struct
from pathlib import Path

import pytest

from drivers.finding.video import CSI_TROUBLE, CameraDevice, is_csi, list_devices

YUYV, MJPG, META = 0x56595559, 0x47504A4D, 0x4D455441


class Kernel:
    """Answers the three requests by the name of the device file that they come for."""

    def __init__(self) -> None:
        self.formats: dict[str, list[int]] = {}
        self.sizes: dict[int, list[tuple[int, int]]] = {YUYV: [(640, 480), (320, 240)], MJPG: [(1280, 720), (640, 480)]}
        self.broken = False

    def ioctl(self, number: int, request: int, data: bytearray) -> int:
        if self.broken:
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        name = Path(f"/proc/self/fd/{number}").readlink().name
        formats = self.formats.get(name, [])
        if request == 0x80685600:
            assert len(data) == 104
            capture = 0x04200001 if formats else 0x04A00000
            struct.pack_into("=16s32s32sIII", data, 0, b"uvcvideo", b"cam", b"usb", 0, 0x84A00001, capture)
        elif request == 0xC0405602:
            assert len(data) == 64
            index, kind = struct.unpack_from("=II", data)
            assert kind == 1
            self._end(index, formats)
            struct.pack_into("=I32sI", data, 8, 0, b"format", formats[index])
        elif request == 0xC02C564A:
            assert len(data) == 44
            index, form = struct.unpack_from("=II", data)
            if form == META:
                struct.pack_into("=7I", data, 8, 3, 16, 1920, 2, 16, 1080, 2)
                return 0
            self._end(index, self.sizes[form])
            struct.pack_into("=3I", data, 8, 1, *self.sizes[form][index])
        return 0

    @staticmethod
    def _end(index: int, entries: list[int] | list[tuple[int, int]]) -> None:
        if index >= len(entries):
            raise OSError(errno.EINVAL, "no more")


class Machine:
    def __init__(self, folder: Path) -> None:
        self.system, self.devices, self.kernel = folder / "sys", folder / "dev", Kernel()
        self.devices.mkdir()

    def plug_in(self, node: str, name: str, *formats: int) -> None:
        (self.system / node).mkdir(parents=True)
        (self.system / node / "name").write_text(f"{name}\n")
        (self.devices / node).touch()
        self.kernel.formats[node] = list(formats)

    def listed(self) -> list[CameraDevice]:
        return list_devices(self.system, self.devices, self.kernel.ioctl)


@pytest.fixture
def machine(tmp_path: Path) -> Machine:
    return Machine(tmp_path)


def test_cameras_are_listed_by_number_with_names_and_sizes(machine: Machine) -> None:
    machine.plug_in("video10", "Second: camera", YUYV)
    machine.plug_in("video0", "HD Webcam", YUYV, MJPG)
    assert machine.listed() == [
        CameraDevice(machine.devices / "video0", "HD Webcam", ((320, 240), (640, 480), (1280, 720))),
        CameraDevice(machine.devices / "video10", "Second: camera", ((320, 240), (640, 480))),
    ]


def test_node_without_pictures_is_left_out(machine: Machine) -> None:
    machine.plug_in("video0", "HD Webcam", YUYV)
    machine.plug_in("video1", "HD Webcam")
    assert [device.path.name for device in machine.listed()] == ["video0"]


def test_camera_with_continuous_sizes_lists_the_largest(machine: Machine) -> None:
    machine.plug_in("video0", "scaler", META)
    assert machine.listed()[0].sizes == ((1920, 1080),)


def test_camera_that_cannot_be_opened_is_listed_with_the_reason(machine: Machine) -> None:
    machine.plug_in("video0", "gone", YUYV)
    (machine.devices / "video0").unlink()
    assert machine.listed() == [CameraDevice(machine.devices / "video0", "gone", trouble="No such file or directory")]


def test_failing_camera_is_listed_with_the_reason(machine: Machine) -> None:
    machine.plug_in("video0", "ill", YUYV)
    machine.kernel.broken = True
    assert machine.listed()[0].trouble == "Input/output error"


def test_system_without_video_devices_has_no_cameras(machine: Machine) -> None:
    assert machine.listed() == []


@pytest.mark.parametrize(
    "names",
    [
        ["unicam-image", "unicam-embedded", "bcm2835-isp-output0", "bcm2835-isp-capture0"],
        ["rp1-cfe-csi2_ch0", "rp1-cfe-csi2_ch1", "rp1-cfe-fe_image0", "pispbe-input", "pispbe-output0"],
    ],
)
def test_csi_camera_of_a_raspberry_pi_is_listed_once_as_csi(machine: Machine, names: list[str]) -> None:
    for number, name in enumerate(names):
        machine.plug_in(f"video{number}", name, YUYV)
    machine.plug_in("video9", "HD Webcam", YUYV)
    csi, webcam = machine.listed()
    assert (csi.path.name, csi.csi, csi.trouble) == ("video0", True, CSI_TROUBLE)
    assert (webcam.path.name, webcam.csi, webcam.trouble) == ("video9", False, "")
    assert is_csi(machine.devices / "video0", machine.system)
    assert not is_csi(machine.devices / "video9", machine.system)
    (machine.devices / "by-id").mkdir()
    (machine.devices / "by-id/camera").symlink_to(machine.devices / "video1")
    assert is_csi(machine.devices / "by-id/camera", machine.system)
