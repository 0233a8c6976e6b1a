"""Connected cameras, with names and picture sizes, by the Linux video interface (V4L2).

The requests and their structures are those of <linux/videodev2.h>.
"""

import errno
import fcntl
import os
import struct
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

Ioctl = Callable[[int, int, bytearray], object]
"""``fcntl.ioctl`` or a replacement: modifies the bytes, and raises OSError if the device refuses."""

SYSTEM_FOLDER = Path("/sys/class/video4linux")
DEVICE_FOLDER = Path("/dev")

_QUERYCAP, _QUERYCAP_SIZE = 0x80685600, 104
_ENUM_FMT, _ENUM_FMT_SIZE = 0xC0405602, 64
_ENUM_FRAMESIZES, _ENUM_FRAMESIZES_SIZE = 0xC02C564A, 44
_CAPTURE, _HAS_DEVICE_CAPS = 0x1, 0x80000000
_BUFFER_CAPTURE = 1
_DISCRETE = 1
_MAX_ENTRIES = 64  # of formats and of sizes: a device with an endless list must not block


CSI_RECEIVERS = ("unicam", "rp1-cfe")
"""Prefixes of the names of devices that receive the raw data of a CSI camera, on a Raspberry Pi up to 4, and 5."""

CSI_PROCESSORS = ("bcm2835-isp", "pispbe")
"""Prefixes of the names of devices that process the raw data, for libcamera only."""

CSI_TROUBLE = "a camera of the CSI connector, which OpenCV cannot read: libcamera alone can"

CSI_SOURCE = "tcp://127.0.0.1:8888"

CSI_HINT = (
    f"rpicam-vid -t 0 -n --codec mjpeg --width 640 --height 480 --listen -o {CSI_SOURCE}"
    f"  and `source: {CSI_SOURCE}` (docs/cameras.md)"
)


@dataclass(frozen=True, slots=True)
class CameraDevice:
    """Camera: its ``path``, its ``name``, and its picture sizes (width, height), in rising order.

    ``trouble`` is the reason why the sizes could not be read, or empty. ``csi`` is True for a camera on the CSI
    connector of a Raspberry Pi, which OpenCV cannot read.
    """

    path: Path
    name: str
    sizes: tuple[tuple[int, int], ...] = ()
    trouble: str = ""
    csi: bool = False


def list_devices(
    system: Path = SYSTEM_FOLDER, devices: Path = DEVICE_FOLDER, ioctl: Ioctl = fcntl.ioctl
) -> list[CameraDevice]:
    """Return the cameras in the order of their numbers, without devices that give no pictures.

    A webcam has two devices or more: its pictures, and metadata. Empty without V4L2.
    """
    if not system.is_dir():
        return []
    entries = sorted(system.glob("video*"), key=lambda entry: (len(entry.name), entry.name))
    cameras, received = list[CameraDevice | None](), set[str]()
    for entry in entries:
        name, path = _name(entry), devices / entry.name
        if receiver := next((each for each in CSI_RECEIVERS if name.startswith(each)), ""):
            if receiver not in received:  # one has several devices
                cameras.append(CameraDevice(path, name, trouble=CSI_TROUBLE, csi=True))
            received.add(receiver)
        elif not name.startswith(CSI_PROCESSORS):
            cameras.append(_query_camera(path, name, ioctl))
    return [device for device in cameras if device is not None]


def is_csi(path: Path, system: Path = SYSTEM_FOLDER) -> bool:
    """Return whether a device is a CSI camera, which OpenCV cannot read."""
    return _name(system / path.resolve().name).startswith((*CSI_RECEIVERS, *CSI_PROCESSORS))


def _name(entry: Path) -> str:
    try:
        return (entry / "name").read_text(errors="replace").strip()
    except OSError:
        return entry.name


def _query_camera(path: Path, name: str, ioctl: Ioctl) -> CameraDevice | None:
    """Return a camera with its picture sizes; None if the device gives no pictures."""
    try:
        number = os.open(path, os.O_RDWR | os.O_NONBLOCK)
    except OSError as error:
        return CameraDevice(path, name, trouble=_error_text(error))
    try:
        ask = partial(ioctl, number)
        return CameraDevice(path, name, _sizes(ask)) if _captures(ask) else None
    except OSError as error:
        return CameraDevice(path, name, trouble=_error_text(error))
    finally:
        os.close(number)


def _error_text(error: OSError) -> str:
    if error.errno == errno.EACCES:
        return "permission denied"
    return error.strerror or str(error)


def _captures(ask: Callable[[int, bytearray], object]) -> bool:
    data = bytearray(_QUERYCAP_SIZE)
    ask(_QUERYCAP, data)
    capabilities, device = struct.unpack_from("=II", data, 84)
    return bool((device if capabilities & _HAS_DEVICE_CAPS else capabilities) & _CAPTURE)


def _sizes(ask: Callable[[int, bytearray], object]) -> tuple[tuple[int, int], ...]:
    """Return the picture sizes of all formats of a camera; the largest size of a format with free scaling."""
    sizes: set[tuple[int, int]] = set()
    for form in range(_MAX_ENTRIES):
        data = bytearray(_ENUM_FMT_SIZE)
        struct.pack_into("=II", data, 0, form, _BUFFER_CAPTURE)
        if not _query_entry(ask, _ENUM_FMT, data):
            break
        (pixels,) = struct.unpack_from("=I", data, 44)
        for index in range(_MAX_ENTRIES):
            size = bytearray(_ENUM_FRAMESIZES_SIZE)
            struct.pack_into("=II", size, 0, index, pixels)
            if not _query_entry(ask, _ENUM_FRAMESIZES, size):
                break
            kind, *numbers = struct.unpack_from("=7I", size, 8)
            sizes.add((numbers[0], numbers[1]) if kind == _DISCRETE else (numbers[1], numbers[4]))
            if kind != _DISCRETE:
                break
    return tuple(sorted(sizes))


def _query_entry(ask: Callable[[int, bytearray], object], request: int, data: bytearray) -> bool:
    """Query one element of a list of the device into ``data``; return False after the last element."""
    try:
        ask(request, data)
    except OSError as error:
        if error.errno in (errno.EINVAL, errno.ENOTTY):
            return False
        raise
    return True
