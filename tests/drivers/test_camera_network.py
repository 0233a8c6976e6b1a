"""Cameras in the network: what they send, how they fall silent, and that none of it takes the run down."""

import os
import signal
import ssl
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from http.client import HTTPResponse
from pathlib import Path
from queue import Queue
from threading import Event

import cv2
import numpy as np
import pytest

from drivers.api import CameraFrame, DeviceStatus, Image
from drivers.api.secrets import without_secrets
from drivers.camera import reader
from drivers.camera.make import open_source
from drivers.camera.web import WebFeed
from drivers.clock import SystemClock
from drivers.pictures import decode
from drivers.pictures.capture import MAX_UNREAD_SKIP, ThreadedCamera
from drivers.pictures.decode import NO_PICTURE, SKIPPED_PICTURE
from tests.drivers.web_cameras import MJPEG, OK, Connection, WebCamera, answer, jpeg, part
from tests.waiting import wait_until

Answer = Callable[[Connection], None]


@contextmanager
def watched(source: str, notices: "Queue[DeviceStatus] | None" = None) -> Iterator[ThreadedCamera]:
    """Open a camera, and close it after the test."""
    report = (lambda _: None) if notices is None else notices.put
    camera = open_source(source, SystemClock(), retry=0.05, report=report)
    camera.open()
    try:
        yield camera
    finally:
        camera.close()


def shown(camera: ThreadedCamera, count: int = 1) -> list[CameraFrame]:
    """Return the next pictures."""
    found = list[CameraFrame]()

    def came() -> bool:
        frame = camera.read(0.1)
        found.extend([] if frame is None else [frame])
        return len(found) >= count

    wait_until(came)
    return found


def children(parent: int) -> set[int]:
    """Return the processes that a process has started and that are alive."""
    found = set()
    for path in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):  # it has just ended
            state, of = path.read_text().rpartition(")")[2].split()[:2]
            if int(of) == parent and state != "Z":
                found.add(int(path.parent.name))
    return found


def endless(connection: Connection) -> None:
    connection.send(MJPEG)
    connection.stream()


def test_stream_shows_its_pictures_and_leaves_no_process() -> None:
    before = children(os.getpid())
    with WebCamera(endless) as web:
        with watched(f"{web.url}/stream") as camera:
            frames = shown(camera, 3)
            assert children(os.getpid()) > before
        assert children(os.getpid()) <= before
    assert frames[0].image.shape == (48, 64, 3)
    assert frames[0].number < frames[1].number < frames[2].number


def stalled(connection: Connection) -> None:
    connection.send(MJPEG + part(jpeg(10)))
    connection.pause(60)


def silent_from_the_start(connection: Connection) -> None:
    connection.pause(60)


def silent_after_its_head(connection: Connection) -> None:
    connection.send(MJPEG)
    connection.pause(60)


def half_a_picture(connection: Connection) -> None:
    connection.send(MJPEG + part(jpeg(10)) + part(jpeg(20))[:300])
    connection.pause(60)


def drop_by_drop(connection: Connection) -> None:
    for byte in MJPEG + 100 * b"x-more: of it\r\n":
        connection.send(bytes([byte]))
        connection.pause(0.05)


SILENT: tuple[Answer, ...] = (stalled, silent_from_the_start, silent_after_its_head, half_a_picture, drop_by_drop)


@pytest.mark.parametrize("behaviour", SILENT)
def test_silent_camera_is_closed_at_once_and_leaves_no_process(behaviour: Answer) -> None:
    before = children(os.getpid())
    with WebCamera(behaviour) as web:
        with watched(f"{web.url}/stream") as camera:
            wait_until(lambda: web.connections)
            camera.read(0.1)
            clock = SystemClock()
            camera.close()
            assert clock.now() < 4
        assert children(os.getpid()) <= before


PROGRAM = """
import sys
from drivers.camera.make import open_source
from drivers.clock import SystemClock
camera = open_source(sys.argv[1], SystemClock())
camera.open()
for _ in range(int(sys.argv[2])):
    camera.read(0.1)
print("success", flush=True)
if sys.argv[3] == "raise":
    raise ValueError("planted")
if sys.argv[3] == "wait":
    sys.stdin.read()
"""


def program(*arguments: str) -> "subprocess.Popen[str]":
    return subprocess.Popen(
        [sys.executable, "-c", PROGRAM, *arguments],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip


@pytest.mark.parametrize("behaviour", SILENT)
@pytest.mark.parametrize(("end", "code"), [("exit", 0), ("raise", 1)])
def test_python_exits_cleanly_with_an_unclosed_camera(behaviour: Answer, end: str, code: int) -> None:
    with WebCamera(behaviour) as web, program(f"{web.url}/stream", "5", end) as run:
        out, _ = run.communicate(timeout=60)
        assert (out, run.returncode) == ("success\n", code)


def test_killed_run_ends_its_reader_process() -> None:
    with WebCamera(stalled) as web, program(f"{web.url}/stream", "8", "wait") as run:
        assert run.stdout is not None
        assert run.stdout.readline() == "success\n"
        (child,) = children(run.pid)
        run.kill()
        run.wait()
        wait_until(lambda: not Path(f"/proc/{child}").exists())


def test_crashed_reader_is_reported_and_restarted() -> None:
    notices = Queue[DeviceStatus]()
    with WebCamera(endless) as web, watched(f"{web.url}/stream", notices) as camera:
        shown(camera)
        for child in children(os.getpid()):
            os.kill(child, signal.SIGSEGV)
        assert notices.get(timeout=30).kind == "online"
        lost = notices.get(timeout=30)
        assert (lost.kind, "its reader process ended by SIGSEGV" in lost.message) == ("offline", True)
        shown(camera)
        back = notices.get(timeout=30)
        assert (back.kind, back.message) == ("online", f"{web.url}/stream gives pictures again")


def test_hiccup_and_its_end_are_reported_on_the_same_connection() -> None:
    def hiccup(connection: Connection) -> None:
        connection.send(MJPEG)
        connection.stream(count=5)
        connection.pause(2.6)
        connection.stream()

    notices = Queue[DeviceStatus]()
    with WebCamera(hiccup) as web, watched(f"{web.url}/stream", notices) as camera:
        shown(camera)  # from then on nobody reads: it is told nevertheless
        told = [notices.get(timeout=30) for _ in range(3)]
        assert [notice.kind for notice in told] == ["online", "offline", "online"]
        assert "no picture for 2." in told[1].message
        assert told[2].message.endswith("gives pictures again")
        assert len(web.connections) == 1


def test_silent_stream_is_reconnected(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reader, "STALL_TIMEOUT", 0.5)

    def once_silent(connection: Connection) -> None:
        (stalled if connection.number == 0 else endless)(connection)

    with WebCamera(once_silent) as web, watched(f"{web.url}/stream") as camera:
        shown(camera, 4)
        assert len(web.connections) == 2


def chunked(connection: Connection) -> None:
    """Send as the server of an ESP32 does."""
    connection.send(MJPEG.replace(b"\r\n\r\n", b"\r\nTransfer-Encoding: chunked\r\n\r\n"))
    for level in range(20, 220):
        for piece in (b"\r\n--frame\r\n", b"Content-Type: image/jpeg\r\n\r\n", jpeg(level)):
            connection.send(b"%x\r\n%s\r\n" % (len(piece), piece))
        connection.pause(0.02)


def without_lengths(connection: Connection) -> None:
    connection.send(MJPEG)
    for level in range(20, 220):
        connection.send(b"--frame\r\nContent-Type: image/jpeg\r\n\r\n" + jpeg(level) + b"\r\n")
        connection.pause(0.02)


def with_wrong_lengths(connection: Connection) -> None:
    connection.send(MJPEG)
    for level in range(20, 220):
        connection.send(b"--frame\r\nContent-Length: 0\r\n\r\n" + jpeg(level) + b"\r\n")
        connection.pause(0.02)


def torn(connection: Connection) -> None:
    """Send half pictures, empty ones and nonsense between whole ones."""
    connection.send(MJPEG)
    for level in range(20, 220):
        picture = jpeg(level)
        for each in (picture[: len(picture) // 2], b"", b"\xff\xd8\xff\xe0nonsense", picture):
            connection.send(part(each))
        connection.pause(0.02)


def of_changing_size(connection: Connection) -> None:
    connection.send(MJPEG)
    for number in range(200):
        connection.send(part(jpeg(90, (64 + 16 * (number % 3), 48))))
        connection.pause(0.02)


def in_no_kind(connection: Connection) -> None:
    connection.send(OK + b"\r\n")
    for level in range(20, 220):
        connection.send(jpeg(level))
        connection.pause(0.02)


@pytest.mark.parametrize(
    "behaviour", [chunked, without_lengths, with_wrong_lengths, torn, of_changing_size, in_no_kind]
)
def test_pictures_are_found_between_any_stream_data(behaviour: Answer) -> None:
    with WebCamera(behaviour) as web, watched(f"{web.url}/") as camera:
        frames = shown(camera, 4)
        assert all(frame.image[0, 0, 0] > 200 for frame in frames)
        assert all(abs(float(frame.image[40:, 40:].std())) < 2 for frame in frames)


def test_snapshot_address_is_requested_repeatedly() -> None:
    def snapshot(connection: Connection) -> None:
        if connection.number % 4 == 1:
            connection.send(answer(b"", status="503 Service Unavailable"))
        elif connection.number % 4 == 2:
            connection.send(answer(b""))
        else:
            connection.send(answer(jpeg(20 + connection.number % 200)))

    notices = Queue[DeviceStatus]()
    with WebCamera(snapshot) as web, watched(f"{web.url}/capture", notices) as camera:
        clock = SystemClock()
        shown(camera, 6)
        assert len(web.connections) <= 2 + 9 * clock.now()
        assert camera.health().online
    assert notices.get_nowait().kind == "online"
    assert all(notice.kind == "fault" for notice in notices.queue)  # some are late


def test_mjpeg_stream_over_tcp_has_one_connection() -> None:
    """Read what ``rpicam-vid --codec mjpeg --listen -o tcp://0.0.0.0:8888`` sends: JPEG after JPEG, to one client."""

    def rpicam(connection: Connection) -> None:
        for number in range(1_000):
            connection.send(jpeg(20 + number % 200))
            connection.pause(0.02)

    with WebCamera(rpicam, asks=False) as web, watched(f"tcp://127.0.0.1:{web.port}") as camera:
        assert shown(camera, 4)[-1].image.shape == (48, 64, 3)
        assert len(web.connections) == 1


def test_snapshot_is_read_when_its_last_byte_closes_the_response(monkeypatch: pytest.MonkeyPatch) -> None:
    read1 = HTTPResponse.read1

    def read_and_close(response: HTTPResponse, size: int = -1) -> bytes:  # as Python 3.13 does
        data = read1(response, size)
        if response.length == 0:
            response.close()
        return data

    def snapshot(connection: Connection) -> None:
        connection.send(answer(jpeg(100)))

    monkeypatch.setattr(HTTPResponse, "read1", read_and_close)
    with WebCamera(snapshot) as web:
        feed = WebFeed("camera", f"{web.url}/capture")
        feed.start()
        images = [feed.grab(lambda: True) for _ in range(2)]
        feed.stop()
    assert [image is not None and image.shape for image in images] == [(48, 64, 3)] * 2


def test_film_over_tcp_goes_to_ffmpeg_on_the_same_connection(tmp_path: Path) -> None:
    film = tmp_path / "film.avi"
    writer = cv2.VideoWriter(str(film), cv2.VideoWriter.fourcc(*"MJPG"), 10.0, (64, 48))
    for level in range(100):
        writer.write(np.full((48, 64, 3), level, np.uint8))
    writer.release()

    def send(connection: Connection) -> None:
        connection.send(film.read_bytes())
        connection.pause(60)

    with WebCamera(send, asks=False) as web, watched(f"tcp://127.0.0.1:{web.port}") as camera:
        shown(camera, 1)
        assert len(web.connections) == 1


def page(body: str, status: str = "200 OK", *heads: str) -> Answer:
    return lambda connection: connection.send(answer(body.encode(), "text/html; charset=utf-8", status, *heads))


def plain(data: bytes) -> Answer:
    return lambda connection: connection.send(data)


REFUSALS: tuple[tuple[Answer, str, str], ...] = (
    (page("", "401 Unauthorized"), "requires a user name and a password (401 Unauthorized)", "http://NAME:PASSWORD@127.0.0.1:"),
    (page("", "401 Unauthorized", "WWW-Authenticate: Bearer x"), "methods: 'Bearer x'", "choose Basic"),
    (page("", "401 Unauthorized", "WWW-Authenticate: Digest x"), "methods: 'Digest x'", "choose Basic"),
    (page("", "403 Forbidden"), "denies access (403 Forbidden)", "one viewer at a time"),
    (page("", "404 Not Found"), "has no page at this address (404 Not Found)", ":81/stream"),
    (page("", "503 Service Unavailable"), "is busy or faulty (503 Service Unavailable)", "one viewer at a time"),
    (page("", "299 Odd"), "is a web page", "an address of its own"),
    (page("", "418 Teapot"), "replied 418", "usual addresses"),
    (page("<title>My Cam</title>"), "is a web page without pictures: 'My Cam'", "an address of its own"),
    (page("<input type='password'>"), "is a login page", "NAME:PASSWORD@"),
    (plain(b"SSH-2.0-OpenSSH_9.2\r\n"), "does not speak HTTP on port", "usual addresses"),
    (plain(b"\x15\x03\x01\x00\x02\x02\x16\r\n"), "does not speak HTTP on port", "write https://"),
    (plain(b""), "closed the connection without a reply", "one viewer at a time"),
    (plain(OK + 200 * b"x: y\r\n" + b"\r\n"), "its reply is not HTTP", "usual addresses"),
    (plain(b"HTTP/1.1 302 Found\r\nLocation: /again\r\n\r\n"), "redirects endlessly (302 Found)", "usual addresses"),
    (plain(b"HTTP/1.1 302 Found\r\nLocation: rtsp://me:secret@cam/x\r\n\r\n"), "redirects to rtsp://***@cam", "write"),
)  # fmt: skip


@pytest.mark.parametrize(("behaviour", "reason", "hint"), REFUSALS, ids=[reason[:30] for _, reason, _ in REFUSALS])
def test_address_without_pictures_gives_the_reason(behaviour: Answer, reason: str, hint: str) -> None:
    with WebCamera(behaviour) as web, watched(f"{web.url}/stream") as camera:
        wait_until(lambda: reason in camera.health().detail)
        assert hint in camera.health().hint


def rtsp(status: str) -> Answer:
    def behave(connection: Connection) -> None:
        while True:
            connection.request = b""
            connection.read()
            (sequence,) = [line for line in connection.request.decode().split("\r\n") if line.startswith("CSeq")]
            connection.send(f'RTSP/1.0 {status}\r\n{sequence}\r\nWWW-Authenticate: Basic realm="cam"\r\n\r\n'.encode())

    return behave


@pytest.mark.parametrize(
    ("status", "names", "reason", "hint"),
    [
        ("401 Unauthorized", "", "requires a user name and a password (401", "rtsp://NAME:PASSWORD@127.0.0.1:"),
        ("401 Unauthorized", "me:secret@", "refuses this user name or password (401", "in an address @ is %40"),
        ("404 Not Found", "", "has no page at this address (404", "usual addresses"),
        ("453 Not Enough Bandwidth", "me:secret@", "cannot be opened as a stream", "ffplay rtsp://***@"),
    ],
)
def test_refusing_rtsp_camera_gives_the_reason(
    monkeypatch: pytest.MonkeyPatch, status: str, names: str, reason: str, hint: str
) -> None:
    monkeypatch.setenv(decode.FFMPEG_LOG_LEVEL, decode.FFMPEG_SILENT)  # as in a process that has read a picture before
    with WebCamera(rtsp(status), asks=False) as web, watched(f"rtsp://{names}127.0.0.1:{web.port}/x") as camera:
        wait_until(lambda: reason in camera.health().detail)
        health = camera.health()
        assert hint in health.hint
        assert "secret" not in health.detail + health.hint


@pytest.mark.parametrize(
    ("source", "reason", "hint"),
    [
        ("http://127.0.0.1:9/", "connection refused: nothing listens on port 9 of 127.0.0.1", "is 9 its port?"),
        ("tcp://127.0.0.1:9", "connection refused", "rpicam-vid needs --listen"),
        ("rtsp://127.0.0.1:9/x", "cannot be opened as a stream: connection refused", "RTSP cameras on 554"),
        ("http://no-such-camera.invalid/", "no such host: no-such-camera.invalid", "ping no-such-camera.invalid"),
        ("rtsp://no-such-camera.invalid/", "no such host: no-such-camera.invalid", "ping no-such-camera.invalid"),
        ("http://127.0.0.1:port/", "invalid host or port", "%3A"),
        ("http:///stream", "has no host", "http://HOST/"),
        ("http://me:p[w@127.0.0.1:9/", "invalid host or port", "[ is %5B"),
        ("rtsp://me:p[w@127.0.0.1:9/", "invalid host or port", "[ is %5B"),
        ("tcp://[::1", "invalid host or port", "[ is %5B"),
        ("tcp://127.0.0.1", "has no host or no port", "tcp://HOST:8888"),
        ("nonsense://127.0.0.1/", "cannot be opened as a stream", "ffplay nonsense://127.0.0.1/"),
    ],
)
def test_address_that_does_not_open_gives_the_reason(source: str, reason: str, hint: str) -> None:
    with watched(source) as camera:
        wait_until(lambda: reason in camera.health().detail)
        assert hint in camera.health().hint


@pytest.mark.parametrize("scheme", ["Basic", "Digest"])
def test_user_and_password_are_sent_and_never_shown(scheme: str) -> None:
    asks = {"Basic": 'Basic realm="cam"', "Digest": 'Digest realm="cam", nonce="abc", qop="auth", algorithm=MD5'}[
        scheme
    ]
    refused = answer(b"", "text/plain", "401 Unauthorized", f"WWW-Authenticate: {asks}")

    def guarded(connection: Connection) -> None:
        known = b"Authorization: Basic bWU6cEBzcw==" in connection.request or b'username="me"' in connection.request
        connection.send(MJPEG if known else refused)
        if known:
            connection.stream()

    with WebCamera(guarded) as web:
        place = web.url.removeprefix("http://")
        notices = Queue[DeviceStatus]()
        with watched(f"http://me:p%40ss@{place}/stream", notices) as camera:
            shown(camera)
        assert notices.get_nowait().message == f"http://***@{place}/stream gives pictures"
        with watched(f"http://you:p%40ss@{place}/stream") as camera:
            if scheme == "Basic":
                wait_until(lambda: "refuses this user name or password (401" in camera.health().detail)
                assert "p%40ss" not in camera.health().detail + camera.health().hint


UNSUPPORTED = ("algorithm=SHA-512-256", 'qop="auth-int"', 'qop="auth-int", algorithm=MD5', 'algorithm="MD5-sess"')


@pytest.mark.parametrize("heads", UNSUPPORTED)
def test_basic_authentication_is_used_beside_an_unsupported_digest(heads: str) -> None:
    digest = f'WWW-Authenticate: Digest realm="cam", nonce="abc", {heads}'

    def guarded(connection: Connection) -> None:
        known = b"Authorization: Basic bWU6c2VjcmV0" in connection.request
        basic = ("WWW-Authenticate: Basic realm=cam",) if b"both" in connection.request else ()
        connection.send(MJPEG if known else answer(b"", "text/plain", "401 Unauthorized", digest, *basic))
        if known:
            connection.stream()

    with WebCamera(guarded) as web:
        place = web.url.replace("://", "://me:secret@")
        with watched(f"{place}/both") as camera:
            shown(camera)
        with watched(f"{place}/one") as camera:
            wait_until(lambda: "offers only unsupported authentication methods" in camera.health().detail)


def test_camera_recovers_after_memory_or_descriptors_ran_out(monkeypatch: pytest.MonkeyPatch) -> None:
    take = reader.ReaderProcess.copy_picture
    troubles = [OSError(24, "Too many open files"), MemoryError()]

    def starved(process: reader.ReaderProcess, shape: tuple[int, int]) -> Image:
        if troubles:
            raise troubles.pop()
        return take(process, shape)

    monkeypatch.setattr(reader.ReaderProcess, "copy_picture", starved)
    with WebCamera(endless) as web, watched(web.url) as camera:
        shown(camera)
    assert not troubles


def test_untrusted_certificate_is_explained(tmp_path: Path) -> None:
    key, made = tmp_path / "key.pem", tmp_path / "cert.pem"
    command = ["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-subj", "/CN=cam"]
    subprocess.run([*command, "-keyout", str(key), "-out", str(made)], check=True, capture_output=True)
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(made, key)
    web = WebCamera(endless, tls=lambda peer: context.wrap_socket(peer, server_side=True))
    with web, watched(web.url.replace("http", "https")) as camera:
        wait_until(lambda: "its TLS certificate is not trusted: self" in camera.health().detail)
        assert "SSL_CERT_FILE=camera.pem" in camera.health().hint
    web = WebCamera(plain(b"HTTP/1.1 400 Bad Request\r\n\r\n"), asks=False)
    with web, watched(web.url.replace("http", "https")) as camera:
        wait_until(lambda: "does not speak TLS on port" in camera.health().detail)


@pytest.mark.parametrize(
    ("address", "safe"),
    [
        ("rtsp://me:secret@h:9/x", "rtsp://***@h:9/x"),
        ("http://me:s@cret@h/x", "http://***@h/x"),
        ("http://me:sec/r@et@h/x", "http://***@h/x"),
        ("http://secret@h/", "http://***@h/"),
        ("http://h/a@b", "http://h/a@b"),
        ("http://[::1]:80/a@b", "http://[::1]:80/a@b"),
        ("http://h/cgi?usr=secret&pwd=secret&x=1", "http://h/cgi?usr=***&pwd=***&x=1"),
        ("rtsp://h:554/user=secret&password=secret&channel=1", "rtsp://h:554/user=***&password=***&channel=1"),
        ("http://h/cgi?u=1&pw=secret", "http://h/cgi?u=1&pw=***"),
        ("http:/me:secret@h/x", "http:/***@h/x"),
        ("C:/my@home/x", "C:/my@home/x"),
        ("see http://me:secret@h/x, and http://me:secret@z", "see http://***@h/x, and http://***@z"),
    ],
)
def test_secrets_of_an_address_are_not_shown(address: str, safe: str) -> None:
    assert without_secrets(address) == safe


def test_reader_skips_the_requested_number_of_pictures() -> None:
    first, decoded = 0, list[bool]()  # the number of the first picture needed; of each picture, whether it was decoded

    def spare() -> int:
        return max(0, first - len(decoded))

    def grab(pictures: int) -> list[bool]:
        """Return of the next pictures whether they were decoded."""
        begin = len(decoded)
        while len(decoded) < begin + pictures and (image := feed.grab(spare)) is not None:
            decoded.extend([image is not SKIPPED_PICTURE] if image is not NO_PICTURE else [])
        return decoded[begin:]

    with WebCamera(endless) as web:
        feed, ending = reader.ReaderFeed("camera", web.url), Event()
        try:
            assert feed.start(ending) is None
            assert grab(1) == [True]
            first = 6
            assert grab(7) == [False] * 5 + [True] * 2
            first = MAX_UNREAD_SKIP
            assert not any(grab(3))
            first = 0
            feed.skip_next(0)  # as another thread does, while the reader waits for the last of them
            wait_until(lambda: grab(1) == [True])
        finally:
            ending.set()
            feed.stop()
        feed.skip_next(1)  # nobody is there to hear it
