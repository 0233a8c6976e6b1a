"""Machines as they are recorded: a few files below a folder, as /sys, /proc and /dev have them; and wires by hand."""

import os
from collections.abc import Sequence
from pathlib import Path

from drivers.api.probe import ProbeRequest
from drivers.clock import ManualClock
from drivers.finding.machine import HostMachine
from drivers.servos.virtual.chain import VirtualServoBus
from drivers.virtual.terminal import WireDevice, baud_rates_match

ME = 4242
"""The user of a recorded machine, who is in no group of ours unless a test says so."""


class RecordedMachine:
    """Writes the files of a machine below ``root``, device by device."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self._sockets = 0
        for folder in ("sys/class/tty", "dev", "proc"):
            (root / folder).mkdir(parents=True)

    @property
    def machine(self) -> HostMachine:
        return HostMachine(self.root)

    def stranger(self, *groups: int) -> HostMachine:
        """The machine as somebody sees it whose devices these are not."""
        return HostMachine(self.root, uid=ME, groups=frozenset(groups))

    def write(self, path: str, text: str) -> Path:
        file = self.root / path
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text + "\n")
        return file

    def usb(self, ids: str, serial: str = "", name: str = "") -> str:
        """Plug a USB device in; return its folder."""
        self._sockets += 1
        folder = f"sys/devices/pci0/usb1/1-{self._sockets}"
        vendor, _, product = ids.partition(":")
        for what, said in (("idVendor", vendor), ("idProduct", product), ("serial", serial), ("product", name)):
            if said:
                self.write(f"{folder}/{what}", said)
        self._link(f"sys/bus/usb/devices/1-{self._sockets}", folder)
        return folder

    def port(
        self,
        name: str,
        ids: str,
        *,
        serial: str = "",
        behind: str = "",
        latency: int | None = None,
        by_id: str = "",
        rule: str = "",
    ) -> str:
        """Plug a serial adapter in, which the pseudo-terminal ``behind`` stands for; return its path."""
        folder = f"{self.usb(ids, serial)}/1-{self._sockets}:1.0/{name}"
        (self.root / folder).mkdir(parents=True)
        (self.root / f"sys/class/tty/{name}").mkdir()
        self._link(f"sys/class/tty/{name}/device", folder)
        if latency is not None:
            self.write(f"sys/bus/usb-serial/devices/{name}/latency_timer", str(latency))
        node = self.root / f"dev/{name}"
        if behind:
            node.symlink_to(behind)
        else:
            self.write(f"dev/{name}", "").chmod(0o660)
        self._link(f"dev/serial/by-path/pci0-usb-0:{self._sockets}:1.0-port0", f"dev/{name}")
        for link in (f"dev/serial/by-id/{by_id}" if by_id else "", f"dev/{rule}" if rule else ""):
            if link:
                (self.root / link).unlink(missing_ok=True)  # of two that are alike the last one has it
                self._link(link, f"dev/{name}")
        return f"/dev/{name}"

    def unplug(self, name: str) -> None:
        """Pull a port out again."""
        (self.root / f"sys/class/tty/{name}/device").unlink()
        (self.root / f"sys/class/tty/{name}").rmdir()
        (self.root / f"dev/{name}").unlink()
        for link in (self.root / "dev").rglob("*"):
            if link.is_symlink() and not link.exists():
                link.unlink()

    def process(self, pid: int, name: str, *holds: str) -> None:
        """Run a program that has these devices open."""
        self.write(f"proc/{pid}/comm", name)
        (self.root / f"proc/{pid}/fd").mkdir()
        for number, path in enumerate(holds, 3):
            (self.root / f"proc/{pid}/fd/{number}").symlink_to(path)

    def camera(self, name: str = "HD Webcam") -> str:
        """Plug a camera in."""
        folder = f"{self.usb('046d:0825', name=name)}/1-{self._sockets}:1.0"
        (self.root / folder).mkdir()
        self.write("sys/class/video4linux/video0/name", name)
        self._link("sys/class/video4linux/video0/device", folder)
        self.write("dev/video0", "")
        return "/dev/video0"

    def _link(self, path: str, target: str) -> None:
        link = self.root / path
        link.parent.mkdir(parents=True, exist_ok=True)
        link.symlink_to(os.path.relpath(self.root / target, link.parent))


def gives_pictures(number: int, request: int, data: bytearray) -> None:
    """Answer for a camera that says no more than that it has pictures: a ``drivers.finding.video.Ioctl``."""
    del number
    if request != 0x80685600:
        raise OSError(22, os.strerror(22))
    data[84:88] = (1).to_bytes(4, "little")


class HandAsked:
    """A ``drivers.finding.port_probe.ProbeWire`` to a virtual device, in its own time; it stores all sent bytes."""

    def __init__(self, device: WireDevice | None) -> None:
        self.sent: list[tuple[int, bytes]] = []
        self.clock = ManualClock()
        self._device = device
        self._tune = device.set_baud if isinstance(device, VirtualServoBus) else lambda baud: None  # noqa: ARG005

    def exchange(self, request: ProbeRequest) -> bytes:
        self.sent.append((request.baud, request.send))
        heard, echo, end = b"", b"", self.clock.now() + request.timeout
        self._tune(request.baud)
        arrived = self._said(request, request.send)
        while True:
            heard += arrived
            if request.send and not echo and heard.startswith(request.send):
                heard, echo = heard.removeprefix(request.send), request.send
            if request.is_complete(heard) or self.clock.now() >= end:
                return echo + heard if request.keep_echo else heard
            self.clock.advance(0.001)
            arrived = self._said(request)

    def _said(self, question: ProbeRequest, data: bytes = b"") -> bytes:
        if self._device is None:
            return b""
        agreed, now = baud_rates_match(self._device.baud, question.baud), self.clock.now()
        said = self._device.feed(data, now) if data and agreed else self._device.poll(now)
        return said if agreed else b""

    @property
    def bytes_sent(self) -> bytes:
        return b"".join(data for _, data in self.sent)


def sent_instructions(sent: Sequence[tuple[int, bytes]]) -> set[int]:
    """Return the instructions of all frames of servos among what was sent, of both protocols."""
    found = set()
    for _, data in sent:
        if data.startswith(b"\xff\xff\xfd\x00"):
            found.add(data[7])
        elif data.startswith(b"\xff\xff"):
            found.add(data[4])
    return found
