"""Which cameras are plugged in, by the Linux video interface (V4L2): their names and the sizes of their pictures.

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
"""``fcntl.ioctl``, or what stands in for it: changes the bytes, and raises OSError for what the device refuses."""

SYSTEM_FOLDER = Path("/sys/class/video4linux")
DEVICE_FOLDER = Path("/dev")

_QUERYCAP, _QUERYCAP_SIZE = 0x80685600, 104
_ENUM_FMT, _ENUM_FMT_SIZE = 0xC0405602, 64
_ENUM_FRAMESIZES, _ENUM_FRAMESIZES_SIZE = 0xC02C564A, 44
_CAPTURE, _HAS_DEVICE_CAPS = 0x1, 0x80000000
_BUFFER_CAPTURE = 1
_DISCRETE = 1
_MAX_ENTRIES = 64  # of formats and of sizes: a device that never says "no more" must not hang us


CSI_RECEIVERS = ("unicam", "rp1-cfe")
"""How the names begin of the devices that receive the raw data of a CSI camera, on a Raspberry Pi up to 4, and 5."""

CSI_PROCESSORS = ("bcm2835-isp", "pispbe")
"""How the names begin of the devices that make pictures of that, for libcamera alone."""

CSI_TROUBLE = "a camera of the CSI connector, which OpenCV cannot read: libcamera alone can"

CSI_SOURCE = "tcp://127.0.0.1:8888"

CSI_HINT = (
    f"rpicam-vid -t 0 -n --codec mjpeg --width 640 --height 480 --listen -o {CSI_SOURCE}"
    f"  and `source: {CSI_SOURCE}` (docs/cameras.md)"
)


@dataclass(frozen=True, slots=True)
class CameraDevice:
    """One camera: its ``path``, the ``name`` that it gives itself, and its pictures' sizes (width, height), rising.

    ``trouble`` says why it could not be asked for them, "" when it could. ``csi`` is for a camera of a Raspberry Pi's
    CSI connector, which has no pictures for OpenCV.
    """

    path: Path
    name: str
    sizes: tuple[tuple[int, int], ...] = ()
    trouble: str = ""
    csi: bool = False


def list_devices(
    system: Path = SYSTEM_FOLDER, devices: Path = DEVICE_FOLDER, ioctl: Ioctl = fcntl.ioctl
) -> list[CameraDevice]:
    """Return the cameras in the order of their numbers, without those devices of them that give no pictures.

    A webcam shows up twice or more: as its pictures, and as data about them. Empty also where there is no V4L2.
    """
    if not system.is_dir():
        return []
    entries = sorted(system.glob("video*"), key=lambda entry: (len(entry.name), entry.name))
    found, received = list[CameraDevice | None](), set[str]()
    for entry in entries:
        name, path = _name(entry), devices / entry.name
        if receiver := next((each for each in CSI_RECEIVERS if name.startswith(each)), ""):
            if receiver not in received:  # one has several devices
                found.append(CameraDevice(path, name, trouble=CSI_TROUBLE, csi=True))
            received.add(receiver)
        elif not name.startswith(CSI_PROCESSORS):
            found.append(_query_camera(path, name, ioctl))
    return [device for device in found if device is not None]


def is_csi(path: Path, system: Path = SYSTEM_FOLDER) -> bool:
    """Whether a device is that of a CSI camera, which OpenCV cannot read."""
    return _name(system / path.resolve().name).startswith((*CSI_RECEIVERS, *CSI_PROCESSORS))


def _name(entry: Path) -> str:
    try:
        return (entry / "name").read_text(errors="replace").strip()
    except OSError:
        return entry.name


def _query_camera(path: Path, name: str, ioctl: Ioctl) -> CameraDevice | None:
    """Ask a device what it gives; None when that is no pictures."""
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
    """Return the sizes of all its formats; of one that scales freely, the largest."""
    found: set[tuple[int, int]] = set()
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
            found.add((numbers[0], numbers[1]) if kind == _DISCRETE else (numbers[1], numbers[4]))
            if kind != _DISCRETE:
                break
    return tuple(sorted(found))


def _query_entry(ask: Callable[[int, bytearray], object], request: int, data: bytearray) -> bool:
    """Ask for one entry of a list; False behind its end."""
    try:
        ask(request, data)
    except OSError as error:
        if error.errno in (errno.EINVAL, errno.ENOTTY):
            return False
        raise
    return True
